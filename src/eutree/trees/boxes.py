"""Leaves as boxes: which observations reach a leaf, and how much two trees disagree.

A node is reached by the observations with ``low < x <= high`` in every feature. NaN is outside
every box.
"""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.trees import _kernels
from eutree.trees.tree import DecisionTree


def node_boxes(tree: DecisionTree) -> tuple[Floats, Floats]:
    """Return exclusive lower and inclusive upper bounds of each node, each of shape [M, d]."""
    low = np.full((tree.n_nodes, tree.n_features), -np.inf)
    high = np.full((tree.n_nodes, tree.n_features), np.inf)
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE):
        feature, threshold = tree.feature[node], tree.threshold[node]
        left, right = tree.left[node], tree.right[node]
        low[[left, right]], high[[left, right]] = low[node], high[node]
        high[left, feature] = min(high[node, feature], threshold)
        low[right, feature] = max(low[node, feature], threshold)
    return low, high


def leaf_boxes(tree: DecisionTree) -> tuple[Floats, Floats]:
    """Return exclusive lower and inclusive upper bounds of each leaf, each of shape [L, d].

    A leaf that no observation reaches has ``low >= high`` in some feature.
    """
    low, high = node_boxes(tree)
    return low[tree.node_of_leaf], high[tree.node_of_leaf]


def disagreement(
    first: DecisionTree,
    first_labels: Integers,  # [L]
    second: DecisionTree,
    second_labels: Integers,  # [L']
    low: Floats,  # [d]
    high: Floats,  # [d]
) -> float:
    """Return the exact share of the box ``low..high`` on which two labelled trees disagree.

    Each leaf box of the first tree is carried down the second tree, clipped on the way; the
    volumes of the pieces whose labels differ are summed. A feature with ``low == high`` does not
    count as a dimension of the box.
    """
    if first.n_features != second.n_features:
        raise InvalidArgumentError(
            f"both trees must have {first.n_features} features, got {second.n_features}"
        )
    if not (np.isfinite(low).all() and np.isfinite(high).all() and (low <= high).all()):
        raise InvalidArgumentError(f"the box must be finite, got {low} to {high}")
    leaf_low, leaf_high = leaf_boxes(first)
    counts = high > low
    # A point is inside its leaf only if it is above the exclusive bound, so that bound stays.
    clipped = np.where(counts, np.maximum(leaf_low, low), leaf_low)
    return float(
        _kernels.disagreeing_volume(
            clipped,
            np.where(high <= leaf_high, high, np.where(counts, leaf_high, -np.inf)),
            np.asarray(first_labels, dtype=np.int64),
            second.feature,
            second.threshold,
            second.left,
            second.right,
            second.leaf,
            np.asarray(second_labels, dtype=np.int64),
            np.where(counts, high - low, 1.0),
            counts,
        )
    )
