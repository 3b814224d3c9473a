"""Sets of actions are the bits of one number; the last of 64 actions is its sign."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.proof import Effort, Plant, prove
from eutree.proof.reach import MOST_ACTIONS, first_action
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

NAME, LAST = "Dial-v0", MOST_ACTIONS - 1
FEW = Effort(box_steps=5_000, smallest=2.0**-8, refinements=(1,))


class Dial(gymnasium.Env[Any, Any]):
    """A place that settles at a tenth of the number of the action."""

    metadata: ClassVar = {"render_modes": []}
    action_space = gymnasium.spaces.Discrete(MOST_ACTIONS)
    observation_space = gymnasium.spaces.Box(-100.0, 100.0, (1,), np.float64)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = self.np_random.uniform(-1.0, 1.0, 1)
        return self.state.copy(), {}

    def step(self, action: int) -> Any:
        self.state = 0.9 * self.state + 0.01 * action
        return self.state.copy(), 0.0, False, False, {}


class DialPlant(Plant):
    """The dial on intervals."""

    state = ("place",)
    start = ((-1.0, 1.0),)
    grid = ((-2.0, 2.0, 100),)

    def __init__(self) -> None:
        self.environment = EnvironmentSpec(NAME)

    def step(self, state: Any, action: Any) -> Any:
        return [0.9 * state[0] + 0.01 * action]


@pytest.fixture(autouse=True)
def dial(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, Dial))


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
    found = prove(policy, DialPlant(), f"avoids place > 1.1 {horizon}", effort=FEW)
    assert found.verdict == "refuted"


def test_what_the_last_action_keeps_is_proven():
    policy = policy_of((0, 0.0, LAST, 0), NAME)
    assert prove(policy, DialPlant(), "avoids place < -1.2 for ever", effort=FEW).proven


def test_the_last_action_is_followed_along_axes():
    """The search of a start that breaks the property took it for another action."""
    plant = DialPlant()
    plant.axes, plant.cells = ((1.0,),), (0.01,)
    policy = policy_of((0, 0.0, 0, LAST), NAME)
    found = prove(policy, plant, "avoids place > 1.1 for 50 steps", effort=FEW)
    assert found.verdict == "refuted"
    assert prove(policy, plant, "avoids place > 6.4 for 50 steps", effort=FEW).proven
