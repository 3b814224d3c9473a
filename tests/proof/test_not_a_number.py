"""Infinity less infinity is no number: no bound may stand for it, and no tree is sure of it."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.proof import Effort, Intervals, clip, prove
from eutree.proof.intervals import Affine, Doubt, cos, quotient, where
from eutree.proof.reach import Acting
from tests.proof.policies import policy_of
from tests.proof.settling import Settling, SettlingPlant

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


class PairPlant(SettlingPlant):
    """Two numbers that settle at five times the action."""

    state = ("x", "y")
    start = ((-1.0, 1.0),) * 2
    grid = ((-8.0, 8.0, 32),) * 2
    push = 0.5


def paired() -> Settling:
    return Settling(PairPlant.state, PairPlant.push, 2)


@pytest.fixture(autouse=True)
def pair(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, paired, max_episode_steps=50))


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
        possible = Acting(policy, PairPlant(NAME))(boxes)
        actions = policy.predict(states.transpose(0, 2, 1).reshape(-1, 2))[0].reshape(inside, n)
        assert ((possible >> actions) & 1).all()


@pytest.mark.parametrize("formula", FORMULAS[:4])
@pytest.mark.parametrize("horizon", ["for ever", "for 30 steps"])
def test_what_a_number_that_is_none_breaks_is_not_proven(formula, horizon):
    policy = policy_of((DERIVED, 2e9, 0, 1), NAME, derived=(f"d = {formula}",))
    effort = Effort(box_steps=2_000, refinements=(1,))
    assert not prove(policy, PairPlant(NAME), f"avoids x > 1.01 {horizon}", effort=effort).proven


def test_operations_on_bounds_without_end_know_nothing_of_what_may_be_no_number():
    """What is cut off afterwards was taken for a number."""
    endless, above = Intervals.between([-np.inf], [np.inf]), Intervals.between([1.0], [np.inf])
    nothing, around = Intervals.between([np.nan], [np.nan]), Intervals.between([-1.0], [1.0])
    for one in (
        endless + endless, above - above, around * above, above * around, above / endless,
        nothing / around, around / nothing, nothing.cos(), nothing.sin(), nothing.square(),
        around / around, endless.cos(), above.sin(), -above / endless,
    ):  # fmt: skip
        cut = clip(one, -1.0, 1.0)
        assert np.isnan([cut.low, cut.high]).all()
    for one in (above + above, above * above, above / around, quotient(around, around)):
        cut = clip(one, -1.0, 1.0)
        assert not np.isnan([cut.low, cut.high]).any()


@pytest.mark.parametrize("strange", [lambda x: cos(x * 1e308 * 1e10), lambda x: clip(x / x, -1, 1)])
def test_a_step_that_may_compute_no_number_proves_nothing(strange):
    """NaN is not at most 2, so its step leads to 9."""

    class Strange(PairPlant):
        grid = (*PairPlant.grid[:1], (-10.0, 10.0, 41))

        def step(self, state: Any, action: Any) -> Any:
            return [state[0], where(strange(state[0]) <= 2.0, 0.0, 9.0)]

    policy = policy_of((0, 0.5, 0, 1), NAME)
    effort = Effort(box_steps=2_000, refinements=iter((1,)))
    for horizon in ("for ever", "for 30 steps"):
        assert not prove(policy, Strange(NAME), f"avoids y > 5 {horizon}", effort=effort).proven


def test_a_number_of_the_state_may_be_set_anew():
    class Anew(PairPlant):
        start = ((-1.0, 1.0), (0.0, 0.1))

        def step(self, state: Any, action: Any) -> Any:
            return [where(state[0] <= 0.0, 0.0, 0.5), where(state[1] > 9.0, 0.5, 0.25)]

    policy = policy_of((0, 0.7, 0, 1), NAME)
    assert prove(policy, Anew(NAME), "avoids x > 1.01 for 30 steps").proven
    assert not prove(policy, Anew(NAME), "avoids y > 0.2 for 30 steps").proven
