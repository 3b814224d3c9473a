"""Sets of actions are the bits of one number; the last of 64 actions is its sign."""

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.proof import Effort, prove
from eutree.proof.reach import MOST_ACTIONS, first_action
from tests.proof.policies import policy_of
from tests.proof.settling import Settling, SettlingPlant

NAME, LAST = "Dial-v0", MOST_ACTIONS - 1
FEW = Effort(box_steps=5_000, smallest=2.0**-8, refinements=(1,))


class DialPlant(SettlingPlant):
    """A place that settles at a tenth of the number of the action."""

    state = ("place",)
    start = ((-1.0, 1.0),)
    grid = ((-2.0, 2.0, 100),)
    push = 0.01


def dialled() -> Settling:
    return Settling(DialPlant.state, DialPlant.push, MOST_ACTIONS)


@pytest.fixture(autouse=True)
def dial(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, dialled))


def test_the_first_action_of_a_set_is_that_of_a_plain_loop():
    rng = np.random.default_rng(0)
    sets = [1 << bit for bit in range(MOST_ACTIONS)]
    sets += [int(rng.integers(1, 1 << bit)) | 1 << LAST for bit in range(1, MOST_ACTIONS)]
    naive = [next(bit for bit in range(MOST_ACTIONS) if one >> bit & 1) for one in sets]
    assert first_action(np.array(sets, dtype=np.uint64).view(np.int64)).tolist() == naive


@pytest.mark.parametrize("horizon", ["for 50 steps", "for ever"])
@pytest.mark.parametrize("nested", [(0, 0.0, 0, LAST), LAST])
def test_what_the_last_action_breaks_is_not_proven(nested, horizon):
    """The sign of a set was lost: without the last action the place stays where it is allowed."""
    policy = policy_of(nested, NAME)
    found = prove(policy, DialPlant(NAME), f"avoids place > 1.1 {horizon}", effort=FEW)
    assert found.verdict == "refuted"


def test_what_the_last_action_keeps_is_proven():
    policy = policy_of((0, 0.0, LAST, 0), NAME)
    assert prove(policy, DialPlant(NAME), "avoids place < -1.2 for ever", effort=FEW).proven


def test_the_last_action_is_followed_along_axes():
    """The search of a start that breaks the property took it for another action."""
    plant = DialPlant(NAME)
    plant.axes, plant.cells = ((1.0,),), (0.01,)
    policy = policy_of((0, 0.0, 0, LAST), NAME)
    found = prove(policy, plant, "avoids place > 1.1 for 50 steps", effort=FEW)
    assert found.verdict == "refuted"
    assert prove(policy, plant, "avoids place > 6.4 for 50 steps", effort=FEW).proven
