"""Tests of significance as small values: is the best split better than noise would offer?

Each asks for the split that ``search.best(sample)`` found. ``Naive`` is the paper read literally:
one test of one cut, no correction. ``Maximal`` and ``Permutation`` account for the choice among all
cuts, attributes and actions.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import msgspec
import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.splitting import _kernels
from eutree.splitting.laws import maximal_p, naive_p
from eutree.splitting.search import KolmogorovSmirnov, LeafSample, Split
from eutree.validation import check_amounts, check_integer, check_number

# If the returns of an action do not depend on the observations, every assignment of its returns to
# its tuples is equally likely. One draw permutes the returns within each action and searches all
# actions, attributes and cuts again, so the p-value is already family-wise over all of them
# (Westfall and Young). Where returns are clustered, the returns of a whole episode take the place
# of another's, stretched to its length and rotated in time: the dependence inside an episode stays.
# Laid end to end instead, episodes of different lengths would mix, and clusters would pass for
# structure. Only episodes of similar length change places: where a few long episodes have returns
# of a larger spread, short ones that took these would hide, in every draw, the chance effects of
# the long ones. Without the rotation the returns of episodes of one length would stay where they
# were in time, and so beside observations that tell it.


MOST_TIMES = 2  # as long as the shortest of its class is an episode at most


def permutation_p(
    sample: LeafSample,
    split: Split,
    *,
    search: KolmogorovSmirnov,
    generator: np.random.Generator,
    n_permutations: int = 999,
    stop_after: int = 10,
    by_episode: bool = False,
) -> float:
    """Return the chance that a leaf with no structure has a split as good as this one.

    After ``stop_after`` draws that reach the observed value the test ends with p = stop_after /
    draws (Besag and Clifford), else p = (1 + reached) / (1 + n_permutations).

    Args:
        sample: The tuples of the leaf.
        split: ``search.best(sample)``.
        search: The search that found the split; the draws repeat it.
        generator: Source of the permutations.
        n_permutations: Most draws; the smallest possible p is 1 / (1 + n_permutations).
        stop_after: Draws reaching the observed value after which the answer is clear.
        by_episode: Permute whole episodes (``sample.episodes`` is needed) instead of tuples.
    """
    check_integer("n_permutations", n_permutations, low=1)
    check_integer("stop_after", stop_after, low=1)
    value = search.value(split)
    groups = [_Group.of(sample, one, search, value, by_episode) for _, one in search.groups(sample)]
    reached = 0
    for draw in range(1, n_permutations + 1):
        # no generator expression: every group must draw, or the stream would depend on the data
        reached += max([group.reaches(generator) for group in groups])
        if reached == stop_after:
            return stop_after / draw
    return (1 + reached) / (1 + n_permutations)


@dataclass(frozen=True, eq=False)
class EpisodeRows:
    """The rows of a sample, one episode after another."""

    rows: Integers  # [n] rows of the sample
    first: Integers  # [E] place in ``rows`` of an episode's first row
    size: Integers  # [E] its rows
    owner: Integers  # [n] the episode of each place
    within: Integers  # [n] the row's number within its episode
    alike: Integers  # [E] episodes with equal numbers are of similar length in the whole sample

    @classmethod
    def of(cls, sample: LeafSample, rows: Integers) -> "EpisodeRows":
        """Return the episodes of some rows of a sample, in order of their numbers."""
        numbers = rows if sample.episodes is None else sample.episodes[rows]
        order = np.argsort(numbers, kind="stable")
        number, first, owner, size = np.unique(
            numbers[order], return_index=True, return_inverse=True, return_counts=True
        )
        lengths = size
        if sample.episodes is not None:
            known, rows_of = np.unique(sample.episodes, return_counts=True)
            lengths = rows_of[np.searchsorted(known, number)]
        within = np.arange(order.size) - first[owner]
        return cls(order, first, size, owner, within, similar(lengths))

    def permuted(self, values: Int32s, generator: np.random.Generator) -> Int32s:
        """Return the values with whole episodes exchanged, stretched and rotated."""
        drawn = generator.permutation(self.size.size)
        sources = np.empty_like(drawn)
        sources[np.argsort(self.alike, kind="stable")] = drawn[
            np.argsort(self.alike[drawn], kind="stable")
        ]
        lengths = self.size[sources]
        length, rotation = lengths[self.owner], generator.integers(lengths)[self.owner]
        stretched = self.within * length // self.size[self.owner]
        taken = self.first[sources][self.owner] + (stretched - rotation) % length
        result = np.empty_like(values)
        result[self.rows] = values[self.rows[taken]]
        return result


def similar(lengths: Integers) -> Integers:
    """Return a number for each length [E]: equal ones where the longest is at most twice as long.

    The shortest begins the first class, the shortest that is too long for it the next.
    """
    known, place = np.unique(lengths, return_inverse=True)
    classes = np.zeros(known.size, dtype=np.int64)
    first = 0
    for k in range(1, known.size):
        new = known[k] > MOST_TIMES * known[first]
        classes[k] = classes[k - 1] + new
        first = k if new else first
    result: Integers = classes[place]
    return result


@dataclass(frozen=True, eq=False)
class _Group:
    """The arrays that all draws of one tested sample share."""

    order: Integers  # [d, n] rows in the order of each attribute
    legal: Booleans  # [d, n] as in _kernels.best_cut
    rank: Int32s  # [n] dense ranks of the returns
    cumulative: Floats  # [m] tuples of each rank or a lower one
    episodes: EpisodeRows | None  # None: permute single rows
    side: int
    distance: bool
    floor: float

    @classmethod
    def of(
        cls,
        sample: LeafSample,
        rows: Integers,
        search: KolmogorovSmirnov,
        value: float,
        by_episode: bool,
    ) -> "_Group":
        returns = search.compared_returns(sample)
        _, rank, counts = np.unique(returns[rows], return_inverse=True, return_counts=True)
        columns = np.ascontiguousarray(sample.observations[rows].T)
        order = np.argsort(columns, axis=1, kind="stable")
        values, legal = np.take_along_axis(columns, order, axis=1), np.zeros(order.shape, np.bool_)
        legal[:, 1:] = values[:, :-1] < values[:, 1:]
        return cls(
            order=order,
            legal=legal,
            rank=rank.astype(np.int32),
            cumulative=np.cumsum(counts).astype(np.float64),
            episodes=EpisodeRows.of(sample, rows) if by_episode else None,
            side=search.min_side(rows.size),
            distance=search.score == "distance",
            floor=search.floor(value, rows.size),
        )

    def reaches(self, generator: np.random.Generator) -> bool:
        """Return whether one permutation of the returns has a cut above the floor."""
        cumulative = self.cumulative
        if self.episodes is None:
            rank = generator.permutation(self.rank)
        else:  # stretched episodes hold some returns twice, others not at all
            rank = self.episodes.permuted(self.rank, generator)
            cumulative = np.cumsum(np.bincount(rank, minlength=cumulative.size)).astype(np.float64)
        limits = self.side, self.distance, self.floor, 0, _kernels.BRUTE
        for order, legal in zip(self.order, self.legal, strict=True):
            cut, _, _ = _kernels.best_cut(rank[order], legal, cumulative, *limits)
            if cut:
                return True
        return False


class _AtLevel(msgspec.Struct, frozen=True):
    """A test at a level.

    Attributes:
        alpha: Level of the test: the chance of a split of noise.
    """

    alpha: float = 0.01

    def __post_init__(self) -> None:
        check_number("alpha", self.alpha, low=0.0, high=1.0, low_open=True)


class Naive(_AtLevel, frozen=True, tag=True):
    """The two-sample test of the cut as if it had been chosen in advance (the paper)."""

    def p_value(
        self, split: Split, sample: LeafSample, search: KolmogorovSmirnov, generator: object
    ) -> float:
        """Return the p-value of the two-sample Kolmogorov-Smirnov test of this cut alone."""
        return naive_p(split.statistic, split.n_left, split.n_right)


class Maximal(_AtLevel, frozen=True, tag=True):
    """The tabulated law of the maximum over cuts, corrected over attributes and actions.

    Conservative under ties: rare events among equal returns are not seen.
    """

    def p_value(
        self, split: Split, sample: LeafSample, search: KolmogorovSmirnov, generator: object
    ) -> float:
        """Return the p-value of the maximum over cuts, after Sidak's correction."""
        n = split.n_left + split.n_right
        single = maximal_p(split.scaled_statistic, n, min_side=search.min_side(n))
        return sidak(single, sample.observations.shape[1] * sum(1 for _ in search.groups(sample)))


class Permutation(_AtLevel, frozen=True, kw_only=True, tag=True):
    """The permutation test, exact under ties; screened by the table, which is cheaper.

    Attributes:
        alpha: Level.
        n_permutations: Most draws.
        stop_after: Draws reaching the observed value after which the test stops.
        min_episodes: Fewest distinct episodes on each side of the cut, if episodes are known.
        by_episode: Permute whole episodes instead of tuples, if episodes are known.
    """

    n_permutations: int = 999
    stop_after: int = 10
    min_episodes: int = 3
    by_episode: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_permutations", self.n_permutations, low=math.ceil(1 / self.alpha) - 1)
        check_amounts(self, stop_after=1, min_episodes=0)

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
