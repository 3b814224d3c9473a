import numpy as np
import pytest
from scipy import stats

from eutree.errors import InvalidArgumentError
from eutree.evaluation.evaluation import mean_interval, student_quantile, wilson_interval


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 5, 14, 15, 29, 30, 99, 199, 200, 201, 1000, 10**6])
@pytest.mark.parametrize("probability", [0.001, 0.025, 0.3, 0.5, 0.9, 0.975, 0.9995])
def test_quantiles_of_student_equal_scipy(freedom, probability):
    expected = stats.t.ppf(probability, freedom)
    assert student_quantile(probability, freedom) == pytest.approx(expected, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("n", [2, 3, 15, 100, 1000])
@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.99])
def test_the_interval_of_a_mean_equals_scipy(n, confidence):
    sample = np.random.default_rng(n).normal(3.0, 2.0, n)
    expected = stats.t.interval(confidence, n - 1, sample.mean(), stats.sem(sample))
    np.testing.assert_allclose(mean_interval(sample, confidence=confidence), expected, rtol=1e-6)


@pytest.mark.parametrize(("successes", "n"), [(0, 1), (1, 1), (0, 100), (98, 100), (100, 100)])
@pytest.mark.parametrize("confidence", [0.9, 0.95])
def test_wilson_equals_scipy(successes, n, confidence):
    expected = stats.binomtest(successes, n).proportion_ci(confidence, method="wilson")
    found = wilson_interval(successes, n, confidence=confidence)
    np.testing.assert_allclose(found, (expected.low, expected.high), atol=1e-12)


def test_what_has_no_interval_is_refused():
    with pytest.raises(InvalidArgumentError, match=r"confidence must be a number in \(0, 1\)"):
        mean_interval([1.0, 2.0], confidence=1.0)
    with pytest.raises(InvalidArgumentError, match="successes must be an integer from 0 to 3"):
        wilson_interval(4, 3)
