"""Put one labelled tree in the place of another, but for some of its leaves."""

from collections.abc import Mapping

import numpy as np

from eutree.arrays import Integers
from eutree.trees.building import TreeBuilder
from eutree.trees.tree import DecisionTree


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
    built, marked = TreeBuilder(stock.n_features), []
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
