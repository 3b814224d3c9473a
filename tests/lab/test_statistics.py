"""Intervals over runs, by hand and by what is known of them."""

import math
import sys

import numpy as np
import pytest
from scipy import stats

from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.policy_search.model_trust import rank_correlation
from eutree_lab.statistics import (
    Durations,
    bootstrap,
    bootstrap_rows,
    restricted_mean,
    restricted_mean_ratio,
    spearman,
    trials_to_threshold,
)


def durations(times, reached):
    return Durations(np.array(times, float), np.array(reached, bool))


def test_the_mean_lies_in_its_interval_and_the_seed_decides():
    sample = np.random.default_rng(0).exponential(size=15)
    estimate = bootstrap(sample, seed=3)
    assert estimate.interval.low < estimate.value < estimate.interval.high
    assert estimate.value == pytest.approx(sample.mean())
    assert estimate == bootstrap(sample, seed=3) != bootstrap(sample, seed=4)


@pytest.mark.parametrize("sample", [[2.0], [2.0, 2.0, 2.0]])
def test_no_spread_gives_no_width(sample):
    assert bootstrap(sample).interval == (2.0, 2.0)


def test_two_runs_have_an_interval():
    low, high = bootstrap([1.0, 2.0]).interval
    assert 1.0 <= low <= high <= 2.0


def test_no_run_is_refused():
    with pytest.raises(InvalidArgumentError, match="at least one run"):
        bootstrap([])


def test_what_belongs_to_a_run_is_drawn_together():
    values = np.random.default_rng(3).exponential(size=25)
    estimate = bootstrap_rows(lambda rows: (2 * values[rows] / values[rows]).mean(axis=1), 25)
    assert [estimate.value, *estimate.interval] == pytest.approx([2.0] * 3)


def test_the_restricted_mean_without_censoring_is_a_mean():
    times = np.array([2.0, 5.0, 5.0, 9.0, 30.0])
    for horizon in (4.0, 5.0, 20.0, 100.0):
        expected = np.minimum(times, horizon).mean()
        found = restricted_mean(durations(times, [True] * 5), horizon)
        assert found == pytest.approx(expected)


def test_the_restricted_mean_of_the_textbook():
    """Remission of leukemia under 6-MP (Freireich et al. 1963): the classical example."""
    times = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
    reached = [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
    edges = [0, 6, 7, 10, 13, 16, 22, 23, 35]
    shares = [1.0, 0.8571, 0.8067, 0.7529, 0.6902, 0.6275, 0.5378, 0.4482]
    area = float(np.diff(edges) @ shares)
    assert restricted_mean(durations(times, reached), 35.0) == pytest.approx(area, abs=2e-3)


def test_runs_that_never_got_there_count_in_full():
    """Left out, they would make the learner look fast: 20 instead of 110 trials."""
    found = restricted_mean(durations([20, 20, 200, 200], [1, 1, 0, 0]), 200.0)
    assert found == pytest.approx(110.0)
    assert restricted_mean(durations([60, 60], [0, 0]), 60.0) == pytest.approx(60.0)


def test_half_the_time_is_a_ratio_of_a_half():
    slow = np.random.default_rng(0).integers(5, 40, 15) * 20.0
    every = np.ones(15, bool)
    half = restricted_mean_ratio(Durations(slow / 2, every), Durations(slow, every), 1000.0)
    np.testing.assert_allclose([half.value, *half.interval], 0.5)
    nothing = Durations(np.zeros(15), every)
    assert restricted_mean_ratio(nothing, nothing, 10.0).value == 1.0
    assert restricted_mean_ratio(Durations(slow, every), nothing, 10.0).value == math.inf
    with pytest.raises(InvalidArgumentError, match="as many, got 15 and 1"):
        restricted_mean_ratio(nothing, durations([1.0], [True]), 10.0)


def test_the_first_point_at_the_level_is_the_time():
    curves = [[0.0, 0.9, 0.2, 0.9], [0.0, 0.1, 0.95, 0.9], [0.0, 0.1, 0.2, 0.3]]
    found = trials_to_threshold([0, 20, 40, 60], curves, 0.9)
    assert found.times.tolist() == [20.0, 40.0, 60.0]
    assert found.reached.tolist() == [True, True, False]


def test_a_constant_has_no_rank_correlation():
    found = spearman([1.0, 1.0, 1.0], [1.0, 2.0, 3.0])
    assert (found.value, *found.interval) == (0.0, -1.0, 1.0)
    assert spearman(np.arange(9.0), np.arange(9.0) ** 3).value == pytest.approx(1.0)


def test_rank_correlation_is_scipys_with_the_interval_of_the_core():
    generator = np.random.default_rng(1)
    one = generator.integers(0, 5, 20).astype(float)
    other = one + generator.standard_normal(20)
    found, core = spearman(one, other), rank_correlation(one, other)
    assert found.value == stats.spearmanr(one, other).statistic
    expected = [core.value, core.low, core.high]
    assert [found.value, *found.interval] == pytest.approx(expected, abs=1e-12)
    assert found.n == 20


def test_without_scipy_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'eutree\[lab\]'"):
        bootstrap([1.0, 2.0, 4.0])
