"""Leaves as boxes: which observations reach a leaf, and how much two trees disagree.

A node is reached by the observations with ``low < x <= high`` in every feature. NaN is outside
every box.
"""

from collections.abc import Iterator

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.trees import _kernels
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
            _kernels.LabelledNodes(second.nodes, np.asarray(second_labels, dtype=np.int64)),
            np.where(counts, high - low, 1.0),
            counts,
        )
    )
