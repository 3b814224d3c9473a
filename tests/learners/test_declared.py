"""A learner is saved and restored by the declaration of its parts, whatever its attributes are."""

from dataclasses import dataclass
from enum import IntEnum
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from eutree.errors import FormatError
from eutree.learners import Part, Stored
from eutree.learners.declared import Declared, action_tree_part, arrays_of, give_back, taken
from eutree.world_model.action_trees import packed


class Stage(IntEnum):
    FIRST = 0
    SECOND = 1


@dataclass(frozen=True)
class Plan:
    episodes: tuple[int, ...] = ()
    tree: object = None


class Tiles(NamedTuple):
    means: np.ndarray


def at_its_start():
    return SimpleNamespace(
        values=np.zeros(2), stage=Stage.FIRST, steps=0, known=False, locked=frozenset({7}),
        plan=Plan(), controller=SimpleNamespace(tiles=Tiles(np.zeros(1))),
    )  # fmt: skip


def lived():
    learner = at_its_start()
    learner.values, learner.stage, learner.steps = np.array([0.1, 0.2, 0.3]), Stage.SECOND, 5
    learner.known, learner.locked = True, frozenset({3, 1, 2})
    learner.plan = Plan((4, 2), packed(1))
    learner.controller.tiles = Tiles(np.ones(2))
    return learner


PARTS = (
    Part(
        {
            "values": Stored("f8", "V", at="values"),
            "numbers": Stored("i8", "2", at="stage steps"),
            "known": Stored("b1", "1", at="known"),
            "means": Stored("f8", "W", at="controller.tiles.means"),
            "episodes": Stored("i8", "E", at="plan.episodes"),
        }
    ),
    Part({"locked": Stored("i8", "K", at="locked")}, optional=True),
    Part({"checked": Stored("i8", "C")}, optional=True),  # by the learner's own state() alone
    action_tree_part("plan_", "plan.tree", optional=True),
)


def test_attributes_become_arrays_of_the_declared_elements():
    state = arrays_of(lived(), PARTS)
    tree = {name: state.pop(f"plan_{name}").tolist() for name in packed(1)._fields}
    assert tree == {name: part.tolist() for name, part in packed(1)._asdict().items()}
    assert {name: array.tolist() for name, array in state.items()} == {
        "values": [0.1, 0.2, 0.3], "numbers": [1, 5], "known": [True], "means": [1.0, 1.0],
        "episodes": [4, 2], "locked": [1, 2, 3],
    }  # fmt: skip
    assert {state[name].dtype.str[1:] for name in ("numbers", "episodes", "locked")} == {"i8"}
    assert taken("file", state, Declared(1, 2, PARTS[:3])).keys() == state.keys()


def test_all_of_them_come_back_in_the_types_they_had():
    state = arrays_of(lived(), PARTS)
    learner = give_back(at_its_start(), PARTS, state)
    assert (learner.stage, learner.steps, learner.known) == (Stage.SECOND, 5, True)
    assert [type(one) for one in (learner.stage, learner.steps, learner.known)] == [
        Stage, int, bool
    ]  # fmt: skip
    assert learner.locked == frozenset({1, 2, 3})
    assert learner.plan.episodes == (4, 2)
    assert learner.plan.tree.action.tolist() == packed(1).action.tolist()
    assert isinstance(learner.controller.tiles, Tiles)
    again = arrays_of(learner, PARTS)
    assert {k: a.tobytes() for k, a in again.items()} == {k: a.tobytes() for k, a in state.items()}


def test_what_a_learner_has_not_is_not_stored_and_not_there_afterwards():
    learner = lived()
    learner.locked, learner.plan = frozenset(), Plan()
    state = arrays_of(learner, PARTS)
    assert not [name for name in state if name.startswith(("plan_", "locked", "checked"))]
    assert state["episodes"].size == 0
    again = give_back(at_its_start(), PARTS, state)  # which had a locked leaf
    assert again.locked == frozenset()
    assert again.plan == Plan()


def test_a_learner_does_not_share_its_arrays_with_the_state_it_was_given():
    state = arrays_of(lived(), PARTS)
    learner = give_back(at_its_start(), PARTS, state)
    learner.values[:] = 9.0
    assert state["values"].tolist() == [0.1, 0.2, 0.3]


def test_an_object_is_made_from_the_parts_before_it():
    def made(learner, state):
        return {"steps": learner.steps, "names": sorted(state)}

    steps = Part({"steps": Stored("i8", "1", at="steps")})
    own = {"own_a": Stored("i8", "1"), "own_b": Stored("i8", "1")}
    saved = Part(own, at="known", prefix="own_", save=lambda n: {"a": n, "b": n}, make=made)
    state = {"steps": np.array([8]), "own_a": np.array([1]), "own_b": np.array([2])}
    after = give_back(at_its_start(), (steps, saved), state)
    before = give_back(at_its_start(), (saved, steps), state)
    assert after.known == {"steps": 8, "names": ["a", "b"]}
    assert before.known == {"steps": 0, "names": ["a", "b"]}
    assert arrays_of(after, (saved,)).keys() == own.keys()


def test_sizes_may_be_given_beforehand():
    parts = (Part({"weights": Stored("f8", ("size",))}),)
    state = {"weights": np.zeros(3)}
    assert taken("file", state, Declared(1, 1, parts)).keys() == state.keys()
    assert taken("file", state, Declared(1, 1, parts, {"size": 3})).keys() == state.keys()
    with pytest.raises(FormatError, match=r"must be of float64 and of shape \[size = 4\]"):
        taken("file", state, Declared(1, 1, parts, {"size": 4}))
