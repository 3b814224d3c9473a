"""Build a labelled tree node by node: the base of all that edits decision trees."""

from collections.abc import Iterable, Mapping

import numpy as np

from eutree.arrays import Booleans, Integers
from eutree.trees.boxes import node_boxes
from eutree.trees.tree import DecisionTree


class TreeBuilder:
    """A labelled tree that grows, parents first; leaves are numbered in the order they come in."""

    def __init__(self, n_features: int) -> None:
        self._n_features = n_features
        self._nodes: list[list[float]] = []  # feature, threshold, left, right, leaf of each
        self._labels: list[int] = []

    def test(self, feature: int, threshold: float, *, parent: int, side: int) -> int:
        """Append a test; return the number of its node.

        ``parent`` is negative for the root; ``side`` is 0 for its left child, 1 for the right one.
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
        tree = DecisionTree(self._n_features, *np.array(self._nodes).T)
        return tree, np.array(self._labels, dtype=np.int64)

    def _add(self, feature: int, threshold: float, leaf: int, parent: int, side: int) -> int:
        number = len(self._nodes)
        self._nodes.append([feature, threshold, DecisionTree.NO_NODE, DecisionTree.NO_NODE, leaf])
        if parent >= 0:
            self._nodes[parent][2 + side] = number
        return number


INNER = -1  # the label of a node that is no leaf


def merge(tree: DecisionTree, labels: Integers) -> tuple[DecisionTree, Integers]:
    """Join sibling leaves of equal label, repeatedly, and drop tests that decide nothing.

    A test decides nothing where the tests above it already tell its answer. Below the left side
    of a test a feature is a number, below the right side alone it may be NaN, which keeps going
    right; so dropping such a test is exact for NaN too. The labels are those of the leaves, [L].
    """
    at = np.arange(tree.n_nodes), tree.feature
    low, high = (bound[at] for bound in node_boxes(tree))  # [M] of the feature that is tested
    return _without(tree, labels, tree.threshold >= high, tree.threshold <= low)


def reachable(tree: DecisionTree, reached: Booleans) -> tuple[DecisionTree, Integers]:
    """Return the tree without the tests that have a child which is not reached, of its nodes [M].

    With it goes which leaf of ``tree`` each of its leaves is, shape [L].
    """
    return _without(tree, np.arange(tree.n_leaves), ~reached[tree.right], ~reached[tree.left])


def _without(
    tree: DecisionTree,
    labels: Integers,  # [L]
    only_left: Booleans,  # [M], not read at leaves
    only_right: Booleans,  # [M], not read at leaves
) -> tuple[DecisionTree, Integers]:
    """Return a tree without tests of one answer, sibling leaves of equal label joined."""
    source = np.arange(tree.n_nodes)  # the node that now stands in a node's place
    label = np.full(tree.n_nodes, INNER, dtype=np.int64)  # of nodes that are leaves now
    label[tree.node_of_leaf] = labels
    for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
        if tree.feature[node] == tree.NO_FEATURE:
            continue
        left, right = source[tree.left[node]], source[tree.right[node]]
        if only_left[node]:
            source[node] = left
        elif only_right[node]:
            source[node] = right
        elif label[left] != INNER and label[left] == label[right]:
            label[node] = label[left]
    return rebuild(tree, source, label)


def holding(tree: DecisionTree, leaves: Iterable[int]) -> Booleans:
    """Return which nodes have one of some leaves below them or are one, shape [M]."""
    return tree.totals(np.isin(np.arange(tree.n_leaves), list(leaves)))


def rebuild(tree: DecisionTree, source: Integers, label: Integers) -> tuple[DecisionTree, Integers]:
    """Return the tree of the nodes that still stand, in preorder, and the labels of its leaves.

    ``source`` [M] is the node that stands in each node's place: itself, or one below it; ``label``
    [M] is that of a node that is a leaf now, ``INNER`` of the others.
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
        left, right = int(source[tree.left[node]]), int(source[tree.right[node]])
        pending += [(right, number, 1), (left, number, 0)]
    return built.build()


def graft(
    stock: DecisionTree, kept: Mapping[int, int], scion: DecisionTree, labels: Integers
) -> tuple[DecisionTree, Integers, frozenset[int]]:
    """Return a tree that decides by ``stock`` in some of its leaves and by ``scion`` elsewhere.

    Tests of the stock with no kept leaf below them are gone, and so are tests of the scion that
    the tests above them answer already; each kept leaf has the box that it had.

    ``kept`` has the label of each leaf to keep, ``labels`` that of each leaf of the scion, shape
    [L]. Returned are the tree, the labels of its leaves, and which of them are the kept ones.
    """
    holds = holding(stock, kept)
    built, marked = TreeBuilder(stock.n_features), []
    nowhere = (-1, 0)
    everywhere = np.full(stock.n_features, -np.inf), np.full(stock.n_features, np.inf)
    work = [(stock, 0, everywhere, nowhere)]
    while work:
        tree, node, (low, high), (parent, side) = work.pop()
        if tree is stock and not holds[node]:
            tree, node = scion, 0
        feature, cut = int(tree.feature[node]), float(tree.threshold[node])
        if feature != tree.NO_FEATURE and not low[feature] < cut < high[feature]:
            child = tree.left if cut >= high[feature] else tree.right
            work.append((tree, int(child[node]), (low, high), (parent, side)))
            continue
        if feature == tree.NO_FEATURE:
            leaf = int(tree.leaf[node])
            label = kept[leaf] if tree is stock else int(labels[leaf])
            number = built.leaf(label, parent=parent, side=side)
            if tree is stock:
                marked.append(number)
            continue
        number = built.test(feature, cut, parent=parent, side=side)
        below, above = high.copy(), low.copy()
        below[feature] = above[feature] = cut
        work.append((tree, int(tree.right[node]), (above, high), (number, 1)))
        work.append((tree, int(tree.left[node]), (low, below), (number, 0)))
    return (*built.build(), frozenset(marked))
