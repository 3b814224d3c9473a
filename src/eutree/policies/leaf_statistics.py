"""What was known of each leaf when a policy was frozen."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats, Integers, frozen


@dataclass(frozen=True, eq=False)
class LeafStatistics:
    """What was known of each leaf when the policy was frozen.

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
        """What a value is, in words; where each leaf has tried one action it is no Q."""
        if self.compares_actions:
            return "a value is the return expected after an action: Q, or the mean of what followed"
        return "a value is the mean return that followed; each leaf tried one action: no Q"

    def __post_init__(self) -> None:
        object.__setattr__(self, "visits", frozen(np.asarray(self.visits, dtype=np.int64)))
        object.__setattr__(self, "values", frozen(np.asarray(self.values, dtype=np.float64)))
        errors = frozen(np.asarray(self.deviations, dtype=np.float64))
        object.__setattr__(self, "deviations", errors)


Labels = NDArray[np.integer[Any]]


def leaf_statistics(
    leaves: Labels,
    actions: Labels,
    returns: Floats,
    *,
    visits: Integers,
    values: Floats,
) -> LeafStatistics:
    """Return what is known of each leaf and action.

    Args:
        leaves: Leaf that each transition left, shape [N].
        actions: Its action, shape [N].
        returns: Its estimate of future reward, shape [N]; the standard error of a value is that of
            the mean of its estimates.
        visits: Transitions of each leaf and action, shape [L, A].
        values: Value of each leaf and action, shape [L, A].
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
    """Return the mean return to go of each leaf and action, over the transitions given.

    Args:
        leaves: Leaf that each transition left, shape [N].
        actions: Its action, shape [N].
        returns: Sum of the rewards from it to the end of its episode, shape [N].
        n_leaves: Number of leaves L.
        n_actions: Number of actions A.
    """
    shape, size = (n_leaves, n_actions), n_leaves * n_actions
    cells = leaves.astype(np.int64) * n_actions + actions  # [N]
    visits = np.bincount(cells, minlength=size)
    values = np.bincount(cells, returns, minlength=size) / np.maximum(visits, 1)
    return leaf_statistics(
        leaves, actions, returns, visits=visits.reshape(shape), values=values.reshape(shape)
    )
