"""The verdict on a tree beside its demonstrator: the words, the ranges, what is never compared."""

import math

import numpy as np
import pytest

from eutree.evaluation import Evaluation
from eutree.evaluation.evaluation import wilson_interval
from eutree.fitting.report import result_in_words, verdict


def successes(count, of, returns=0.0):
    won = np.arange(of) < count
    return played(np.full(of, returns), won)


def played(returns, won=None):
    count = len(returns)
    return Evaluation(np.asarray(returns, float), np.ones(count), np.full(count, "end"), won)


@pytest.mark.parametrize(
    ("tree", "person", "word"),
    [
        ((93, 100), (9, 15), "better"),  # 93 % beside 60 %
        ((83, 100), (13, 15), "too close to tell"),  # 83 % beside something between 62 and 96 %
        ((126, 200), (15, 15), "worse"),
        ((200, 200), (15, 15), "as good"),
        ((198, 200), (15, 15), "as good"),
        ((180, 200), (15, 15), "too close to tell"),
        ((0, 200), (0, 15), "too close to tell"),
        ((199, 200), (13, 15), "better"),
        ((1, 1), (1, 1), "too close to tell"),
    ],
)
def test_the_word_follows_from_both_intervals(tree, person, word) -> None:
    assert verdict(successes(*person), successes(*tree)).word == word


def test_the_interval_of_two_rates_is_newcombes() -> None:
    """56 of 70 and 48 of 80: Newcombe 1998, table II, example (a), method 10."""
    found = verdict(successes(48, 80), successes(56, 70))
    assert math.isclose(found.difference, 0.2)
    assert np.allclose(found.interval, (0.0524, 0.3339), atol=5e-5)


def test_the_interval_of_two_means_is_welchs() -> None:
    from scipy.stats import ttest_ind

    generator = np.random.default_rng(0)
    person, tree = generator.normal(0, 3, 15), generator.normal(1, 1, 200)
    found = verdict(played(person), played(tree))
    exact = ttest_ind(tree, person, equal_var=False).confidence_interval()
    assert np.allclose(found.interval, exact, atol=0.02)
    assert found.measure == "return"


@pytest.mark.parametrize("seed", range(5))
def test_a_tree_like_its_person_is_seldom_called_worse_or_better(seed) -> None:
    """An interval of 95 % errs in about 5 of 100; four standard errors of 400 tries are 4.4."""
    generator = np.random.default_rng(seed)
    words = [
        verdict(
            successes(generator.binomial(15, 0.87), 15),
            successes(generator.binomial(200, 0.87), 200),
        ).word
        for _ in range(400)
    ]
    assert sum(word in ("better", "worse") for word in words) / 400 < 0.05 + 0.044


@pytest.mark.parametrize(
    ("tree", "word"),
    [([500.0] * 200, "as good"), ([499.0] * 200, "as good"), ([100.0] * 200, "worse"),
     ([600.0] * 200, "better")],
)  # fmt: skip
def test_returns_without_any_spread(tree, word) -> None:
    assert verdict(played([500.0] * 15), played(tree)).word == word


def test_one_episode_shows_no_spread() -> None:
    assert verdict(played([1.0]), played([500.0] * 200)).word == "too close to tell"


def test_two_measures_are_never_compared() -> None:
    """A return of -2 beside 58 of 100 says nothing, whichever is the larger number."""
    person, tree = played([-2.0, -3.0]), successes(58, 100, returns=-50.0)
    found = verdict(person, tree)
    assert (found.measure, found.word) == ("return", "worse")
    assert result_in_words(tree, found.measure) == "-50 on average (-50 to -50) in 100 episodes"
    unknown = played([np.nan, np.nan], np.array([True, True]))
    assert verdict(unknown, played([1.0, 2.0])).word == "not comparable"
    assert verdict(unknown, tree).measure == "success"


def test_without_a_whole_episode_nothing_is_compared() -> None:
    assert verdict(None, successes(58, 100)).word == "not comparable"
    assert result_in_words(None) == "no episode played alone to its end"


def test_ranges_are_rounded_outwards() -> None:
    low, high = wilson_interval(13, 15)
    assert result_in_words(successes(13, 15)) == "13 of 15 (62 to 97 %)"
    assert 0.62 < low < 0.63 < high < 0.97
    assert result_in_words(played([np.nan])) == "unknown returns in 1 episode"
    assert result_in_words(played([2.0])) == "2 in one episode"
