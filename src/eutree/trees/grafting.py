"""Put one labelled tree in the place of another, but for some of its leaves."""

from collections.abc import Mapping

import numpy as np

from eutree.arrays import Integers
from eutree.trees.tree import DecisionTree


class _Builder:
    """A labelled tree that grows node by node, parents first."""

    def __init__(self) -> None:
        self.feature: list[int] = []
        self.threshold: list[float] = []
        self.children: list[list[int]] = []
        self.leaf: list[int] = []
        self.labels: list[int] = []

    def add(self, feature: int, threshold: float, label: int) -> int:
        """Append a test, or a leaf if ``feature`` is none; return the number of the node."""
        is_leaf = feature == DecisionTree.NO_FEATURE
        self.feature.append(feature)
        self.threshold.append(threshold)
        self.children.append([DecisionTree.NO_NODE, DecisionTree.NO_NODE])
        self.leaf.append(len(self.labels) if is_leaf else DecisionTree.NO_LEAF)
        if is_leaf:
            self.labels.append(label)
        return len(self.feature) - 1


def graft(
    stock: DecisionTree, kept: Mapping[int, int], scion: DecisionTree, labels: Integers
) -> tuple[DecisionTree, Integers, frozenset[int]]:
    """Return a tree that decides by ``stock`` in some of its leaves and by ``scion`` elsewhere.

    Tests of the stock with no kept leaf below them are gone, and so are tests of the scion that
    the tests above them answer already; each kept leaf has the box that it had.

    Args:
        stock: The tree with the leaves to keep.
        kept: Label of each leaf to keep.
        scion: The other tree.
        labels: Label of each of its leaves, shape [L].

    Returns:
        The tree, the labels of its leaves, and which of them are the kept ones.
    """
    holds = np.zeros(stock.n_nodes, dtype=bool)  # whether a kept leaf is below
    holds[stock.node_of_leaf[list(kept)]] = True
    for node in range(stock.n_nodes - 1, 0, -1):
        holds[stock.parent[node]] |= holds[node]
    built, marked = _Builder(), []
    nowhere = (-1, 0)
    everywhere = np.full(stock.n_features, -np.inf), np.full(stock.n_features, np.inf)
    work = [(stock, 0, everywhere, nowhere)]
    while work:
        tree, node, (low, high), (parent, side) = work.pop()
        if tree is stock and not holds[node]:
            tree, node = scion, 0
        feature, cut = int(tree.feature[node]), float(tree.threshold[node])
        if feature != tree.NO_FEATURE and cut >= high[feature]:
            work.append((tree, int(tree.left[node]), (low, high), (parent, side)))
            continue
        if feature != tree.NO_FEATURE and cut <= low[feature]:
            work.append((tree, int(tree.right[node]), (low, high), (parent, side)))
            continue
        leaf = int(tree.leaf[node])
        label = -1
        if feature == tree.NO_FEATURE:
            label = kept[leaf] if tree is stock else int(labels[leaf])
        number = built.add(feature, cut, label)
        if feature == tree.NO_FEATURE and tree is stock:
            marked.append(built.leaf[number])
        if parent >= 0:
            built.children[parent][side] = number
        if feature != tree.NO_FEATURE:
            below, above = high.copy(), low.copy()
            below[feature] = above[feature] = cut
            work.append((tree, int(tree.right[node]), (above, high), (number, 1)))
            work.append((tree, int(tree.left[node]), (low, below), (number, 0)))
    links = np.array(built.children, dtype=np.int32)
    grafted = DecisionTree(
        n_features=stock.n_features,
        feature=np.array(built.feature, dtype=np.int32),
        threshold=np.array(built.threshold),
        left=links[:, 0],
        right=links[:, 1],
        leaf=np.array(built.leaf, dtype=np.int32),
    )
    return grafted, np.array(built.labels, dtype=np.int64), frozenset(marked)
