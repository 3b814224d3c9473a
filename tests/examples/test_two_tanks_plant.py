"""Two tanks for ever: real trajectories in the boxes, boxes against long arithmetic, verdicts."""

import mpmath
import numpy as np
import pytest
from examples.two_tanks_plant import DEMAND, LAG, PUMP, TARGET, VALVE, Flood, rerun
from examples.two_tanks_plant import _kernels as kernels

from eutree.errors import InvalidArgumentError
from eutree.proof import BeginningThere, check_plant, plant_of, prove
from eutree.proof.certificate import EMPTY, FAILS, OPEN
from eutree.schema import EnvironmentSpec
from examples import two_tanks
from tests.proof.policies import policy_of

UPPER, LOWER, DEVIATION = 0, 1, 7
OFF, DOWN, FILL, BOTH = range(4)
SPEC = EnvironmentSpec("TwoTanks-v0")
PLANT = plant_of(SPEC)
SAFE = (LOWER, 0.8, (UPPER, 0.9, BOTH, DOWN), OFF)
"""Fills a tank that is not full, and lets water down below 0.8 m only."""
LIMITS = np.nextafter([2.0, 2.0], 0.0)


@pytest.fixture(scope="module")
def flood():
    return Flood(policy_of(SAFE, "TwoTanks-v0"), LIMITS)


def scripts(seed, steps):
    """Return set points and demands that stay for a while, most of them at an end."""
    draw = np.random.default_rng(seed)
    columns = []
    for low, high in (TARGET, DEMAND):
        values = np.where(draw.random(steps) < 0.7, low, draw.uniform(low, high, steps))
        values = np.where(draw.random(steps) < 0.3, high, values)
        columns.append(values[np.maximum.accumulate(np.where(draw.random(steps) < 0.2,
                                                              np.arange(steps), 0))])  # fmt: skip
    return np.stack(columns, axis=1)


def outside(flood, episodes, steps=60):
    """Count the states of real runs that are in no box."""
    wrong = 0
    for seed in range(episodes):
        start = np.random.default_rng(seed).uniform([0.6, 0.4, 0.6], [1.4, 1.2, 1.4])
        run = rerun(PLANT, policy_of(SAFE, "TwoTanks-v0"), start, scripts(seed, steps))
        wrong += sum(not flood.holds(state, action) for state, action in run)
    return wrong


def test_a_careful_tree_never_runs_over(flood, monkeypatch):
    monkeypatch.setattr("examples.two_tanks_plant.Flood", lambda *arguments: flood)
    assert flood.is_closed
    assert flood.work["box_steps"] > 1000
    found = prove(policy_of(SAFE, "TwoTanks-v0"), PLANT)
    assert found.proven
    assert found.sentence.endswith("for ever")
    assert found.starts is None
    (picture,) = found.pictures
    reached = picture.marks != EMPTY
    assert 0.1 < reached.mean() < 0.9
    for seed in range(20):
        start = np.random.default_rng(seed).uniform([0.6, 0.4, 0.6], [1.4, 1.2, 1.4])
        run = rerun(PLANT, policy_of(SAFE, "TwoTanks-v0"), start, scripts(seed, 60))
        for state, _ in run:
            cell = np.minimum(state[:2] / 2.0 * np.array(reached.shape), 63).astype(int)
            assert reached[tuple(cell)]


def test_real_runs_stay_in_the_boxes(flood):
    assert outside(flood, 40) == 0


def test_boxes_for_too_few_set_points_are_caught(flood, monkeypatch):
    monkeypatch.setattr("examples.two_tanks_plant.TARGET", (0.9, 1.1))
    assert outside(Flood(policy_of(SAFE, "TwoTanks-v0"), LIMITS), 3) > 0


def random_box(draw):
    """Return a box of numbers that agree, and a state of it."""
    state = draw.uniform([0.2, 0.2, 0, 0, -0.4], [1.8, 1.8, 1, 1, 0.4])
    width = 10.0 ** draw.uniform(-9, -1.3)
    low = np.maximum(state - width * draw.random(5), [0, 0, 0, 0, -2])
    high = np.minimum(state + width * draw.random(5), [2, 2, 1, 1, 2])
    return state, low, high


def box_of(low, high):
    """Return the bounds of all numbers of a box of states."""
    run, credit, still = kernels.RUN_DOWN, kernels.CREDIT, kernels.STILL_LET
    ends = []
    for (a, b, p, v, e), valve, other in ((low, high[3], high[4]), (high, low[3], low[4])):
        mass = a + b + run * p
        ends.append([a + run * p - credit * valve, b - other, e, p, v, b, mass,
                     *[(1 - q) * (b + still * v) + q * mass for q in kernels.SHARES]])  # fmt: skip
    slack = 1e-12
    return np.stack([np.array(ends[0]) - slack, np.array(ends[1]) + slack], axis=1).ravel()


def exact_step(state, on, opened, demand, target):
    """Return a state one step later, and both rates, with 40 digits."""
    upper, lower, pump, valve, deviation = map(mpmath.mpf, state.tolist())
    lag, step = mpmath.mpf(LAG), mpmath.mpf(5)
    pump, valve = pump + lag * (on - pump), valve + lag * (opened - valve)
    between = mpmath.mpf(VALVE) * valve * mpmath.sqrt(upper)
    taken = min(mpmath.mpf(demand), lower / step)
    later = [upper + step * (mpmath.mpf(PUMP) * pump - between), lower + step * (between - taken)]
    rates = [1000 * (new - old) / step for new, old in zip(later, (upper, lower), strict=True)]
    deviation += mpmath.mpf(0.1) * (later[1] - target - deviation)
    return [*later, pump, valve, deviation], rates


def test_moved_boxes_hold_what_long_arithmetic_gives():
    draw = np.random.default_rng(1)
    with mpmath.workdps(40):
        for _ in range(1500):
            state, low, high = random_box(draw)
            action, demand, target = draw.integers(4), draw.uniform(*DEMAND), draw.uniform(*TARGET)
            on, opened = divmod(int(action), 2)
            levels = np.array([low[0], high[0], low[1], high[1], 9.0, 9.0])
            box, out, seen = box_of(low, high), np.empty(2 * kernels.N_NUMBERS), np.empty(16)
            seen[8:10] = target, target
            flow = kernels.Flow(box, levels, np.empty(2), on, opened)
            kernels.move(flow, out, seen)
            later, rates = exact_step(state, on, opened, demand, target)
            upper, lower, pump, valve, deviation = later
            if not 0 < upper < 2 or not 0 < lower < 2:
                continue
            at = [upper, lower, pump, valve, target, *rates, deviation]
            # What the leaf asks for narrows: here, that the features are near to what they are.
            near = seen.copy()
            near[10:14] = [float(rates[0]) - 0.1, float(rates[0]) + 0.1,
                           float(rates[1]) - 0.1, float(rates[1]) + 0.1]  # fmt: skip
            near[10:14:2] = np.maximum(near[10:14:2], seen[10:14:2])
            near[11:14:2] = np.minimum(near[11:14:2], seen[11:14:2])
            for features in (seen, near):
                numbers = out.copy()
                assert kernels.narrow(flow, numbers, features, bool(seen[0] <= 0))
                assert kernels.agree(numbers, features)
                for value, a, b in zip(at, features[::2], features[1::2], strict=True):
                    assert a <= value <= b
                mass = upper + lower + kernels.RUN_DOWN * pump
                weighed = [(1 - q) * (lower + kernels.STILL_LET * valve) + q * mass
                           for q in kernels.SHARES]  # fmt: skip
                stored = upper + kernels.RUN_DOWN * pump - kernels.CREDIT * valve
                values = [stored, lower - deviation, deviation, pump, valve, lower, mass, *weighed]
                for value, a, b in zip(values, numbers[::2], numbers[1::2], strict=True):
                    assert a <= value <= b


def test_a_pump_that_stays_on_is_refuted_by_a_real_run():
    policy = policy_of((UPPER, 9.0, FILL, OFF), "TwoTanks-v0")
    found = prove(policy, PLANT)
    assert found.verdict == "refuted"
    run = found.counterexample
    start = np.array([run["upper_level"], run["lower_level"], run["set_point"]])
    script = np.stack([run["set_points"], run["demands"]], axis=1)
    states = [state for state, _ in rerun(PLANT, policy, start, script)]
    assert len(states) == run["steps"] + 1
    assert max(state[0] for state in states[:-1]) < 2.0 <= states[-1][0]


def test_the_plant_is_true_and_the_same_constants():
    check_plant(PLANT, episodes=5, generator=np.random.default_rng(0))
    assert (two_tanks.PUMP, two_tanks.VALVE, two_tanks.LAG) == (PUMP, VALVE, LAG)
    assert (two_tanks.STEP, two_tanks.HEIGHT) == (kernels.STEP, kernels.HEIGHT)
    assert two_tanks.DEMAND == DEMAND
    assert np.allclose(two_tanks.DEMAND, np.array(kernels.DEMAND) / kernels.STEP, rtol=1e-15)


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ("stays in 0.1 < lower_level for ever", "how high upper_level and lower_level"),
        ("stays in valve < 0.5 for ever", "how high upper_level and lower_level"),
        ("stays in upper_level < 1.3 for ever", "must allow the levels at which episodes begin"),
    ],
)
def test_other_conditions_are_refused(question, message):
    with pytest.raises(InvalidArgumentError, match=message):
        prove(policy_of(SAFE, "TwoTanks-v0"), PLANT, question)


def test_the_run_that_breaks_it_is_drawn_and_is_where_episodes_begin():
    policy = policy_of((LOWER, 1.2, FILL, OFF), "TwoTanks-v0")
    found = prove(policy, PLANT)
    assert found.verdict == "refuted"
    assert "states" not in found.counterexample
    assert len(found.starts.low) == found.counterexample["steps"] + 1
    assert (found.pictures[0].marks == FAILS).sum() > 5
    env = BeginningThere(PLANT.make(), [found])
    for seed in range(5):
        env.reset(seed=seed)
        state = PLANT.state_of(env)
        assert np.abs(found.starts.low - state).sum(axis=1).min() == 0


def test_the_box_that_is_open_is_drawn(monkeypatch):
    monkeypatch.setattr("examples.two_tanks_plant._played", lambda *_: None)
    found = prove(policy_of((LOWER, 1.2, FILL, OFF), "TwoTanks-v0"), PLANT)
    assert found.verdict == "undecided"
    assert (found.pictures[0].marks == OPEN).any()
    assert (found.starts.low <= found.starts.high).all()
