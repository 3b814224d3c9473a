"""Which action a leaf decides for where its own is masked."""

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Integers
from eutree.errors import InvalidArgumentError, shown
from eutree.policies.leaf_statistics import LeafStatistics
from eutree.trees import DecisionTree


def orders_of(
    tree: DecisionTree, actions: Integers, n_actions: int, leaves: LeafStatistics | None
) -> Integers:
    """Return the order in which each leaf prefers the actions, its own first, shape [L, A].

    The others follow by their value in the leaf, then by their visits, where these are known; then
    those that the nearest leaves of the tree have, the more of them the earlier; then by number.

    Args:
        tree: The tree.
        actions: Action of each leaf, shape [L].
        n_actions: Number of actions A.
        leaves: What is known of the leaves.
    """
    counts = np.zeros((tree.n_nodes, n_actions), dtype=np.int64)
    counts[tree.node_of_leaf, actions] = 1
    for node in range(tree.n_nodes - 1, 0, -1):  # children come after their parents
        counts[tree.parent[node]] += counts[node]
    orders = np.empty((tree.n_leaves, n_actions), dtype=np.int64)
    for leaf in range(tree.n_leaves):
        path = np.array(tree.path(leaf)[::-1])
        near = counts[path]  # [depth + 1, A], the leaf first
        level = np.where(near.any(axis=0), (near > 0).argmax(axis=0), len(path))
        of_level = near[np.minimum(level, len(path) - 1), np.arange(n_actions)]
        value = np.full(n_actions, np.nan) if leaves is None else leaves.values[leaf]
        visits = np.zeros(n_actions, np.int64) if leaves is None else leaves.visits[leaf]
        others = np.arange(n_actions) != actions[leaf]
        orders[leaf] = np.lexsort(
            (-of_level, level, -visits, -np.nan_to_num(value), np.isnan(value), others)
        )
    return orders


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
