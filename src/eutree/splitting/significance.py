"""Tests of significance as small values: is the best split better than noise would offer?

Each asks for the split that ``search.best(sample)`` found. ``Naive`` is the paper read literally:
one test of one cut, no correction. ``Maximal`` and ``Permutation`` account for the choice among all
cuts, attributes and actions.
"""

import math
from typing import Protocol, TypeAlias

import msgspec
import numpy as np

from eutree.splitting.maximal import maximal_p
from eutree.splitting.naive import naive_p
from eutree.splitting.permutation import permutation_p
from eutree.splitting.search import KolmogorovSmirnov
from eutree.splitting.split import LeafSample, Split
from eutree.validation import check_integer, check_number


class Significance(Protocol):
    """A test of the best split of a leaf at a level."""

    @property
    def alpha(self) -> float:
        """Level: the largest p-value that is accepted."""

    def p_value(
        self,
        split: Split,
        sample: LeafSample,
        search: KolmogorovSmirnov,
        generator: np.random.Generator,
    ) -> float:
        """Return the chance of a split as good as this one on noise."""


class _AtLevel(msgspec.Struct, frozen=True):
    """A test that has its level and nothing else.

    Attributes:
        alpha: Level of the test: the chance of a split of noise.
    """

    alpha: float = 0.01

    def __post_init__(self) -> None:
        _check_level(self.alpha)


class Naive(_AtLevel, frozen=True, tag=True):
    """The two-sample test of the cut as if it had been chosen in advance (the paper)."""

    def p_value(
        self,
        split: Split,
        sample: LeafSample,
        search: KolmogorovSmirnov,
        generator: np.random.Generator,
    ) -> float:
        """Return the p-value of the two-sample Kolmogorov-Smirnov test of this cut alone."""
        return naive_p(split.statistic, split.n_left, split.n_right)


class Maximal(_AtLevel, frozen=True, tag=True):
    """The tabulated law of the maximum over cuts, corrected over attributes and actions.

    Conservative under ties: rare events among equal returns are not seen.
    """

    def p_value(
        self,
        split: Split,
        sample: LeafSample,
        search: KolmogorovSmirnov,
        generator: np.random.Generator,
    ) -> float:
        """Return the p-value of the maximum over cuts, after Sidak's correction."""
        n = split.n_left + split.n_right
        single = maximal_p(split.scaled_statistic, n, min_side=search.min_side(n))
        n_groups = sum(1 for _ in search.groups(sample))
        return sidak(single, sample.observations.shape[1] * n_groups)


class Permutation(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """The permutation test, exact under ties; screened by the table, which is cheaper.

    Attributes:
        alpha: Level.
        n_permutations: Most draws.
        stop_after: Draws reaching the observed value after which the test stops.
        min_episodes: Fewest distinct episodes on each side of the cut, if episodes are known.
        by_episode: Permute whole episodes instead of tuples, if episodes are known.
    """

    alpha: float = 0.01
    n_permutations: int = 999
    stop_after: int = 10
    min_episodes: int = 3
    by_episode: bool = False

    def __post_init__(self) -> None:
        _check_level(self.alpha)
        check_integer("n_permutations", self.n_permutations, low=math.ceil(1 / self.alpha) - 1)
        check_integer("stop_after", self.stop_after, low=1)
        check_integer("min_episodes", self.min_episodes, low=0)

    def p_value(
        self,
        split: Split,
        sample: LeafSample,
        search: KolmogorovSmirnov,
        generator: np.random.Generator,
    ) -> float:
        """Return the table's p-value where it is small enough, else that of the permutations."""
        if sample.episodes is not None and episodes_on_a_side(split, sample) < self.min_episodes:
            return 1.0
        by_episode = self.by_episode and sample.episodes is not None
        if not by_episode:  # the table knows nothing of dependence within episodes
            screened = Maximal(self.alpha).p_value(split, sample, search, generator)
            if screened <= self.alpha:
                return screened
        return permutation_p(
            sample,
            split,
            search=search,
            generator=generator,
            n_permutations=self.n_permutations,
            stop_after=self.stop_after,
            by_episode=by_episode,
        )


SignificanceTest: TypeAlias = Naive | Maximal | Permutation


def sidak(p: float, n_tests: int) -> float:
    """Return the chance that the smallest of ``n_tests`` independent p-values is at most ``p``."""
    return 1.0 if p >= 1.0 else -math.expm1(n_tests * math.log1p(-p))


def episodes_on_a_side(split: Split, sample: LeafSample) -> int:
    """Return the smaller number of distinct episodes among the tested tuples on a side."""
    if sample.episodes is None:
        return 0
    tested = slice(None) if split.action is None else sample.actions == split.action
    left = sample.observations[tested, split.feature] <= split.threshold
    episodes = sample.episodes[tested]
    return min(np.unique(episodes[left]).size, np.unique(episodes[~left]).size)


def _check_level(alpha: float) -> None:
    check_number("alpha", alpha, low=0.0, high=1.0, low_open=True)
