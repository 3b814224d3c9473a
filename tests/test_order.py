"""Several processes begin with tests of different kernels, and each test stays in the list once.

One of them compiles a kernel that several meet.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.order import APART, parted
from tests.patience import ENOUGH


def folder_of(name: str) -> str:
    return name.partition("/")[0]


NAMES = [
    f"{folder}/{n}"
    for folder in ("c45", "cart", "cli", "files", "mdp", "neural", "report", "world_model")
    for n in range(5)
]


@pytest.mark.parametrize("n_processes", [2, 3, 4])
def test_the_first_two_parts_begin_with_the_two_halves_of_the_kernels(n_processes):
    order = parted(NAMES, folder_of, n_processes)
    assert sorted(order) == sorted(NAMES)
    assert order[0] == "c45/0"
    assert folder_of(order[max(10, len(NAMES) // n_processes)]) == "cart"


def test_the_tests_of_a_folder_stay_in_order():
    order = parted(NAMES, folder_of, 2)
    for folder in ("c45", "cart", "files"):
        own = [name for name in order if folder_of(name) == folder]
        assert own == sorted(own)


def test_one_process_runs_them_as_they_are():
    assert parted(NAMES, folder_of, 1) == NAMES


def test_a_part_of_one_half_alone_is_kept_whole():
    only = [name for name in NAMES if folder_of(name) == "c45"]
    assert parted(only, folder_of, 2) == only
    assert parted([], folder_of, 2) == []


def test_the_folders_are_there():
    here = Path(__file__).parent
    assert [f for half in APART for f in half if not any(here.rglob(f))] == []
    assert not set(APART[0]) & set(APART[1])


MEETS_A_KERNEL = """
import sys, time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from tests.order import compiling_alone

here, own, is_alone, patience = Path(sys.argv[1]), sys.argv[2], sys.argv[3] == "1", sys.argv[4]

def compiling(dispatcher, types):  # as numba's does: it looks on the disk, compiles and keeps
    if (here / "kept").exists():
        return
    (here / f"compiles-{own}").touch()
    end = time.monotonic() + float(patience)
    while len(list(here.glob("compiles-*"))) < 2 and time.monotonic() < end:
        time.sleep(0.01)
    (here / "kept").touch()

if is_alone:
    compiling = compiling_alone(compiling, nullcontext())
compiling(SimpleNamespace(_cache=SimpleNamespace(cache_path=here), py_func=nullcontext), ())
"""


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX locks")
@pytest.mark.parametrize(("is_alone", "patience", "n_compile"), [(1, 0.5, 1), (0, ENOUGH, 2)])
def test_one_of_two_that_meet_a_kernel_compiles_it(tmp_path, is_alone, patience, n_compile):
    words = [str(word) for word in (is_alone, patience)]
    meets, root = [sys.executable, "-c", MEETS_A_KERNEL], Path(__file__).parents[1]
    both = [subprocess.Popen([*meets, str(tmp_path), own, *words], cwd=root) for own in "ab"]
    assert [process.wait(ENOUGH) for process in both] == [0, 0]
    assert len(list(tmp_path.glob("compiles-*"))) == n_compile
