"""Spearman's rank correlation: do imagined returns, say, order trees as real returns do?"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers

NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class RankCorrelation:
    """Spearman's rank correlation and its 95 % interval.

    Attributes:
        n: Number of pairs, such as trees.
        value: The correlation; NaN for fewer than three, or if all are alike.
        low: Lower end of the interval; -1 where nothing is known.
        high: Upper end; 1 where nothing is known.
    """

    n: int
    value: float
    low: float
    high: float

    @property
    def better_than_chance(self) -> bool:
        """Whether the interval lies above 0."""
        return self.low > 0.0

    @property
    def worse_than_chance(self) -> bool:
        """Whether the interval lies below 0."""
        return self.high < 0.0


def rank_correlation(
    first: Floats, second: Floats, *, quantile: float = NORMAL_95
) -> RankCorrelation:
    """Return the rank correlation of two vectors [n], ties at their mean rank.

    The interval is Fisher's, with the variance (1 + r^2 / 2) / (n - 3) of Bonett and Wright (2000).
    Fisher's transform of a perfect order is infinite, though a few pairs often are in perfect
    order where the correlation is not 1. It is taken at half a step short of 1, the continuity
    correction of a coefficient whose steps are 12 / (n^3 - n) (Kendall and Gibbons 1990).

    Args:
        first: One value of each pair, such as an imagined return.
        second: The other.
        quantile: Of the normal distribution, at the upper end of the interval.
    """
    n = first.size
    if n < 3 or np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return RankCorrelation(n, float("nan"), -1.0, 1.0)
    value = float(np.corrcoef(ranks(first), ranks(second))[0, 1])
    if abs(value) > 1.0 - 1e-12:  # but for rounding
        value = float(np.sign(value))
    if n == 3:
        return RankCorrelation(n, value, -1.0, 1.0)
    inner = 1.0 - 6.0 / (n**3 - n)
    perfect = abs(value) > inner
    centre = np.arctanh(np.clip(value, -inner, inner))
    reach = quantile * np.sqrt((1.0 + value * value / 2.0) / (n - 3))
    low, high = np.tanh(centre - reach), np.tanh(centre + reach)
    return RankCorrelation(
        n,
        value,
        -1.0 if perfect and value < 0.0 else float(low),
        1.0 if perfect and value > 0.0 else float(high),
    )


def ranks(values: Floats) -> Floats:
    """Return the rank of each value, from 1 on; equal ones share the mean of their ranks."""
    _, number, counts = np.unique(values, return_inverse=True, return_counts=True)
    last: Integers = np.cumsum(counts)
    shared: Floats = (last - 0.5 * (counts - 1))[number]
    return shared
