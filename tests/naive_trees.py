"""Slow, obvious twins of what is computed on whole trees."""

import itertools

import numpy as np

from eutree.trees import DecisionTree


def random_tree(generator, n_leaves, n_features, n_values=6):
    """Return a tree with thresholds on a small lattice, redundant and empty tests included."""
    tree = DecisionTree.single_leaf(n_features)
    while tree.n_leaves < n_leaves:
        leaf = int(generator.integers(tree.n_leaves))
        threshold = float(generator.integers(0, n_values))
        tree = tree.split(leaf, int(generator.integers(n_features)), threshold)
    return tree


def cells(low, high):
    """Return the centres of the unit cells of a lattice box."""
    axes = [np.arange(lo, hi) + 0.5 if hi > lo else [lo] for lo, hi in zip(low, high, strict=True)]
    return np.array(list(itertools.product(*axes)), dtype=float)


def disagreement(first, first_labels, second, second_labels, low, high):
    """Return the share of unit cells on which two trees with lattice thresholds disagree."""
    points = cells(low, high)
    one = first_labels[first.leaf_index(points)]
    other = second_labels[second.leaf_index(points)]
    return float((one != other).mean())
