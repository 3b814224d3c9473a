"""The bootstrap: intervals of anything over learning runs, without assumptions.

Runs are drawn with replacement and the statistic is computed again. The interval holds the middle
95 % of the results (``"percentile"``), or those shares of them that correct for bias and skewness
(``"bca"``, Efron 1987). Runs pooled over tasks are drawn within each task (stratified), as
Agarwal et al. advise. All randomness comes from the seed that is passed in.

References: B. Efron, *Better bootstrap confidence intervals*, JASA 82 (1987); R. Agarwal et al.,
*Deep reinforcement learning at the edge of the statistical precipice*, NeurIPS 2021.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.evaluation.intervals import NORMAL, Estimate, Interval, check_confidence
from eutree.validation import check_choice, check_integer, check_seed, check_vector

Statistic = Callable[[Floats], Floats]
"""What is estimated: from [..., N] to [...], along the last axis."""

METHODS = ("percentile", "bca")
_BLOCK = 1 << 20  # numbers drawn at once


def mean(values: Floats) -> Floats:
    """Return the mean along the last axis."""
    return np.asarray(values.mean(axis=-1))


def median(values: Floats) -> Floats:
    """Return the median along the last axis."""
    return np.asarray(np.median(values, axis=-1))


def bootstrap(
    values: ArrayLike,
    statistic: Statistic = mean,
    *,
    confidence: float = 0.95,
    method: str = "bca",
    resamples: int = 9999,
    seed: int = 0,
) -> Estimate:
    """Return a statistic of one value per run, with its interval.

    Args:
        values: One value per run, shape [N].
        statistic: What is estimated.
        confidence: Share of such intervals that hold the truth.
        method: ``"bca"`` or ``"percentile"``.
        resamples: How many times runs are drawn.
        seed: Source of chance.
    """
    return stratified_bootstrap(
        [values], statistic, confidence=confidence, method=method, resamples=resamples, seed=seed
    )


def stratified_bootstrap(
    strata: Sequence[ArrayLike],
    statistic: Statistic = mean,
    *,
    confidence: float = 0.95,
    method: str = "bca",
    resamples: int = 9999,
    seed: int = 0,
) -> Estimate:
    """Return a statistic of the runs of several tasks, with its interval; see ``bootstrap``.

    Args:
        strata: One value per run, for each task.
        statistic: What is estimated, of all values together.
        confidence: Share of such intervals that hold the truth.
        method: ``"bca"`` or ``"percentile"``.
        resamples: How many times runs are drawn, within each task.
        seed: Source of chance.
    """
    groups = [check_vector("values", stratum) for stratum in strata]
    if not groups or not all(group.size for group in groups):
        raise InvalidArgumentError("values must hold at least one run of each task, got none")
    pooled = np.concatenate(groups)
    bounds = np.cumsum([0, *(group.size for group in groups)])
    drawn = np.concatenate([statistic(pooled[rows]) for rows in _draws(bounds, resamples, seed)])
    value = float(statistic(pooled))
    shares = _shares(pooled, statistic, value, drawn, confidence, method)
    low, high = np.quantile(drawn, shares)
    return Estimate(value, Interval(float(low), float(high)), int(pooled.size))


def bootstrap_rows(
    statistic: Callable[[Integers], Floats],
    n: int,
    *,
    confidence: float = 0.95,
    resamples: int = 9999,
    seed: int = 0,
) -> Estimate:
    """Return a statistic of n runs that are more than one number each, with its interval.

    Args:
        statistic: What is estimated, from the numbers of the runs drawn [B, n] to [B].
        n: Number of runs; what belongs to one run is drawn together.
        confidence: Share of such (percentile) intervals that hold the truth.
        resamples: How many times runs are drawn.
        seed: Source of chance.
    """
    drawn = statistic(draw_rows(n, resamples=resamples, seed=seed))
    tail = (1 - check_confidence(confidence)) / 2
    low, high = np.quantile(drawn, [tail, 1 - tail])
    value = float(statistic(np.arange(n)[np.newaxis])[0])
    return Estimate(value, Interval(float(low), float(high)), n)


def draw_rows(n: int, *, resamples: int, seed: int) -> Integers:
    """Return rows drawn with replacement, shape [resamples, n], for what has runs as rows."""
    check_integer("n", n, low=1)
    return np.concatenate(list(_draws(np.array([0, n]), resamples, seed)))


def _draws(bounds: Integers, resamples: int, seed: int) -> "list[Integers]":
    """Return blocks of resampled places [B, N], each place drawn from its own stratum."""
    check_integer("resamples", resamples, low=100)
    generator = np.random.default_rng(check_seed(seed))
    sizes = np.diff(bounds)
    low, high = np.repeat(bounds[:-1], sizes), np.repeat(bounds[1:], sizes)
    rows = max(1, _BLOCK // int(bounds[-1]))
    return [
        generator.integers(low, high, size=(min(rows, resamples - first), int(bounds[-1])))
        for first in range(0, resamples, rows)
    ]


def _shares(
    pooled: Floats,
    statistic: Statistic,
    value: float,
    drawn: Floats,
    confidence: float,
    method: str,
) -> Floats:
    """Return which quantiles of the draws are the ends of the interval."""
    tail = (1 - check_confidence(confidence)) / 2
    plain = np.array([tail, 1 - tail])
    below = float((drawn < value).mean() + (drawn == value).mean() / 2)
    if check_choice("method", method, METHODS) == "percentile" or not 0 < below < 1:
        return plain
    bias = NORMAL.inv_cdf(below)
    acceleration = _acceleration(pooled, statistic)
    ends = []
    for share in plain.tolist():
        z = bias + NORMAL.inv_cdf(share)
        ends.append(NORMAL.cdf(bias + z / (1 - acceleration * z)))
    return np.array(ends)


def _acceleration(pooled: Floats, statistic: Statistic) -> float:
    """Return a sixth of the skewness of the jackknife: the statistic with one run left out."""
    n = pooled.size
    if n < 3:
        return 0.0
    others = np.array([np.delete(pooled, i) for i in range(n)])
    jackknife = statistic(others)
    away = jackknife.mean() - jackknife
    spread = float((away**2).sum())
    return float((away**3).sum()) / (6 * spread**1.5) if spread > 0 else 0.0
