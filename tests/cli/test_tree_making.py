"""The button *Make my tree*: what it fits, plays and practises, without a page."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli import _tree_making
from eutree.cli._tree_making import PageTree, Result, result_of_person
from eutree.schema import EnvironmentSpec
from tests.interaction.people import Corridor

EVASION = EnvironmentSpec("eutree/Evasion2-v0")


def made(folder, *, episodes, make=lambda: gymnasium.make("eutree/Evasion2-v0"), spec=EVASION):
    views = []
    maker = PageTree(folder, spec, make)
    maker.make(views.append, lambda: False)
    return maker, views


@pytest.fixture
def folder(tmp_path):
    env = gymnasium.make("eutree/Evasion2-v0")
    demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=3, seed=5)
    demos.save(tmp_path / "demos")
    return tmp_path / "demos"


def test_a_tree_is_fitted_and_plays_and_its_verdict_is_true(folder) -> None:
    _, views = made(folder, episodes=3)
    phases = [view.phase for view in views]
    assert phases[0] == "fitting"
    assert phases[-1] == "ready"
    played = [view.finished for view in views if view.phase == "playing"]
    assert played == [0, 20, 40, 60, 80]
    tree = eutree.TreePolicy.load(folder.with_name("demos-tree.json"))
    blocks = [eutree.evaluate(tree, "eutree/Evasion2-v0", episodes=20, seed=k) for k in range(5)]
    wins = sum(int(block.successes.sum()) for block in blocks)
    assert views[-1].message == f"you 3 of 3; this tree {wins} of 100"
    assert views[-1].worse == (wins < 97)
    assert views[-1].may_gain == (wins < 97)
    assert views[-1].n_leaves == tree.n_leaves
    assert views[-1].rules == str(tree)
    assert views[-1].svg.startswith("<svg")
    assert views[-1].commands[0] == f"eutree show {folder}-tree.json"


def test_practice_keeps_the_better_tree_and_shows_its_curve(folder, monkeypatch) -> None:
    monkeypatch.setattr(_tree_making, "PRACTICE", 20)
    maker, views = made(folder, episodes=3)
    fitted = int(views[-1].message.split()[-3])
    maker.practise(views.append, lambda: False)
    last = views[-1]
    assert [episode for episode, _ in last.curve] == [10, 20]
    assert last.yours == 1.0
    assert int(last.message.split()[-3]) >= fitted
    practised = folder.with_name("demos-practised.json")
    assert practised.exists() == (str(practised) in last.commands[0])


def test_practice_is_offered_to_a_tree_that_is_as_good_as_a_poor_person(folder) -> None:
    demos = eutree.Demonstrations.load(folder)
    lost = [replace(e, is_success=False, ending="collision") for e in demos.episodes[:2]]
    poor = folder.with_name("poor")
    replace(demos, episodes=(*lost, demos.episodes[2])).save(poor)
    _, views = made(poor, episodes=3)
    last = views[-1]
    assert last.message.startswith("you 1 of 3;")
    assert not last.worse
    wins = int(last.message.split()[-3])
    assert 40 < wins < 97  # what three episodes make of it: no longer a matter of the person
    assert last.may_gain
    assert "practice may make it better still" in last.note


def test_whoever_leaves_stops_it(folder) -> None:
    maker, views = made(folder, episodes=3)
    count = len(views)
    maker.practise(views.append, lambda: True)
    assert views[-1].phase == "practising"
    assert len(views) - count <= 2


def test_without_successes_returns_are_compared(tmp_path) -> None:
    class Plain(Corridor):
        def step(self, action):
            *rest, _ = super().step(action)
            return (*rest, {})

    class Right:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return 2, state

    eutree.record(Plain(), Right(), episodes=3).save(tmp_path / "demos")
    _, views = made(tmp_path / "demos", episodes=3, make=Plain, spec=EnvironmentSpec("Plain-v0"))
    assert views[-1].message == "you 1.0 on average; this tree 1.0 on average"
    assert not views[-1].worse
    assert "single leaf: it always answers right" in views[-1].note


@pytest.mark.parametrize(
    ("tree", "person", "short"), [(96, 13 / 15, False), (97, 1.0, False), (96, 1.0, True)]
)
def test_what_falls_short(tree, person, short) -> None:
    played, own = Result(100, tree, 0.0, 0.1), Result(15, round(15 * person), 0.0, 0.1)
    assert played.falls_short_of(own) == short


def test_an_episode_that_was_ended_early_is_no_success(folder) -> None:
    demos = eutree.Demonstrations.load(folder)
    first = replace(demos.episodes[0], is_success=None, terminated=False, ending="stopped")
    stopped = replace(demos, episodes=(first, *demos.episodes[1:]))
    assert str(result_of_person(stopped)) == "2 of 3"
    assert np.isclose(result_of_person(stopped).value, 2 / 3)
