import numpy as np
import pytest
from scipy import stats

from eutree.errors import InvalidArgumentError
from eutree.evaluation import (
    bootstrap,
    bootstrap_rows,
    mean,
    median,
    stratified_bootstrap,
)

SAMPLES = {
    "skewed": np.random.default_rng(0).exponential(size=15),
    "ties": np.random.default_rng(1).integers(0, 4, 20).astype(float),
    "normal": np.random.default_rng(2).normal(size=40),
}


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize(("method", "theirs"), [("percentile", "percentile"), ("bca", "BCa")])
def test_intervals_equal_scipy_up_to_chance(name, method, theirs):
    sample, statistic = SAMPLES[name], mean
    ours = bootstrap(sample, statistic, method=method, resamples=20_000, seed=5)
    other = stats.bootstrap(
        (sample,), lambda x, axis: statistic(np.moveaxis(x, axis, -1)), method=theirs,
        n_resamples=20_000, rng=np.random.default_rng(9),
    ).confidence_interval  # fmt: skip
    width = other.high - other.low
    np.testing.assert_allclose(ours.interval, (other.low, other.high), atol=0.04 * width)
    assert ours.value == pytest.approx(float(statistic(sample)))
    assert ours.n == sample.size


def test_strata_keep_their_sizes():
    """Two tasks on different levels: drawn within tasks, the difference of levels is no noise."""
    low, high = np.random.default_rng(0).normal([[0.0], [100.0]], 1.0, (2, 15))
    stratified = stratified_bootstrap([low, high], seed=1)
    pooled = bootstrap(np.concatenate([low, high]), seed=1)
    assert np.diff(stratified.interval)[0] < 2.0 < 20.0 < np.diff(pooled.interval)[0]
    assert stratified.value == pytest.approx(pooled.value)
    assert stratified.n == 30


def test_intervals_cover_the_truth_as_often_as_they_say():
    generator = np.random.default_rng(0)
    hits = 0
    for trial in range(300):
        low, high = bootstrap(generator.normal(size=20), resamples=500, seed=trial).interval
        hits += low <= 0.0 <= high
    assert 0.88 <= hits / 300 <= 0.98


def test_runs_of_several_numbers_are_drawn_together():
    generator = np.random.default_rng(3)
    first, second = generator.exponential(size=(2, 25))
    ours = bootstrap_rows(
        lambda rows: first[rows].mean(axis=1) / second[rows].mean(axis=1), 25, resamples=20_000
    )
    theirs = stats.bootstrap(
        (first, second),
        lambda x, y, axis: x.mean(axis=axis) / y.mean(axis=axis),
        paired=True, method="percentile", n_resamples=20_000, rng=np.random.default_rng(9),
    ).confidence_interval  # fmt: skip
    assert ours.value == pytest.approx(first.mean() / second.mean())
    width = theirs.high - theirs.low
    assert ours.interval.low == pytest.approx(theirs.low, abs=0.05 * width)
    assert ours.interval.high == pytest.approx(theirs.high, abs=0.05 * width)


def test_the_seed_decides_and_nothing_else():
    sample = SAMPLES["skewed"]
    assert bootstrap(sample, seed=3) == bootstrap(sample, seed=3)
    assert bootstrap(sample, seed=3) != bootstrap(sample, seed=4)
    before = np.random.get_state()[1].tolist()  # noqa: NPY002 - that it is left alone
    bootstrap(sample, median)
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002 - that it is left alone


@pytest.mark.parametrize("sample", [[2.0], [2.0, 2.0, 2.0]])
def test_no_spread_gives_no_width(sample):
    estimate = bootstrap(sample)
    assert estimate.interval == (2.0, 2.0)


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(InvalidArgumentError, match="at least one run"):
        bootstrap([])
    with pytest.raises(InvalidArgumentError, match="unknown method 'bsa'"):
        bootstrap([1.0, 2.0, 4.0], method="bsa")
    with pytest.raises(InvalidArgumentError, match="resamples must be an integer >= 100"):
        bootstrap([1.0, 2.0], resamples=5)
