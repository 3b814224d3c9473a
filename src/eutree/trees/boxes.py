"""Leaves as boxes: which observations reach a leaf, and on which two trees disagree.

A node is reached by the observations with ``low < x <= high`` in every feature. NaN is outside
every box.
"""

from collections.abc import Iterator

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.trees.tree import DecisionTree

_BOXES_AT_ONCE = 4096


def node_boxes(tree: DecisionTree) -> tuple[Floats, Floats]:
    """Return exclusive lower and inclusive upper bounds of each node, each of shape [M, d]."""
    low = np.full((tree.n_nodes, tree.n_features), -np.inf)
    high = np.full((tree.n_nodes, tree.n_features), np.inf)
    level = np.zeros(1, dtype=np.intp)  # the nodes of one depth, whose boxes are known
    while (level := level[tree.feature[level] != tree.NO_FEATURE]).size:
        feature, threshold = tree.feature[level], tree.threshold[level]
        left, right = tree.left[level], tree.right[level]
        for child in (left, right):
            low[child], high[child] = low[level], high[level]
        high[left, feature] = np.minimum(high[level, feature], threshold)
        low[right, feature] = np.maximum(low[level, feature], threshold)
        level = np.concatenate([left, right])
    return low, high


def leaf_boxes(tree: DecisionTree) -> tuple[Floats, Floats]:
    """Return exclusive lower and inclusive upper bounds of each leaf, each of shape [L, d].

    A leaf that no observation reaches has ``low >= high`` in some feature.
    """
    low, high = node_boxes(tree)
    return low[tree.node_of_leaf], high[tree.node_of_leaf]


def meetings(low: Floats, high: Floats, tree: DecisionTree) -> Iterator[tuple[Integers, Integers]]:
    """Yield which of some boxes meet which leaves, as numbers of boxes and of leaves.

    The boxes go down the tree together, to both sides of a test where it cuts them: so the work
    grows with the pairs that meet and with the depth, not with boxes times leaves.

    Args:
        low: Exclusive lower bounds, shape [B, d].
        high: Inclusive upper bounds, shape [B, d].
        tree: The tree.

    Yields:
        Pairs, by box and then by leaf; of at most ``_BOXES_AT_ONCE`` boxes at a time.
    """
    node_low, node_high = node_boxes(tree)
    is_reached: Booleans = np.all(node_low < node_high, axis=1)
    full = np.flatnonzero((low < high).all(axis=1))
    for start in range(0, full.size, _BOXES_AT_ONCE):
        box = full[start : start + _BOXES_AT_ONCE]
        node = np.zeros(box.size, dtype=np.intp)
        found: list[tuple[Integers, Integers]] = []
        while box.size:  # every box meets the box of its node
            ends = tree.feature[node] == tree.NO_FEATURE
            found.append((box[ends], tree.leaf[node[ends]]))
            box, node = box[~ends], node[~ends]
            feature, threshold = tree.feature[node], tree.threshold[node]
            goes_left = (low[box, feature] < threshold) & is_reached[tree.left[node]]
            goes_right = (high[box, feature] > threshold) & is_reached[tree.right[node]]
            node = np.concatenate([tree.left[node[goes_left]], tree.right[node[goes_right]]])
            box = np.concatenate([box[goes_left], box[goes_right]])
        boxes, leaves = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.lexsort((leaves, boxes))
        yield boxes[order], leaves[order]


def differing(
    first: DecisionTree,
    first_labels: Integers,  # [L]
    second: DecisionTree,
    second_labels: Integers,  # [L']
    low: Floats | float = -np.inf,  # [d]
    high: Floats | float = np.inf,  # [d]
) -> tuple[Floats, Floats, Integers]:
    """Return the boxes, within another, on which the labels of two trees differ.

    They are the intersections of leaves of both, apart from each other.

    Returns:
        Exclusive lower and inclusive upper bounds, each of shape [P, d], and both labels, [P, 2].

    Raises:
        InvalidArgumentError: The trees have other numbers of features.
    """
    if first.n_features != second.n_features:
        raise InvalidArgumentError(
            f"both trees must have {first.n_features} features, got {second.n_features}"
        )
    own_low, own_high = leaf_boxes(first)
    own_low, own_high = np.maximum(own_low, low), np.minimum(own_high, high)
    other_low, other_high = leaf_boxes(second)
    pairs = [np.empty((2, 0), dtype=np.intp)]  # no leaf may be within the box
    for one, two in meetings(own_low, own_high, second):
        pairs.append(np.stack([one, two])[:, first_labels[one] != second_labels[two]])
    one, two = np.concatenate(pairs, axis=1)
    labels = np.stack([first_labels[one], second_labels[two]], axis=1)
    lows = np.maximum(own_low[one], other_low[two])
    return lows, np.minimum(own_high[one], other_high[two]), labels
