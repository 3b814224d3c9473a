"""Can this world model be trusted here? How it ordered trees, and their real returns.

Spearman: the order alone counts.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eutree.arrays import Floats, Integers

NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class RankCorrelation:
    """Spearman's rank correlation and its 95 % interval."""

    n: int  # number of pairs, such as trees
    value: float  # the correlation; NaN for fewer than three, or if all are alike
    low: float  # lower end of the interval; -1 where nothing is known
    high: float  # upper end; 1 where nothing is known

    @property
    def better_than_chance(self) -> bool:
        """Whether the interval lies above 0."""
        return self.low > 0.0

    @property
    def worse_than_chance(self) -> bool:
        """Whether the interval lies below 0."""
        return self.high < 0.0


def rank_correlation(first: Floats, second: Floats) -> RankCorrelation:
    """Return the rank correlation of two vectors [n], ties at their mean rank."""
    if first.size < 3 or np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return RankCorrelation(first.size, float("nan"), -1.0, 1.0)
    value = float(np.corrcoef(ranks(first), ranks(second))[0, 1])
    return with_interval(value, first.size)


def with_interval(value: float, n: int) -> RankCorrelation:
    """Return a rank correlation of n pairs with its interval.

    That is Fisher's, with the variance (1 + r^2 / 2) / (n - 3) of Bonett and Wright (2000).
    Fisher's transform of a perfect order is infinite, though a few pairs often are in perfect
    order where the correlation is not 1. It is taken at half a step short of 1, the continuity
    correction of a coefficient whose steps are 12 / (n^3 - n) (Kendall and Gibbons 1990).
    """
    if abs(value) > 1.0 - 1e-12:  # but for rounding
        value = float(np.sign(value))
    if n <= 3:
        return RankCorrelation(n, value, -1.0, 1.0)
    inner = 1.0 - 6.0 / (n**3 - n)
    perfect = abs(value) > inner
    centre = np.arctanh(np.clip(value, -inner, inner))
    reach = NORMAL_95 * np.sqrt((1.0 + value * value / 2.0) / (n - 3))
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


FEWEST_TREES = 5  # four are in perfect order by chance once in 24 times


@dataclass(frozen=True, eq=False)
class ModelTrust:
    """How a world model orders the trees that were really run.

    Attributes:
        imagined: Each tree's score in the model.
        real: Its mean return in real episodes.
        episodes: How many of these there were.
    """

    imagined: Floats  # [n]
    real: Floats  # [n]
    episodes: Integers  # [n]

    @cached_property
    def correlation(self) -> RankCorrelation:
        """Spearman's rank correlation of both, with its 95 % interval."""
        return rank_correlation(self.imagined, self.real)

    @property
    def better_than_chance(self) -> bool:
        """Whether the interval lies above 0, and there are at least five trees."""
        return self.correlation.n >= FEWEST_TREES and self.correlation.better_than_chance

    def describe(self) -> str:
        """Return the judgement on the model in one sentence."""
        found = self.correlation
        if found.n < FEWEST_TREES or np.isnan(found.value):
            return (
                f"whether the world model can be trusted is not known: {found.n} of the trees "
                "that it judged were really run"
            )
        measured = (
            f"of {found.n} trees has rank correlation {found.value:.2f} "
            f"[{found.low:.2f}, {found.high:.2f}] with their real returns"
        )
        if found.better_than_chance:
            return f"the world model can be trusted here: its order {measured}"
        verdict = "worse than chance" if found.worse_than_chance else "no better than chance"
        return (
            f"the world model cannot be trusted here: its order {measured}, {verdict}; only "
            "trees that were clearly better in real episodes were adopted"
        )

    def figures(self) -> dict[str, float | int | list[float] | list[int]]:
        """Return all of it in JSON's types; nothing for fewer than three trees."""
        found = self.correlation
        if np.isnan(found.value):
            return {}
        return {
            "rank_correlation": found.value,
            "rank_correlation_low": found.low,
            "rank_correlation_high": found.high,
            "trees_compared": found.n,
            "imagined": self.imagined.tolist(),
            "real": self.real.tolist(),
            "real_episodes": self.episodes.tolist(),
        }
