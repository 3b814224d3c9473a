"""Whether a model can be trusted: do imagined returns order trees as real returns do?"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers

NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class RankCorrelation:
    """Spearman's rank correlation and its 95 % interval.

    Attributes:
        n: Number of trees.
        value: The correlation; NaN for fewer than three trees, or if all are alike.
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


def rank_correlation(imagined: Floats, real: Floats) -> RankCorrelation:
    """Return the rank correlation of two vectors [n], ties at their mean rank.

    The interval is Fisher's, with the variance (1 + r^2 / 2) / (n - 3) of Bonett and Wright (2000).
    """
    n = imagined.size
    if n < 3 or np.ptp(imagined) == 0.0 or np.ptp(real) == 0.0:
        return RankCorrelation(n, float("nan"), -1.0, 1.0)
    value = float(np.corrcoef(ranks(imagined), ranks(real))[0, 1])
    if n < 4 or abs(value) >= 1.0:
        low = value if n >= 4 else -1.0
        return RankCorrelation(n, value, low, value if n >= 4 else 1.0)
    reach = NORMAL_95 * np.sqrt((1.0 + value * value / 2.0) / (n - 3))
    centre = np.arctanh(value)
    return RankCorrelation(n, value, float(np.tanh(centre - reach)), float(np.tanh(centre + reach)))


def ranks(values: Floats) -> Floats:
    """Return the rank of each value, from 1 on; equal ones share the mean of their ranks."""
    _, number, counts = np.unique(values, return_inverse=True, return_counts=True)
    last: Integers = np.cumsum(counts)
    shared: Floats = (last - 0.5 * (counts - 1))[number]
    return shared
