"""Statistical certificates: exact bounds, true as often as they say."""

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.proof.sampling import Sampling, binomial_bounds, certify_sample


def share_bounds(successes, n, error):
    """Return Clopper and Pearson's bounds by SciPy's quantiles of the beta distribution."""
    stats = pytest.importorskip("scipy.stats")
    low = 0.0 if successes == 0 else stats.beta.ppf(error, successes, n - successes + 1)
    high = 1.0 if successes == n else stats.beta.ppf(1 - error, successes + 1, n - successes)
    return low, high


@pytest.mark.parametrize("n", [1, 7, 100, 1000, 20000])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.97, 1.0])
def test_binomial_bounds_are_scipys(n, share):
    successes = round(share * n)
    found = binomial_bounds(successes, n, error=0.005)
    assert found == pytest.approx(share_bounds(successes, n, 0.005), abs=3e-9)


def test_bounds_hold_as_often_as_they_say():
    generator = np.random.default_rng(0)
    bounds_of = [binomial_bounds(k, 100, error=0.05) for k in range(101)]
    for p in (0.001, 0.3, 0.99):
        bounds = [bounds_of[k] for k in generator.binomial(100, p, 2000)]
        assert np.mean([low > p for low, _ in bounds]) <= 0.065
        assert np.mean([high < p for _, high in bounds]) <= 0.065


def drawn(returns, successes=None):
    returns = np.asarray(returns, dtype=float)
    lengths = np.ones(returns.size, dtype=np.int64)
    endings = np.full(returns.size, "goal")
    return Evaluation(returns, lengths, endings, successes)


def test_the_three_answers():
    successes = np.arange(1000) >= 30
    evaluation = drawn(successes * 1.0, successes)
    for share, verdict in ((0.9, "proven"), (0.97, "undecided"), (0.99, "refuted")):
        question = f"succeeds with probability at least {share}"
        found = certify_sample(evaluation, question, environment="X")
        assert found.verdict == verdict
        assert found.kind == "statistical"
        assert "99 % confidence" in found.sentence


def test_a_mean_needs_a_range_and_the_range_must_hold_the_returns():
    evaluation = drawn(np.linspace(-100, -90, 500))
    with pytest.raises(InvalidArgumentError, match="need the lowest and the highest return"):
        certify_sample(evaluation, "returns at least -99", environment="X")
    with pytest.raises(InvalidArgumentError, match="range must hold every return"):
        certify_sample(
            evaluation, "returns at least -99", environment="X", sampling=Sampling(returns=(-95, 0))
        )
    found = certify_sample(
        evaluation, "returns at least -99", environment="X", sampling=Sampling(returns=(-200, 0))
    )
    assert found.bounds["mean_return"][0] < -95 < found.bounds["mean_return"][1]
    assert found.proven


def test_a_share_of_returns():
    evaluation = drawn(np.arange(1000))
    found = certify_sample(
        evaluation, "returns at least 100 with probability at least 0.8", environment="X"
    )
    assert found.proven
    assert found.bounds["share"][0] < 0.9 < found.bounds["share"][1]


def test_without_a_property_what_is_known_is_said():
    found = certify_sample(drawn([1.0] * 499 + [-5.0]), environment="X")
    low, _ = found.bounds["share_at_least_worst_seen"]
    assert low == pytest.approx(0.01 ** (1 / 500), abs=1e-6)
    assert "returns at least -5" in found.sentence


@pytest.mark.parametrize("question", ["arrives", "succeeds with probability at least 0.5"])
def test_what_episodes_cannot_answer(question):
    with pytest.raises(InvalidArgumentError, match=r"needs a plant|reports no success"):
        certify_sample(drawn([1.0]), question, environment="X")
    with pytest.raises(InvalidArgumentError, match="needs a plant"):
        certify_sample(drawn([1.0]), "stays in x <= 1", environment="X")


def test_several_statements_say_that_each_has_the_confidence():
    episodes = drawn(np.arange(60.0), np.arange(60) % 2 == 0)
    said = certify_sample(episodes, environment="Room-v0").sentence
    assert said.startswith("in Room-v0, each with 99 % confidence by 60 episodes: an episode")
    alone = certify_sample(drawn(np.arange(60.0)), environment="Room-v0").sentence
    assert alone.startswith("in Room-v0, with 99 % confidence by 60 episodes: an episode")
