"""Cells along axes that are too many, or as few however fine: what is open then is said to be."""

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.proof import Effort, prove
from eutree.proof.layers import Layers
from tests.proof.policies import policy_of
from tests.proof.settling import Settling, SettlingPlant

NAME = "Fine-v0"
SWITCH = (0, 0.2, 1, 0)


class FinePlant(SettlingPlant):
    """Two numbers that settle, along axes of their own."""

    state = ("one", "other")
    start = ((-1.0, 1.0), (-1.0, 1.0))
    axes = ((1.0, 0.0), (0.0, 1.0))
    cells = (0.1, 0.1)
    push = 0.1


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    maker = lambda: Settling(FinePlant.state, FinePlant.push, 2)  # noqa: E731
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, maker))


def plant_of(**declared):
    return type("Own", (FinePlant,), declared)(NAME)


def largest(tree, steps):
    """Return how far from 0 numbers are that begin between -1 and 1, in NumPy."""
    one = other = np.linspace(-1.0, 1.0, 101)
    found = 0.0
    for _ in range(steps):
        action = np.full(101, tree) if isinstance(tree, int) else np.where(one <= 0.2, 1, 0)
        one, other = 0.9 * one + 0.1 * action, 0.9 * other + 0.1 * action
        found = max(found, np.abs(one).max(), np.abs(other).max())
    return found


@pytest.mark.parametrize("plant", [{}, {"cells": (1e9, 1e9)}, {"cells": (1e-300, 1e-300)}])
def test_a_tree_without_tests_is_followed_in_one_box_however_fine_the_cells(plant):
    """Cells were halved until their number was none that a double knows, an internal error."""
    policy, asked = policy_of(1, NAME), "stays in one <= {} for 60 steps"
    assert largest(1, 60) == 1.0
    assert prove(policy, plant_of(**plant), asked.format(1.000001)).proven
    found = prove(policy, plant_of(**plant), asked.format(1))  # but for rounding
    assert (found.verdict, found.work["refined"]) == ("undecided", 1)


@pytest.mark.parametrize("width", [1e-8, 1e-12, 1e-17, 1e-30, 5e-324])
def test_more_cells_than_there_may_be_are_undecided(width):
    """The boxes were asked for before there were any."""
    plant, policy = plant_of(cells=(width, width)), policy_of(SWITCH, NAME)
    asked = f"stays in one <= {largest(SWITCH, 5) + 0.2} for 5 steps"
    found = prove(policy, plant, asked)
    assert found.verdict == "undecided"
    assert found.work["refined"] == 1
    assert Layers(policy, plant).low.tolist() == pytest.approx(np.array([[-1.0, -1.0]]))
    assert prove(policy, plant_of(), asked).proven


def test_a_number_that_stays_nought_is_in_one_cell_however_fine():
    plant, policy = plant_of(start=((0.0, 0.0), (-1.0, 1.0))), policy_of((0, 0.2, 0, 1), NAME)
    found = prove(policy, plant, "stays in one <= 0 for 2 steps", effort=Effort(box_steps=10**9))
    assert found.verdict == "undecided"
