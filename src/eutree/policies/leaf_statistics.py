"""Statistics of each leaf from when a policy was frozen."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Frozen, Integers, freeze
from eutree.errors import InvalidArgumentError, shown
from eutree.trees import DecisionTree


@dataclass(frozen=True, eq=False)
class LeafStatistics(Frozen):
    """Visits, values and errors of each leaf when the policy was frozen.

    Attributes:
        visits: Transitions that left each leaf, per action.
        values: Q(s, a) of the rule that decides, or the mean return to go of the policy's own
            episodes after the action; NaN where the action was never tried.
        deviations: Standard error of each value; NaN where unknown.
    """

    visits: Integers  # [L, A]
    values: Floats  # [L, A]
    deviations: Floats  # [L, A]

    @property
    def compares_actions(self) -> bool:
        """Whether there is a leaf in which the values of two actions are known."""
        return bool((np.isfinite(self.values).sum(axis=1) > 1).any())

    @property
    def meaning(self) -> str:
        """The meaning of a value, in words; where each leaf has tried one action it is no Q."""
        if self.compares_actions:
            return "a value is the return expected after an action: Q, or the mean of what followed"
        return "a value is the mean return that followed; each leaf tried one action: no Q"

    def of(self, leaves: Integers) -> "LeafStatistics":
        """Return those of some leaves, [K]; of a negative number nothing is known."""
        known = leaves[:, np.newaxis] >= 0
        values, deviations = (np.where(known, one[leaves], np.nan)
                              for one in (self.values, self.deviations))  # fmt: skip
        return LeafStatistics(np.where(known, self.visits[leaves], 0), values, deviations)

    def __post_init__(self) -> None:
        freeze(self, "visits", dtype=np.int64)
        freeze(self, "values", "deviations", dtype=np.float64)


Labels = NDArray[np.integer[Any]]


def leaf_statistics(
    leaves: Labels, actions: Labels, returns: Floats, *, visits: Integers, values: Floats
) -> LeafStatistics:
    """Return the statistics of each leaf and action, with their visits and values, shape [L, A].

    They are of transitions: the leaf that each of them left, its action, and its estimate of future
    reward, shape [N]. The standard error of a value is that of the mean of its estimates.
    """
    n_actions = visits.shape[1]
    cells = leaves.astype(np.int64) * n_actions + actions  # [N]
    counts = np.bincount(cells, minlength=visits.size)
    several = np.maximum(counts, 2)
    means = np.bincount(cells, returns, minlength=visits.size) / several
    squares = np.bincount(cells, (returns - means[cells]) ** 2, minlength=visits.size)
    errors = np.sqrt(squares / (several - 1) / several)
    errors = np.where(counts > 1, errors, np.nan).reshape(visits.shape)
    return LeafStatistics(visits, np.where(visits > 0, values, np.nan), errors)


def returns_by_action(
    leaves: Labels, actions: Labels, returns: Floats, *, n_leaves: int, n_actions: int
) -> LeafStatistics:
    """Return the mean return to go of each leaf and action, over N transitions.

    Of each transition are given the leaf that it left, its action, and the sum of the rewards from
    it to the end of its episode.
    """
    shape, size = (n_leaves, n_actions), n_leaves * n_actions
    cells = leaves.astype(np.int64) * n_actions + actions  # [N]
    visits = np.bincount(cells, minlength=size)
    values = np.bincount(cells, returns, minlength=size) / np.maximum(visits, 1)
    return leaf_statistics(
        leaves, actions, returns, visits=visits.reshape(shape), values=values.reshape(shape)
    )


def orders_of(
    tree: DecisionTree, own: Integers, leaves: LeafStatistics | None, ranks: Integers | None
) -> Integers:
    """Return the order in which each leaf prefers the actions, its own first, shape [L, A].

    ``own`` is 1 for the action of each leaf, [L, A]. The others follow by their ranks, [L, A], by
    their value in the leaf, then by their visits, where these are known; then those that the
    nearest leaves of the tree have, the more of them the earlier; then by number.
    """
    counts = tree.totals(own)  # leaves of each action
    level, of_level = np.empty((2, *own.shape), dtype=np.int64)
    for leaf in range(tree.n_leaves):
        near = counts[list(tree.path(leaf)[::-1])]  # [depth + 1, A], the leaf first
        level[leaf] = (near == 0).sum(axis=0)  # they never fall on the way up
        of_level[leaf] = near[np.minimum(level[leaf], len(near) - 1), np.arange(own.shape[1])]
    keys = [-of_level, level]
    if leaves is not None:
        keys += [-leaves.visits, -np.nan_to_num(leaves.values), np.isnan(leaves.values)]
    return np.lexsort([*keys, *([] if ranks is None else [ranks]), -own])


def check_masks(masks: ArrayLike, shape: tuple[int, ...]) -> Booleans:
    """Return masks of actions, [A] or [E, A], as truth values.

    Raises:
        InvalidArgumentError: They have another shape, or one allows no action.
    """
    array = np.asarray(masks)
    if array.shape != shape or not (array.dtype == bool or np.isin(array, (0, 1)).all()):
        raise InvalidArgumentError(
            f"action_masks must be truth values of shape {shape}, got {shown(masks)}"
        )
    allowed: Booleans = array.astype(bool)
    if not allowed.any(axis=-1).all():
        raise InvalidArgumentError("action_masks must allow at least one action, got none")
    return allowed
