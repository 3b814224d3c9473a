"""A tree as C4.5 makes it: binary tests of numbers, tests of nominal values, classes by node.

Node 0 is the root. A node on a continuous attribute tests ``x[feature] <= threshold``: true takes
its first child, false its second. A node on a nominal attribute has one child per value or group
of values. The children of a node have consecutive indices, all larger than its own. A case whose
tested value is unknown (NaN, or a value that no branch stands for) goes down all branches, weighted
by their shares of the training cases (*fractional cases*).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Int32s, Integers, freeze, frozen
from eutree.c45 import _kernels_pruning
from eutree.c45._kernels_pruning import TreeTests
from eutree.errors import InvalidArgumentError
from eutree.trees import DecisionTree
from eutree.trees.tree import longest_path


class Routes(NamedTuple):
    """What a case that is led down a tree meets; see ``C45Tree``."""

    n_features: int
    branches: TreeTests
    distribution: Floats  # [M, A]
    probability: Floats  # [M, A]
    label: Integers  # [M]


class RoutedCases:
    """Cases that were led down a tree.

    Args:
        tree: Where the cases are led.
        observations: The cases, shape [N, d].

    Attributes:
        leaf: Leaf (its node) of each case, -1 for fractional ones, shape [N].
        fractional: Numbers of the cases that come to several leaves, ascending.

    Raises:
        InvalidArgumentError: The cases have another number of attributes.
    """

    def __init__(self, tree: Routes, observations: ArrayLike) -> None:
        rows = np.ascontiguousarray(observations, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != tree.n_features:
            raise InvalidArgumentError(
                f"observations must have shape (N, {tree.n_features}), got {rows.shape}"
            )
        self._tree = tree
        self._rows = read_only(rows)
        self.leaf: Int32s = np.empty(len(rows), dtype=np.int32)
        n = _kernels_pruning.find_leaves(tree.branches, self._rows, self.leaf)
        self.fractional: Integers = np.flatnonzero(self.leaf < 0) if n else np.empty(0, np.int64)

    def main_leaf(self) -> Int32s:
        """Return the leaf of each case's largest share, shape [N]."""
        found = self.leaf.copy()
        if self.fractional.size:
            found[self.fractional] = self._shared_out()[1]
        return found

    def label(self) -> Integers:
        """Return the most probable class of each case, shape [N]."""
        found = self._tree.label[self.leaf]
        if self.fractional.size:
            found[self.fractional] = self._shared_out()[0].argmax(axis=1)
        return found

    def probability(self) -> Floats:
        """Return the share of each class at the leaf, or the leaves, of each case, shape [N, A]."""
        found = self._tree.probability[self.leaf]
        if self.fractional.size:
            found[self.fractional] = self._shared_out()[0]
        return found

    def _shared_out(self) -> tuple[Floats, Int32s]:
        """Return the probabilities of fractional cases, and the leaf of each's largest share."""
        tree, n = self._tree, self.fractional.size
        shares = np.zeros((n, tree.distribution.shape[1]))
        leaves = np.empty(n, dtype=np.int32)
        weight = tree.distribution.sum(axis=1)
        _kernels_pruning.share_out(
            tree.branches, weight, tree.probability, self._rows, self.fractional, shares, leaves
        )
        return shares, leaves


def read_only(array: Floats) -> Floats:
    """Return a read-only view: kernels are compiled again for arrays that differ in this."""
    view = array.view()
    view.setflags(write=False)
    return view


@dataclass(frozen=True, eq=False)
class C45Tree:
    """A C4.5 tree; see the module's docstring for the meaning of its arrays.

    Attributes:
        n_values: Number of values of each nominal attribute; 0 for a continuous one.
        feature: Attribute tested at each node; ``NO_FEATURE`` at a leaf.
        threshold: Threshold of a continuous test; NaN elsewhere.
        first_child: First child of each node; ``NO_NODE`` at a leaf.
        n_children: Number of children of each node; 0 at a leaf.
        value_start: Where the branches of a nominal test begin in ``value_branch``; -1 elsewhere.
        value_branch: Branch of each value of a nominal test; -1 where no branch stands for it.
        distribution: Weight of each class among the training cases of each node.
    """

    NO_FEATURE: ClassVar[int] = -1
    NO_NODE: ClassVar[int] = -1

    n_values: Int32s  # [d]
    feature: Int32s  # [M]
    threshold: Floats  # [M]
    first_child: Int32s  # [M]
    n_children: Int32s  # [M]
    value_start: Int32s  # [M]
    value_branch: Int32s  # [V]
    distribution: Floats  # [M, A]

    def __post_init__(self) -> None:
        freeze(self, *(column.name for column in fields(self)))

    @property
    def n_features(self) -> int:
        """Number of attributes d."""
        return int(self.n_values.size)

    @property
    def n_classes(self) -> int:
        """Number of classes A."""
        return int(self.distribution.shape[1])

    @property
    def n_nodes(self) -> int:
        """Number of nodes M."""
        return int(self.feature.size)

    @property
    def n_leaves(self) -> int:
        """Number of leaves, empty ones included."""
        return int((self.feature == self.NO_FEATURE).sum())

    @cached_property
    def parent(self) -> Int32s:
        """Parent of each node, shape [M]; ``NO_NODE`` at the root."""
        inner = np.flatnonzero(self.feature != self.NO_FEATURE)
        order = np.argsort(self.first_child[inner], kind="stable")
        parents = np.repeat(inner[order], self.n_children[inner[order]])
        return frozen(np.concatenate([[self.NO_NODE], parents]).astype(np.int32))

    @cached_property
    def depth(self) -> int:
        """Number of tests on the longest path."""
        return longest_path(self.parent)

    @cached_property
    def probability(self) -> Floats:
        """Share of each class at each node, shape [M, A]; an empty leaf has its parent's."""
        weight = self.distribution.sum(axis=1, keepdims=True)
        shares = np.divide(self.distribution, weight, where=weight > 0, out=self.distribution * 0)
        for node in np.flatnonzero(weight[:, 0] <= 0):
            shares[node] = shares[self.parent[node]]
        return frozen(shares)

    @cached_property
    def importances(self) -> Floats:
        """Share of each attribute in what the tests tell of the class, shape [d]; zeros if nothing.

        A test tells the entropy of its node less that of its children, each times its cases.
        """
        weight = self.distribution.sum(axis=1, keepdims=True)
        share = np.divide(self.distribution, weight, where=weight > 0, out=self.distribution * 0)
        logarithm = np.log2(share, where=share > 0, out=share * 0)
        unsaid = -(self.distribution * logarithm).sum(axis=1)  # [M] bits of all its cases
        told = np.zeros(self.n_features)
        for node in np.flatnonzero(self.feature != self.NO_FEATURE).tolist():
            told[self.feature[node]] += unsaid[node] - unsaid[list(self.children(node))].sum()
        told = np.maximum(told, 0.0)  # rounding
        return frozen(told / told.sum() if told.any() else told)

    @cached_property
    def label(self) -> Integers:
        """Most frequent class of each node, shape [M]; the lowest index wins ties."""
        return frozen(self.probability.argmax(axis=1).astype(np.int64))

    def children(self, node: int) -> range:
        """Return the children of a node; an empty range for a leaf."""
        first = int(self.first_child[node])
        return range(first, first + int(self.n_children[node]))

    def path(self, node: int) -> tuple[int, ...]:
        """Return the nodes from the root to ``node``, both included."""
        nodes = [node]
        while nodes[-1]:
            nodes.append(int(self.parent[nodes[-1]]))
        return tuple(reversed(nodes))

    def values_of_branch(self, node: int, branch: int) -> tuple[int, ...]:
        """Return the values of the nominal attribute of ``node`` that take a branch."""
        start = int(self.value_start[node])
        branches = self.value_branch[start : start + self.n_values[self.feature[node]]]
        return tuple(int(value) for value in np.flatnonzero(branches == branch))

    def preorder(self) -> Iterator[tuple[int, int]]:
        """Yield (node, depth) of all nodes, each before its children, first child first."""
        stack = [(0, 0)]
        while stack:
            node, depth = stack.pop()
            yield node, depth
            stack += [(child, depth + 1) for child in reversed(self.children(node))]

    def leaf_node(self, observations: ArrayLike) -> Int32s:
        """Return the leaf (its node) of each observation, shape [N].

        Of the leaves of a fractional case it is the one with the largest share.
        """
        return RoutedCases(self._routes, observations).main_leaf()

    def predict(self, observations: ArrayLike) -> Integers:
        """Return the most probable class of each observation, shape [N]."""
        return RoutedCases(self._routes, observations).label()

    def predict_proba(self, observations: ArrayLike) -> Floats:
        """Return the share of each class at the leaf (or leaves) of each observation, [N, A]."""
        return RoutedCases(self._routes, observations).probability()

    @cached_property
    def _routes(self) -> Routes:
        branches = TreeTests(
            self.feature, self.threshold, self.first_child, self.n_children,
            self.value_start, self.value_branch,
        )  # fmt: skip
        return Routes(self.n_features, branches, self.distribution, self.probability, self.label)

    def to_decision_tree(self) -> tuple[DecisionTree, Integers]:
        """Return the same tree as a ``DecisionTree``, and the class of each of its leaves.

        Leaves are numbered from left to right. A test of a nominal attribute becomes tests of its
        code where the branch changes; a branch of several runs of codes is there for each. A code
        that no branch stands for takes the largest one; there, and where a value is unknown, the
        two trees may differ.
        """
        if (self.value_start >= 0).any():
            return _with_codes_tested(self)
        order = np.array([node for node, _ in self.preorder()])
        new = np.empty(self.n_nodes, dtype=np.int32)
        new[order] = np.arange(self.n_nodes, dtype=np.int32)
        leaves = self.feature[order] == self.NO_FEATURE
        children = np.full((2, self.n_nodes), DecisionTree.NO_NODE, dtype=np.int32)
        first = self.first_child[order[~leaves]]
        children[:, ~leaves] = new[first], new[first + 1]
        tree = DecisionTree(
            n_features=self.n_features,
            feature=self.feature[order],
            threshold=self.threshold[order],
            left=children[0],
            right=children[1],
            leaf=np.where(leaves, np.cumsum(leaves) - 1, DecisionTree.NO_LEAF),
        )
        return tree, self.label[order[leaves]]


def _with_codes_tested(known: C45Tree) -> tuple[DecisionTree, Integers]:
    """Return the same as ``to_decision_tree`` of a tree that tests nominal attributes."""
    tests: list[tuple[int, float]] = []  # feature and threshold of each new node
    sides: tuple[list[int], list[int]] = ([], [])
    labels: list[int] = []  # of the leaves
    left = [(_branches(known, 0), -1, 0)]  # branches, the test above, and its side
    while left:
        (feature, runs), above, side = left.pop()
        if above >= 0:
            sides[side][above] = len(tests)
        for one in sides:
            one.append(DecisionTree.NO_NODE)
        if feature == known.NO_FEATURE:
            labels.append(int(known.label[runs[0][1]]))
            tests.append((DecisionTree.NO_FEATURE, np.nan))
            continue
        middle, at = len(runs) // 2, len(tests)
        tests.append((feature, runs[middle - 1][0]))
        for half, part in ((1, runs[middle:]), (0, runs[:middle])):
            below = _branches(known, part[0][1]) if len(part) == 1 else (feature, part)
            left.append((below, at, half))
    features, thresholds = map(np.array, zip(*tests, strict=True))
    leaves = features == DecisionTree.NO_FEATURE
    tree = DecisionTree(
        n_features=known.n_features,
        feature=features,
        threshold=thresholds,
        left=np.array(sides[0]),
        right=np.array(sides[1]),
        leaf=np.where(leaves, np.cumsum(leaves) - 1, DecisionTree.NO_LEAF),
    )
    return tree, np.array(labels)


def _branches(known: C45Tree, node: int) -> tuple[int, list[tuple[float, int]]]:
    """Return a node's attribute, and the threshold up to which each child is taken, in order.

    A node all of whose codes take one child is passed by; a leaf has itself as the only child.
    """
    while (feature := int(known.feature[node])) != known.NO_FEATURE:
        start, first = int(known.value_start[node]), int(known.first_child[node])
        if start < 0:
            return feature, [(float(known.threshold[node]), first), (np.inf, first + 1)]
        branch = known.value_branch[start : start + known.n_values[feature]]
        weight = known.distribution[list(known.children(node))].sum(axis=1)
        child = first + np.where(branch < 0, weight.argmax(), branch)
        ends = np.append(np.flatnonzero(np.diff(child)), child.size - 1)
        if ends.size > 1:
            return feature, [(end + 0.5, int(child[end])) for end in ends.tolist()]
        node = int(child[0])
    return feature, [(np.inf, node)]
