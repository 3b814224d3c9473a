"""Leaves as boxes: which observations reach a leaf, and on which two trees disagree.

A node is reached by the observations with ``low < x <= high`` in every feature. NaN is outside
every box.

The kinds of features allow fewer observations. Of a feature of whole values a box holds the whole
numbers: ``possible`` moves its bounds to them, (0.5, 2.5] becomes (0, 2], so that a side is as long
as the numbers in it are many. Of the features of a one-hot group exactly one is 1.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.schema import Schema
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
    grows with the pairs that meet and with the depth, not with boxes times leaves. The lower bounds
    are exclusive, the upper inclusive, shape [B, d]. The pairs are ordered by box and then by leaf;
    of at most ``_BOXES_AT_ONCE`` boxes at a time.
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

    They are the intersections of leaves of both, apart from each other: exclusive lower and
    inclusive upper bounds, each of shape [P, d], and both labels, shape [P, 2].

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


def possible(low: Floats, high: Floats, schema: Schema) -> tuple[Floats, Floats]:
    """Return the parts of some boxes [..., d] that hold observations of a schema.

    Bounds of whole values are whole; of a group the categories that are left out have an upper
    bound of 0, and the only one that is left a lower one of 0. A box without any is empty there.
    """
    whole_ones = [feature.is_integer for feature in schema.features]
    low, high = (np.where(whole_ones, np.floor(bound), bound) for bound in (low, high))
    for group in map(list, schema.groups.values()):
        left = left_of_group(low, high, group)
        high[..., group] = np.where(left, np.minimum(high[..., group], 1.0), 0.0)
        only = left.sum(axis=-1, keepdims=True) <= 1
        low[..., group] = np.where(only & (left | ~left.any(axis=-1, keepdims=True)), 0.0, -1.0)
    return low, high


def left_of_group(low: Floats, high: Floats, group: Sequence[int]) -> Booleans:
    """Return which categories of a group some boxes [..., d] leave, shape [..., k]."""
    low, high = low[..., list(group)], high[..., list(group)]
    fixed = (low >= 0.0) | (high < 0.0)  # cannot be 0
    of_others = fixed.sum(axis=-1, keepdims=True) - fixed
    left: Booleans = (low < 1.0) & (high >= 1.0) & (of_others == 0)
    return left


def possible_nodes(tree: DecisionTree, schema: Schema) -> Booleans:
    """Return which nodes some observation of a schema reaches, by the kinds alone, shape [M].

    A flag is 0 or 1, a category is one of its codes, an integer is whole, of a one-hot group
    exactly one feature is 1. The bounds of quantities and integers are not asked: observations may
    lie beyond them.
    """
    features = schema.features
    if not any(feature.is_integer for feature in features):
        return np.ones(tree.n_nodes, dtype=np.bool_)
    low, high = node_boxes(tree)
    for j, feature in enumerate(features):
        if feature.is_flag or feature.categories:
            low[:, j] = np.maximum(low[:, j], feature.low - 1.0)
            high[:, j] = np.minimum(high[:, j], feature.high)
    low, high = possible(low, high, schema)
    return np.asarray((low < high)[:, [feature.is_integer for feature in features]].all(axis=1))


def whole_bounds(low: Floats, high: Floats, schema: Schema) -> tuple[Floats, Floats]:
    """Return closed bounds [d] of which those of whole values are as ``possible`` has them."""
    whole_ones = [feature.is_integer for feature in schema.features]
    return np.where(whole_ones, np.ceil(low) - 1.0, low), np.where(whole_ones, np.floor(high), high)


def volumes(low: Floats, high: Floats, box_low: Floats, box_high: Floats, schema: Schema) -> Floats:
    """Return the share of the closed box that each of some possible boxes [..., d] takes.

    A feature of which the closed box has one value only is no dimension of it: there a box takes
    all or nothing. Whole numbers and categories are counted.
    """
    flat = box_high <= box_low
    with np.errstate(over="ignore"):
        scale = np.where(np.isinf(box_high - box_low), 0.25, 1.0)  # else a width were infinite
    low, high, box_low, box_high = (ends * scale for ends in (low, high, box_low, box_high))
    width = np.where(flat, 1.0, box_high - box_low)
    inside = np.clip(high, box_low, box_high) - np.clip(low, box_low, box_high)
    sides = np.clip(inside, 0.0, None) / width
    sides = np.where(flat, (low < box_low) & (box_low <= high), sides)
    for group in map(list, schema.groups.values()):
        of_all = box_high[group] >= 1.0
        left = left_of_group(low, high, group) & of_all
        sides[..., group] = 1.0
        sides[..., group[0]] = left.sum(axis=-1) / max(int(of_all.sum()), 1)
    product: Floats = sides.prod(axis=-1)
    return product


def disagreement(
    first: DecisionTree,
    first_labels: Integers,  # [L]
    second: DecisionTree,
    second_labels: Integers,  # [L']
    box: tuple[Floats, Floats],  # [d] each
    schema: Schema,
) -> float:
    """Return the exact share of the possible points in a closed box on which two trees disagree.

    A feature of which the box has one value only does not count as a dimension of it.

    Raises:
        InvalidArgumentError: The trees have other numbers of features, or the box has no end.
    """
    if not (np.isfinite(box).all() and (box[0] <= box[1]).all()):
        raise InvalidArgumentError(f"the box must be finite, got {box[0]} to {box[1]}")
    low, high, _ = differing(first, first_labels, second, second_labels)
    return float(volumes(*possible(low, high, schema), *whole_bounds(*box, schema), schema).sum())
