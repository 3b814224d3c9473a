"""Build a labelled tree node by node: what all that edits decision trees has in common."""

import numpy as np

from eutree.arrays import Integers
from eutree.trees.tree import DecisionTree


class TreeBuilder:
    """A labelled tree that grows, parents first; leaves are numbered in the order they come in.

    Args:
        n_features: Number of features of an observation.
    """

    def __init__(self, n_features: int) -> None:
        self._n_features = n_features
        self._feature: list[int] = []
        self._threshold: list[float] = []
        self._children: list[list[int]] = []
        self._leaf: list[int] = []
        self._labels: list[int] = []

    def test(self, feature: int, threshold: float, *, parent: int, side: int) -> int:
        """Append a test; return the number of its node.

        Args:
            feature: Attribute tested.
            threshold: Threshold of the test.
            parent: Node that it is a child of; negative for the root.
            side: 0 for the left child, 1 for the right one.
        """
        return self._add(feature, threshold, DecisionTree.NO_LEAF, parent, side)

    def leaf(self, label: int, *, parent: int, side: int) -> int:
        """Append a leaf; return its number among the leaves."""
        self._labels.append(label)
        number = len(self._labels) - 1
        self._add(DecisionTree.NO_FEATURE, np.nan, number, parent, side)
        return number

    def build(self) -> tuple[DecisionTree, Integers]:
        """Return the tree, which must be whole, and the labels of its leaves, shape [L]."""
        links = np.array(self._children, dtype=np.int32)
        tree = DecisionTree(
            n_features=self._n_features,
            feature=np.array(self._feature, dtype=np.int32),
            threshold=np.array(self._threshold),
            left=links[:, 0],
            right=links[:, 1],
            leaf=np.array(self._leaf, dtype=np.int32),
        )
        return tree, np.array(self._labels, dtype=np.int64)

    def _add(self, feature: int, threshold: float, leaf: int, parent: int, side: int) -> int:
        number = len(self._feature)
        self._feature.append(feature)
        self._threshold.append(threshold)
        self._children.append([DecisionTree.NO_NODE, DecisionTree.NO_NODE])
        self._leaf.append(leaf)
        if parent >= 0:
            self._children[parent][side] = number
        return number
