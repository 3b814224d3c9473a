"""Visits, values and their standard errors, by leaf and action."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats, Integers
from eutree.policies import LeafStatistics

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
