"""Make a labelled tree smaller without changing what it says of any observation, NaN included."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees.boxes import node_boxes
from eutree.trees.building import TreeBuilder
from eutree.trees.tree import DecisionTree

INNER = -1  # the label of a node that is no leaf


def merge(tree: DecisionTree, labels: Integers) -> tuple[DecisionTree, Integers]:
    """Join sibling leaves of equal label, repeatedly, and drop tests that decide nothing.

    A test decides nothing where the tests above it already tell its answer. Below the left side
    of a test a feature is a number, below the right side alone it may be NaN, which keeps going
    right; so dropping such a test is exact for NaN too.

    Args:
        tree: The tree.
        labels: Label of each leaf, shape [L].

    Returns:
        The smaller tree and the labels of its leaves.
    """
    low, high = node_boxes(tree)
    source = np.arange(tree.n_nodes)  # the node that now stands in a node's place
    label = np.full(tree.n_nodes, INNER, dtype=np.int64)  # of nodes that are leaves now
    label[tree.node_of_leaf] = labels
    for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
        feature = tree.feature[node]
        if feature == tree.NO_FEATURE:
            continue
        left, right = source[tree.left[node]], source[tree.right[node]]
        if tree.threshold[node] >= high[node, feature]:
            source[node] = left
        elif tree.threshold[node] <= low[node, feature]:
            source[node] = right
        elif label[left] != INNER and label[left] == label[right]:
            label[node] = label[left]
    return rebuild(tree, source, label)


def reachable(tree: DecisionTree, low: Floats, high: Floats) -> tuple[DecisionTree, Integers]:
    """Return the tree without the tests that every observation in a box answers alike.

    Args:
        tree: The tree.
        low: Smallest value of each feature, shape [d].
        high: Largest value of each feature, shape [d].

    Returns:
        The smaller tree, and which leaf of ``tree`` each of its leaves is, shape [L].
    """
    source = np.arange(tree.n_nodes)  # the node that now stands in a node's place
    label = np.full(tree.n_nodes, INNER, dtype=np.int64)
    label[tree.node_of_leaf] = np.arange(tree.n_leaves)
    for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
        feature, threshold = tree.feature[node], tree.threshold[node]
        if feature == tree.NO_FEATURE:
            continue
        if threshold >= high[feature]:
            source[node] = source[tree.left[node]]
        elif threshold < low[feature]:
            source[node] = source[tree.right[node]]
    return rebuild(tree, source, label)


def rebuild(tree: DecisionTree, source: Integers, label: Integers) -> tuple[DecisionTree, Integers]:
    """Return the tree of the nodes that still stand, in preorder, and the labels of its leaves.

    Args:
        tree: The tree.
        source: The node that stands in each node's place: itself, or one below it, shape [M].
        label: Label of each node that is a leaf now, ``INNER`` of the others, shape [M].
    """
    built = TreeBuilder(tree.n_features)
    pending = [(int(source[0]), -1, 0)]
    while pending:
        node, parent, side = pending.pop()
        if label[node] != INNER:
            built.leaf(int(label[node]), parent=parent, side=side)
            continue
        feature, threshold = int(tree.feature[node]), float(tree.threshold[node])
        number = built.test(feature, threshold, parent=parent, side=side)
        pending.append((int(source[tree.right[node]]), number, 1))
        pending.append((int(source[tree.left[node]]), number, 0))
    return built.build()
