"""The learners do to the bit what they did when their behaviour was frozen."""

import hashlib
import json
from pathlib import Path

import pytest

from tests.golden.behaviour.cases import CASES, RACED, SEEDS, behaviour, name_of
from tests.golden.behaviour.others import OTHER_SEEDS, OTHERS, other_behaviour

FOLDER = Path(__file__).parent


def frozen(case, seed):
    return read(name_of(*case))[seed]


def read(name):
    return json.loads((FOLDER / name).read_text(encoding="utf-8"))


def test_the_frozen_files_are_those_of_the_list():
    lines = (FOLDER / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    sums = {name: checksum for checksum, name in (line.split("  ") for line in lines)}
    assert sums == {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in FOLDER.glob("*.json")
    }
    others = {f"{name}.json" for name in OTHERS}
    assert sums.keys() == {name_of(*case) for case in (*CASES, *RACED)} | others


@pytest.mark.parametrize("case", CASES, ids=".".join)
def test_a_learner_does_what_it_did(case):
    assert behaviour(*case, 0) == frozen(case, 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS[1:])
@pytest.mark.parametrize("case", CASES, ids=".".join)
def test_a_learner_does_what_it_did_whatever_the_seed(case, seed):
    assert behaviour(*case, seed) == frozen(case, seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS[:2])
@pytest.mark.parametrize("case", RACED, ids=".".join)
def test_racing_does_what_it_did(case, seed):
    assert behaviour(*case, seed) == frozen(case, seed)


@pytest.mark.parametrize("name", OTHERS)
def test_other_methods_and_makers_of_trees_do_what_they_did(name):
    assert other_behaviour(name, 0) == read(f"{name}.json")[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", OTHER_SEEDS[1:])
@pytest.mark.parametrize("name", OTHERS)
def test_other_methods_and_makers_of_trees_do_what_they_did_whatever_the_seed(name, seed):
    assert other_behaviour(name, seed) == read(f"{name}.json")[seed]
