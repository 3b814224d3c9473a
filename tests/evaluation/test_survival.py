import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from eutree.errors import InvalidArgumentError
from eutree.evaluation import (
    Durations,
    kaplan_meier,
    restricted_mean,
    restricted_mean_ratio,
    trials_to_threshold,
)

RUNS = st.lists(st.tuples(st.integers(0, 6), st.booleans()), min_size=1, max_size=15)


def durations_of(runs):
    times, reached = zip(*runs, strict=True)
    return Durations(np.array(times, float), np.array(reached))


def censored(durations):
    times, reached = durations.times, durations.reached
    return stats.CensoredData(uncensored=times[reached], right=times[~reached])


@settings(deadline=None)
@given(RUNS)
def test_kaplan_meier_equals_scipy(runs):
    durations = durations_of(runs)
    if not durations.reached.any():
        assert kaplan_meier(durations).median == math.inf
        return
    ours = kaplan_meier(durations)
    theirs = stats.ecdf(censored(durations)).sf
    np.testing.assert_allclose(ours.shares, theirs.evaluate(ours.times), atol=1e-12)


def test_kaplan_meier_of_the_textbook():
    """Remission of leukemia under 6-MP (Freireich et al. 1963): the classical example."""
    times = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
    reached = [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
    curve = kaplan_meier(Durations(times, reached))
    assert curve.times.tolist() == [6, 7, 10, 13, 16, 22, 23]
    expected = [0.8571, 0.8067, 0.7529, 0.6902, 0.6275, 0.5378, 0.4482]
    np.testing.assert_allclose(curve.shares, expected, atol=5e-5)
    assert curve.median == 23.0
    placebo = [1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23]
    assert kaplan_meier(Durations(placebo, [1] * 21)).median == 8.0


def test_the_restricted_mean_without_censoring_is_a_mean():
    times = np.array([2.0, 5.0, 5.0, 9.0, 30.0])
    durations = Durations(times, np.ones(5))
    for horizon in (4.0, 5.0, 20.0, 100.0):
        expected = np.minimum(times, horizon).mean()
        assert kaplan_meier(durations).restricted_mean(horizon) == pytest.approx(expected)
    estimate = restricted_mean(durations, 20.0)
    low, high = estimate.interval
    assert low < estimate.value < high
    assert estimate.n == 5


def test_runs_that_never_got_there_count_in_full():
    """Left out, they would make the learner look fast: 20 instead of 65 trials."""
    durations = Durations([20.0, 20.0, 200.0, 200.0], [True, True, False, False])
    assert kaplan_meier(durations).median == 20.0
    assert kaplan_meier(durations).restricted_mean(200.0) == pytest.approx(110.0)
    most = Durations([20.0, 200.0, 200.0, 200.0], [True, False, False, False])
    assert kaplan_meier(most).median == math.inf


def test_half_the_time_is_a_ratio_of_a_half():
    generator = np.random.default_rng(0)
    slow = generator.integers(5, 40, 15) * 20.0
    first = Durations(slow / 2, np.ones(15))
    second = Durations(slow, np.ones(15))
    paired = restricted_mean_ratio(first, second, 1000.0)
    np.testing.assert_allclose([paired.value, *paired.interval], 0.5)
    unpaired = restricted_mean_ratio(first, second, 1000.0, paired=False)
    low, high = unpaired.interval
    assert low < 0.45 < 0.55 < high
    nothing = Durations(np.zeros(15), np.ones(15))
    assert restricted_mean_ratio(nothing, nothing, 10.0).value == 1.0
    assert restricted_mean_ratio(first, nothing, 10.0).value == math.inf


def test_the_first_of_lasting_points_is_the_time():
    episodes = [0, 20, 40, 60]
    curves = [[0.0, 0.9, 0.2, 0.9], [0.0, 0.1, 0.95, 0.9], [0.0, 0.1, 0.2, 0.3]]
    once = trials_to_threshold(episodes, curves, 0.9)
    assert once.times.tolist() == [20.0, 40.0, 60.0]
    assert once.reached.tolist() == [True, True, False]
    twice = trials_to_threshold(episodes, curves, 0.9, lasting=2)
    assert twice.times.tolist() == [60.0, 40.0, 60.0]
    assert twice.reached.tolist() == [False, True, False]
    never = trials_to_threshold(episodes, curves, 0.9, lasting=9)
    assert never.reached.tolist() == [False, False, False]


def test_what_are_no_durations_is_refused():
    with pytest.raises(InvalidArgumentError, match="one entry for each run"):
        Durations([1.0, 2.0], [True])
    with pytest.raises(InvalidArgumentError, match="times must be >= 0, got -1"):
        Durations([-1.0], [True])
    one, two = Durations([1.0], [True]), Durations([1.0, 2.0], [True, True])
    with pytest.raises(InvalidArgumentError, match="as many, got 1 and 2"):
        restricted_mean_ratio(one, two, 10.0)
