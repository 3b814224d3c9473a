"""Which observations the kinds of features allow, and which nodes of a tree these can reach.

Of a feature of whole values a box holds the whole numbers: ``possible`` moves its bounds to them,
(0.5, 2.5] becomes (0, 2], so that a side is as long as the numbers in it are many. Of the features
of a one-hot group exactly one is 1.
"""

from collections.abc import Sequence

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.schema import Schema
from eutree.trees.boxes import node_boxes
from eutree.trees.tree import DecisionTree


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
    exactly one feature is 1. The bounds of quantities and integers are not asked: what comes may
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
    kinds = [feature.is_integer for feature in features]
    return np.asarray((low < high)[:, kinds].all(axis=1))
