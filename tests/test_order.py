"""Several processes begin with tests of different kernels, and each test stays in the list once."""

from pathlib import Path

import pytest

from tests.order import APART, parted


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
