"""``eutree fit`` from the shell: what it says about a tree, and what it cannot play."""

import shutil
from dataclasses import replace

import pytest
from benchmarks.people import folder

from eutree.data import Demonstrations
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec


@pytest.fixture(scope="module")
def stands_still(tmp_path_factory):
    """Return a folder whose tree of release 8 waits for ever."""
    path = tmp_path_factory.mktemp("person") / "demos"
    folder("evasion", 16).save(path)
    return path


def test_the_tree_is_set_beside_the_person(eutree, stands_still):
    line = ["fit", stands_still, "--out", "e.json", "--release-8", "--episodes", 30]
    answer = eutree(*line, "--json")
    assert answer.code == 0
    values = answer.json
    assert values["person"]["success_rate"] == pytest.approx(11 / 15)
    assert values["played"]["success_rate"] < 0.1
    played = values["played"]
    assert played["worst_return"] <= played["return_quantile_05"] <= played["mean_return"]
    low, high = values["played"]["interval"]
    assert low <= values["played"]["success_rate"] <= high < 0.3
    assert values["choice"] == "C4.5 of release 8"
    assert any("hold on to the end in leaf" in text for text in values["warnings"])
    answer = eutree(*line)
    assert "WARNING: The tree is worse than the demonstrations: " in answer.out
    (line,) = [line for line in answer.out.splitlines() if "goes on with learning" in line]
    given = " ".join(map(str, ["fit", stands_still, "--out", "e.json", "--release-8"]))
    assert line == f"eutree {given} --episodes 30 --practise 100 goes on with learning"


def test_settings_of_your_own_are_taken_as_they_are(eutree, stands_still):
    line = ["fit", stands_still, "--out", "e.json", "--episodes", 0, "--json"]
    answer = eutree(*line, "--min-objects", 7, "--confidence", 0.1)
    assert answer.json["choice"] == "C4.5, CF 0.1, m 7"
    answer = eutree(*line, "--no-pruning", "--history", 1)
    assert answer.json["choice"] == "C4.5, without pruning, with one previous observation"
    assert answer.json["played"] is None


def test_an_environment_that_is_not_there_is_said(eutree, stands_still, tmp_path):
    elsewhere = replace(
        Demonstrations.load(stands_still), environment=EnvironmentSpec("Nowhere-v0")
    )
    shutil.rmtree(tmp_path / "d", ignore_errors=True)
    elsewhere.save(tmp_path / "d")
    answer = eutree("fit", "d", "--out", "e.json")
    assert answer.code == 0
    assert "WARNING: The tree was not played: unknown environment 'Nowhere-v0'" in answer.out


def test_a_tree_is_of_the_environment_that_it_was_judged_in(eutree, demonstrations):
    line = ("fit", demonstrations, "--env-arg", "opponent_speed=4.2", "--episodes", 4)
    assert eutree(*line, "--release-8", "--out", "e.json").code == 0
    assert TreePolicy.load("e.json").environment.arguments["opponent_speed"] == 4.2


@pytest.mark.parametrize(("n", "words"), [(1, "one previous observation"), (2, "2 previous obs")])
def test_how_much_a_tree_remembers_is_said(eutree, demonstrations, n, words):
    line = ("fit", demonstrations, "--history", n, "--episodes", 0, "--out", "e.json")
    assert words in eutree(*line).out
