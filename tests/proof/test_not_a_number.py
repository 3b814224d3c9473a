"""Infinity less infinity is no number: no bound may stand for it, and no tree is sure of it."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.proof import Effort, Intervals, Plant, clip, prove
from eutree.proof.intervals import Affine, Doubt
from eutree.proof.reach import Acting
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

NAME, DERIVED = "Pair-v0", 2
BEYOND = "1e308 * 1000"  # infinite, unless of 0
FORMULAS = [
    f"(x * {BEYOND}) / (y * {BEYOND})",
    f"min(x * {BEYOND} - y * {BEYOND}, 5)",
    f"max(x * {BEYOND} - y * {BEYOND}, -5)",
    f"abs(min(x * {BEYOND} * y, 5))",
    f"min(x * {BEYOND} * (y - 0.5), 5) / 2",
    f"x if x * {BEYOND} - y * {BEYOND} < 1 else y",
]


class Pair(gymnasium.Env[Any, Any]):
    """Two numbers that settle where the action says."""

    metadata: ClassVar = {"render_modes": []}
    feature_names = ("x", "y")
    action_space = gymnasium.spaces.Discrete(2)
    observation_space = gymnasium.spaces.Box(-100.0, 100.0, (2,), np.float64)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = self.np_random.uniform(-1.0, 1.0, 2)
        return self.state.copy(), {}

    def step(self, action: int) -> Any:
        self.state = 0.9 * self.state + 0.5 * action
        return self.state.copy(), 0.0, False, False, {}


class PairPlant(Plant):
    """The pair on intervals."""

    state = ("x", "y")
    start = ((-1.0, 1.0),) * 2
    grid = ((-8.0, 8.0, 32),) * 2

    def __init__(self) -> None:
        self.environment = EnvironmentSpec(NAME)

    def step(self, state: Any, action: Any) -> Any:
        return [0.9 * one + 0.5 * action for one in state]


@pytest.fixture(autouse=True)
def pair(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, Pair, max_episode_steps=50))


@pytest.mark.parametrize("formula", FORMULAS)
@pytest.mark.parametrize("as_affine", [False, True])
def test_boxes_hold_the_action_of_what_is_no_number(formula, as_affine):
    """Of NaN every test says no: states are drawn in boxes that hold 0, or whose ends are equal."""
    rng, n, inside = np.random.default_rng(0), 200, 50
    center = rng.choice([0.0, 0.5, -0.5, 0.1], (2, n))
    width = 10.0 ** rng.uniform(-6, 0, (2, n))
    states = center + rng.choice([-1.0, 0.0, 0.3, 1.0], (inside, 2, n)) * width
    boxes = [Intervals(*ends) for ends in zip(center - width, center + width, strict=True)]
    if as_affine:
        doubt, slopes = Doubt(np.zeros(n, dtype=np.int64), np.full(n, -1)), np.zeros((2, 2, n))
        slopes[[0, 1], [0, 1]] = width
        boxes = [Affine(center[j], slopes[j], np.zeros(n), doubt) for j in range(2)]
    for threshold in (2e9, 5.0, 0.5):
        policy = policy_of((DERIVED, threshold, 0, 1), NAME, derived=(f"d = {formula}",))
        possible = Acting(policy, PairPlant())(boxes)
        actions = policy.predict(states.transpose(0, 2, 1).reshape(-1, 2))[0].reshape(inside, n)
        assert ((possible >> actions) & 1).all()


@pytest.mark.parametrize("formula", FORMULAS[:4])
@pytest.mark.parametrize("horizon", ["for ever", "for 30 steps"])
def test_what_a_number_that_is_none_breaks_is_not_proven(formula, horizon):
    policy = policy_of((DERIVED, 2e9, 0, 1), NAME, derived=(f"d = {formula}",))
    effort = Effort(box_steps=2_000, refinements=(1,))
    assert not prove(policy, PairPlant(), f"avoids x > 1.01 {horizon}", effort=effort).proven


def test_operations_on_bounds_without_end_know_nothing_of_what_may_be_no_number():
    """What is cut off afterwards was taken for a number."""
    endless, above = Intervals.between([-np.inf], [np.inf]), Intervals.between([1.0], [np.inf])
    nothing, around = Intervals.between([np.nan], [np.nan]), Intervals.between([-1.0], [1.0])
    for one in (
        endless + endless, above - above, around * above, above * around, above / endless,
        nothing / around, around / nothing, nothing.cos(), nothing.sin(), nothing.square(),
    ):  # fmt: skip
        cut = clip(one, -1.0, 1.0)
        assert np.isnan([cut.low, cut.high]).all()
    for one in (above + above, above * above, around / around, around + endless):
        cut = clip(one, -1.0, 1.0)
        assert not np.isnan([cut.low, cut.high]).any()
