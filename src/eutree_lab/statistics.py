"""Intervals and comparisons over learning runs, by SciPy.

Runs are few and far from normal, so intervals are bootstrap intervals. A run that never reached a
level within its trials is *censored*: all that is known is that it takes longer. Leaving such runs
out, or counting them at their last trial, flatters slow learners; the restricted mean, the area
under Kaplan and Meier's share of runs that are not there yet, is always finite.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError, needed
from eutree.evaluation import Estimate, Interval
from eutree.policy_search.model_trust import with_interval
from eutree.validation import check_vector

CONFIDENCE = 0.95
RESAMPLES = 9999


def stats() -> Any:
    """Return the module scipy.stats, or raise MissingExtraError."""
    with needed("scipy", "lab"):
        from scipy import stats
    return stats


def bootstrap(values: ArrayLike, *, seed: int = 0) -> Estimate:
    """Return the mean of one value per run [N], with its 95 % interval (BCa, Efron 1987)."""
    runs = check_vector("values", values)
    if not runs.size:
        raise InvalidArgumentError("values must hold at least one run, got none")
    value = float(runs.mean())
    if np.ptp(runs) == 0.0:  # no draw differs from it
        return Estimate(value, Interval(value, value), runs.size)
    found = stats().bootstrap(
        (runs,), np.mean, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="BCa",
        random_state=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return Estimate(value, Interval(float(found.low), float(found.high)), runs.size)


def bootstrap_rows(
    statistic: Callable[[Integers], Floats], n: int, *, resamples: int = RESAMPLES, seed: int = 0
) -> Estimate:
    """Return a statistic of n runs that are more than one number each, with its 95 % interval.

    SciPy's own bootstrap also takes the standard error of what is drawn, which an infinite estimate
    does not have, and its ends lie between two draws.

    Args:
        statistic: Function from the numbers of the runs drawn [B, n] to estimates [B], which may be
            infinite.
        n: Number of runs; all numbers of one run are drawn together.
        resamples: How many times runs are drawn.
        seed: Source of chance.
    """
    drawn = statistic(np.random.default_rng(seed).integers(n, size=(resamples, n)))
    tail = (1.0 - CONFIDENCE) / 2.0
    low = np.quantile(drawn, tail, method="lower")
    high = np.quantile(drawn, 1.0 - tail, method="higher")
    return Estimate(float(statistic(np.arange(n)[None])[0]), Interval(float(low), float(high)), n)


@dataclass(frozen=True, eq=False)
class Durations:
    """How long each run took to reach a level, or that it had not when it ended.

    Attributes:
        times: Trials until the level was reached, or until the run ended.
        reached: Whether it was reached.
    """

    times: Floats  # [N]
    reached: Booleans  # [N]


def trials_to_threshold(
    episodes: ArrayLike, curves: Sequence[ArrayLike], threshold: float
) -> Durations:
    """Return when each run's learning curve first reached a level.

    Args:
        episodes: Trial of each point of the curves, ascending, shape [P].
        curves: Success rates or returns of each run, shape [P] each.
        threshold: The level.
    """
    places = check_vector("episodes", episodes)
    above = np.array([check_vector("curves", c, size=places.size) >= threshold for c in curves])
    reached: Booleans = np.asarray(above.any(axis=1))
    return Durations(np.where(reached, places[above.argmax(axis=1)], places[-1]), reached)


def restricted_mean(durations: Durations, horizon: float) -> float:
    """Return the mean of min(time, horizon): the area under the survival curve up to there."""
    known = stats().CensoredData.right_censored(durations.times, ~durations.reached)
    curve = stats().ecdf(known).sf
    inside = curve.quantiles < horizon
    edges = np.concatenate([[0.0], curve.quantiles[inside], [horizon]])
    heights = np.concatenate([[1.0], curve.probabilities[inside]])
    return float((np.diff(edges) * heights).sum())


def restricted_mean_ratio(
    first: Durations, second: Durations, horizon: float, *, seed: int = 0
) -> Estimate:
    """Return how many times as long the first takes as the second, up to a horizon.

    Args:
        first: Durations of one learner.
        second: Durations of the other; run i of both has the same seed, and pairs are drawn.
        horizon: Where both are cut off; the smallest last trial of all runs, usually.
        seed: Source of chance.
    """
    if len(first.times) != len(second.times):
        raise InvalidArgumentError(
            f"durations must be as many, got {len(first.times)} and {len(second.times)}"
        )

    def ratio(runs: Integers) -> float:
        mine, theirs = (
            restricted_mean(Durations(of.times[runs], of.reached[runs]), horizon)
            for of in (first, second)
        )
        if theirs == 0.0:
            return 1.0 if mine == 0.0 else float("inf")
        return mine / theirs

    return bootstrap_rows(
        lambda rows: np.array([ratio(row) for row in rows]),
        len(first.times), resamples=999, seed=seed,
    )  # fmt: skip


def spearman(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Return Spearman's rank correlation with its 95 % interval (Bonett and Wright 2000).

    Where one side is constant, or fewer than three are, there is none: 0, with [-1, 1].
    """
    one, other = check_vector("first", first), check_vector("second", second)
    if one.size < 3 or np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return Estimate(0.0, Interval(-1.0, 1.0), one.size)
    found = with_interval(float(stats().spearmanr(one, other).statistic), one.size)
    return Estimate(found.value, Interval(found.low, found.high), one.size)
