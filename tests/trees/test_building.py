"""The builder of labelled trees: nodes in the order they come in, leaves numbered by themselves."""

import numpy as np

from eutree.trees.edit import TreeBuilder


def test_a_tree_is_built_parents_first() -> None:
    built = TreeBuilder(2)
    root = built.test(1, 0.5, parent=-1, side=0)
    assert built.leaf(7, parent=root, side=0) == 0
    right = built.test(0, 0.25, parent=root, side=1)
    assert built.leaf(8, parent=right, side=1) == 1
    assert built.leaf(9, parent=right, side=0) == 2
    tree, labels = built.build()
    points = np.array([[0.0, 0.5], [0.25, 0.6], [0.26, 0.6]])
    assert labels[tree.leaf_index(points)].tolist() == [7, 9, 8]
    assert tree.n_leaves == 3


def test_a_single_leaf_is_a_tree() -> None:
    built = TreeBuilder(1)
    built.leaf(4, parent=-1, side=0)
    tree, labels = built.build()
    assert (tree.n_nodes, labels.tolist()) == (1, [4])
