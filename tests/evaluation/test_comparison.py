import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from eutree.errors import InvalidArgumentError
from eutree.evaluation import compare_paired, spearman
from eutree.evaluation.comparison import sign_flip_p_value

NUMBERS = st.integers(-3, 3).map(float)


@settings(deadline=None)
@given(st.lists(NUMBERS, min_size=2, max_size=9))
def test_flips_of_few_pairs_equal_scipy(differences):
    expected = stats.permutation_test(
        (np.array(differences), np.zeros(len(differences))), lambda x, y: np.sum(x - y),
        permutation_type="samples", n_resamples=np.inf,
    ).pvalue  # fmt: skip
    assert sign_flip_p_value(differences) == pytest.approx(expected)


def test_random_flips_agree_with_all_flips():
    differences = np.random.default_rng(1).normal(0.5, 1.0, 12)
    exact = sign_flip_p_value(differences)
    padded = sign_flip_p_value(np.concatenate([differences, [1e-9]]), resamples=50_000)
    assert padded == pytest.approx(exact, abs=0.01)


def test_random_flips_hold_their_level():
    generator = np.random.default_rng(0)
    values = [
        sign_flip_p_value(generator.normal(size=15), resamples=199, seed=i) for i in range(400)
    ]
    assert 0.02 <= np.mean(np.array(values) <= 0.05) <= 0.085


def test_pairs_on_common_seeds_cancel_what_they_share():
    generator = np.random.default_rng(0)
    common = generator.normal(0.0, 50.0, 15)
    first, second = common + 1.0 + 0.1 * generator.normal(size=15), common
    comparison = compare_paired(first, second)
    low, high = comparison.difference.interval
    assert 0.9 < low < comparison.difference.value < high < 1.1
    assert (comparison.wins, comparison.losses) == (15, 0)
    assert comparison.p_value < 0.001
    assert compare_paired(second, second).p_value == 1.0


@settings(deadline=None)
@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=3, max_size=20))
def test_rank_correlation_equals_scipy(pairs):
    first, second = np.array(pairs).T
    estimate = spearman(first, second)
    if np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        assert estimate.value == 0.0
        assert estimate.interval == (-1.0, 1.0)
    else:
        assert estimate.value == pytest.approx(stats.spearmanr(first, second).statistic)
        assert -1.0 <= estimate.interval.low <= estimate.value + 1e-12
        assert estimate.value - 1e-12 <= estimate.interval.high <= 1.0


def test_the_interval_of_a_rank_correlation_covers():
    generator = np.random.default_rng(0)
    truth = 6 / np.pi * np.arcsin(0.6 / 2)  # Spearman's coefficient of normal pairs, 0.6 correlated
    hits = 0
    for _ in range(500):
        pairs = generator.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], size=25)
        low, high = spearman(*pairs.T).interval
        hits += low <= truth <= high
    assert 0.91 <= hits / 500 <= 0.98


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(InvalidArgumentError, match="second must have 2 entries, got 1"):
        compare_paired([1.0, 2.0], [1.0])
