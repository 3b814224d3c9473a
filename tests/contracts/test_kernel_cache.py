"""Compiled kernels come back from the cache on disk, whatever another version left there."""

import os
import subprocess
import sys

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
