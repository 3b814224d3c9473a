"""The exact best Kolmogorov-Smirnov split of a leaf over all attributes and all cuts.

A cut is legal between two neighbours of the sorted attribute that differ, with a minimum number of
tested tuples on each side. Among equal scores the lowest action, then the lowest attribute, then
the first cut wins. A leaf whose returns no legal cut tells apart (D = 0 everywhere) has no split.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.features import threshold_between
from eutree.splitting import _kernels
from eutree.splitting.laws import critical_value
from eutree.validation import (
    check_actions,
    check_choice,
    check_integer,
    check_number,
    check_observations,
    check_vector,
)


@dataclass(frozen=True, slots=True)
class LeafSample:
    """The tuples of one leaf, as clean arrays of equal length.

    Attributes:
        observations: Attributes of each tuple, C-ordered and finite.
        returns: q of each tuple (Eq. 2), finite.
        actions: Action of each tuple.
        episodes: Episode of each tuple, or None if it is not known.
    """

    observations: Floats  # [N, d]
    returns: Floats  # [N]
    actions: Integers  # [N]
    episodes: Integers | None = None  # [N]


@dataclass(frozen=True, slots=True)
class Split:
    """The best cut that a search found: ``x[feature] <= threshold`` goes left.

    Attributes:
        feature: Attribute that is cut.
        threshold: A number t with left value <= t < right value for the two neighbours of the cut.
        statistic: D, the two-sample Kolmogorov-Smirnov distance of the returns on both sides.
        scaled_statistic: K = D * sqrt(n_left * n_right / (n_left + n_right)).
        n_left: Tuples of the tested sample on the left side.
        n_right: Tuples of the tested sample on the right side.
        action: Action whose tuples are the tested sample; None if all tuples of the leaf are.
    """

    feature: int
    threshold: float
    statistic: float
    scaled_statistic: float
    n_left: int
    n_right: int
    action: int | None = None


Score = Literal["scaled", "distance", "calibrated"]
Compare = Literal["action", "pooled", "centred"]
CALIBRATION_LEVEL = 0.01
_BELOW = 1.0 - 1e-12  # more than the rounding of the conversions between scores


@dataclass(frozen=True, slots=True, kw_only=True)
class KolmogorovSmirnov:
    """The search of a learner: which cuts count, and how they are compared.

    Attributes:
        score: ``"scaled"`` maximises K; ``"distance"`` maximises D (the paper, read literally);
            ``"calibrated"`` maximises K / c(n_a), where c(n) is the 1 % point of the largest K on
            noise and n_a the number of tuples of the action. It differs from ``"scaled"`` only
            between actions, whose K are not comparable if they have different sizes.
        compare: Which returns are compared across a cut: those of one ``"action"`` at a time, the
            best action counting; those of all actions ``"pooled"`` (the paper); or pooled after
            subtracting the mean of each action, ``"centred"``.
        min_leaf: Fewest tested tuples on each side of a cut.
        min_share: Smallest share of the tested tuples on each side of a cut.
    """

    score: Score = "calibrated"
    compare: Compare = "action"
    min_leaf: int = 10
    min_share: float = 0.0

    def __post_init__(self) -> None:
        check_choice("score", self.score, get_args(Score))
        check_choice("compare", self.compare, get_args(Compare))
        check_integer("min_leaf", self.min_leaf, low=1)
        check_number("min_share", self.min_share, low=0.0, high=0.5)

    def min_side(self, n: int) -> int:
        """Return the fewest tuples on each side of a cut of ``n`` tested tuples."""
        return max(self.min_leaf, math.ceil(self.min_share * n))

    def best(self, sample: LeafSample) -> Split | None:
        """Return the best split of the leaf, or None if no legal cut tells its returns apart."""
        best: Split | None = None
        # read-only or strided arrays would be compiled for again, at a cost of many seconds
        observations = np.require(sample.observations, np.float64, ["C", "W"])
        returns = np.require(self.compared_returns(sample), np.float64, ["C", "W"])
        for action, rows in self.groups(sample):
            n, side, distance = rows.size, self.min_side(rows.size), self.score == "distance"
            floor = self.floor(self.value(best), n) if best else 0.0
            feature, cut, weight, _, left, right = _kernels.best_of_sample(
                observations, returns, rows, side, distance, floor, 0, _kernels.BRUTE
            )
            if feature < 0:
                continue
            statistic = weight / (cut * (n - cut))
            split = Split(
                feature=feature,
                threshold=threshold_between(left, right),
                statistic=statistic,
                scaled_statistic=statistic * math.sqrt(cut * (n - cut) / n),
                n_left=cut,
                n_right=n - cut,
                action=action,
            )
            if best is None or self.value(split) > self.value(best):
                best = split
        return best

    def compared_returns(self, sample: LeafSample) -> Floats:
        """Return q of each tuple, minus the mean of its action if returns are ``"centred"``."""
        if self.compare != "centred":
            return sample.returns
        _, group = np.unique(sample.actions, return_inverse=True)
        means = np.bincount(group, weights=sample.returns) / np.bincount(group)
        result: Floats = sample.returns - means[group]
        return result

    def groups(self, sample: LeafSample) -> Iterator[tuple[int | None, Integers]]:
        """Yield (action, rows) of each sample that is tested by itself and large enough to cut."""
        everything = np.arange(sample.returns.size, dtype=np.int64)
        if self.compare != "action":
            if everything.size >= 2 * self.min_side(everything.size):
                yield None, everything
            return
        if everything.size == 0:
            return
        order = np.argsort(sample.actions, kind="stable")
        taken = sample.actions[order]
        begins = [0, *(np.flatnonzero(taken[1:] != taken[:-1]) + 1).tolist(), taken.size]
        for begin, end in pairwise(begins):
            action, rows = taken[begin], order[begin:end]
            if rows.size >= 2 * self.min_side(rows.size):
                yield int(action), rows

    def value(self, split: Split) -> float:
        """Return the number that ``best`` maximises: K, D or K / c(n), according to ``score``."""
        if self.score == "distance":
            return split.statistic
        return split.scaled_statistic / self.unit(split.n_left + split.n_right)

    def unit(self, n: int) -> float:
        """Return the divisor of K for a sample of ``n`` tuples: c(n) if calibrated, else 1."""
        if self.score != "calibrated":
            return 1.0
        return critical_value(n, CALIBRATION_LEVEL, min_side=self.min_side(n))

    def floor(self, value: float, n: int) -> float:
        """Return a kernel's score of ``n`` tuples just below ``value``; it is never above it."""
        if self.score == "distance":
            return value * _BELOW
        return (value * self.unit(n)) ** 2 * n * _BELOW


def best_split(
    observations: ArrayLike,
    returns: ArrayLike,
    *,
    actions: ArrayLike | None = None,
    min_leaf: int = 10,
    score: Score = "scaled",
) -> Split | None:
    """Find the cut across which the distributions of the returns differ most.

    Args:
        observations: Attributes of the tuples, shape [N, d], finite.
        returns: q of the tuples, shape [N], finite.
        actions: Action of each tuple, shape [N]. If given, returns are compared within each action
            and the action with the largest score counts; its tuples are the tested sample.
        min_leaf: Fewest tested tuples on each side of a cut.
        score: ``"scaled"`` maximises K = D * sqrt(i * (n - i) / n), which is the lowest p of a
            fixed cut; ``"distance"`` maximises D itself; ``"calibrated"`` maximises K over its
            1 % point on noise, which is fairer to actions of different sizes.

    Returns:
        The best split, or None if no legal cut tells the returns apart.

    >>> split = best_split([[1.0], [2.0], [3.0], [4.0]], [0.0, 0.0, 5.0, 5.0], min_leaf=1)
    >>> split.feature, split.threshold, split.statistic
    (0, 2.5, 1.0)
    """
    x = check_observations("observations", observations)
    q = check_vector("returns", returns, size=x.shape[0])
    if x.shape[1] == 0:
        raise InvalidArgumentError("observations must have at least one column, got shape (N, 0)")
    compare: Compare = "pooled" if actions is None else "action"
    taken = np.zeros(q.size, np.int64) if actions is None else actions
    if q.size > _kernels.LARGEST:
        raise InvalidArgumentError(
            f"returns must have at most {_kernels.LARGEST} entries, got {q.size}"
        )
    sample = LeafSample(x, q, check_actions("actions", taken, size=q.size))
    return KolmogorovSmirnov(score=score, compare=compare, min_leaf=min_leaf).best(sample)
