"""Compiled kernels come back from the cache on disk, whatever another version left there."""

import errno
import importlib
import os
import subprocess
import sys

import pytest

from eutree import compiled

KERNEL = """
from typing import NamedTuple

import numpy as np

from eutree.compiled import compiled


class {name}(NamedTuple):
    values: np.ndarray


@compiled
def total(pair):
    return pair.values.size


if __name__ == "__main__":
    import kernel

    print(kernel.total(kernel.{name}(np.arange({n}.0))), kernel.total.stats.cache_hits)
"""


TWO_KERNELS = """
import ctypes, os, sys
if os.geteuid() == 0 and len(sys.argv) == 1:  # give up root's right to pass over permissions
    for capability in (1, 2):
        ctypes.CDLL(None).prctl(24, capability)
    os.execv(sys.executable, [sys.executable, *sys.argv, "again"])

from eutree.compiled import compiled


@compiled
def add(a, b):
    return a + b


@compiled
def twice(a):
    return add(a, a)


if __name__ == "__main__":
    print(twice(4), twice(2.5))
"""


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX permissions")
@pytest.mark.parametrize("writable", [False, True])
def test_kernels_are_compiled_where_nothing_can_be_written(tmp_path, writable):
    """Every command died with "cannot cache function" in a read-only container."""
    package, home = tmp_path / "package", tmp_path / "home"
    for folder in (package, home):
        folder.mkdir()
    (package / "two_kernels.py").write_text(TWO_KERNELS)
    for folder in (package, home):
        folder.chmod(0o755 if writable else 0o555)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "PYTHONDONTWRITEBYTECODE": "1",
        "EUTREE_JIT": "1",
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
    }
    environment.pop("NUMBA_CACHE_DIR", None)
    run = [sys.executable, str(package / "two_kernels.py")]
    done = subprocess.run(run, env=environment, capture_output=True, text=True, cwd=home)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["8", "5.0"]
    assert done.stderr.count("NUMBA_CACHE_DIR") == (0 if writable else 1)
    assert bool(list(package.rglob("*.nbi"))) == writable


@pytest.mark.skipif(not compiled.ENABLED, reason="nothing is compiled")
def test_a_disk_without_room_for_the_cache_is_no_fault(tmp_path, monkeypatch):
    class Full(compiled._Cache):
        _impl_class = compiled._Cache._impl_class

        def _save_overload(self, sig, data):
            raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setattr(compiled, "_Cache", Full)
    monkeypatch.setattr(compiled, "_said", False)
    (tmp_path / "kernel_on_a_full_disk.py").write_text("def half(a):\n    return a / 2\n")
    monkeypatch.syspath_prepend(tmp_path)
    half = compiled.compiled(importlib.import_module("kernel_on_a_full_disk").half)
    with pytest.warns(UserWarning, match="no space left on device.*NUMBA_CACHE_DIR"):
        assert half(3) == 1.5
    assert half(3.0) == 1.5


def test_a_cache_that_names_a_class_which_is_gone_is_made_anew(tmp_path):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "EUTREE_JIT": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    printed = []
    for name, n in [("Old", 3), ("Old", 3), ("Renamed", 4), ("Renamed", 4)]:
        (tmp_path / "kernel.py").write_text(KERNEL.format(name=name, n=n))
        os.utime(tmp_path / "kernel.py", (n, n))
        run = [sys.executable, str(tmp_path / "kernel.py")]
        out = subprocess.run(run, env=environment, capture_output=True, text=True, cwd=tmp_path)
        assert out.returncode == 0, out.stderr
        printed.append(out.stdout.split())
    assert [line[0] for line in printed] == ["3", "3", "4", "4"]
    assert [len(line[1]) > len("Counter()") for line in printed] == [False, True, False, True]


@pytest.mark.skipif(not compiled.ENABLED, reason="nothing is compiled")
def test_code_of_another_llvm_is_compiled_anew(tmp_path):
    """Two processes after an upgrade: one has written the index, the code is still the old one."""
    (tmp_path / "kernel.py").write_text(KERNEL.format(name="Pair", n=3))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "EUTREE_JIT": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)

    def printed():
        run = [sys.executable, str(tmp_path / "kernel.py")]
        done = subprocess.run(run, env=environment, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()[0]

    assert printed() == "3"
    (code,) = tmp_path.rglob("*.nbc")
    signature = b"BC\xc0\xde"
    assert signature in code.read_bytes()
    code.write_bytes(code.read_bytes().replace(signature, b"XX\xc0\xde"))
    assert printed() == "3"
    assert signature in code.read_bytes()
