"""A tree as C4.5 makes it: binary tests of numbers, tests of nominal values, classes by node.

Node 0 is the root. A node on a continuous attribute tests ``x[feature] <= threshold``: true takes
its first child, false its second. A node on a nominal attribute has one child per value. The
children of a node have consecutive indices, all larger than its own. A case whose tested value is
unknown (NaN) goes down all branches, weighted by their shares of the training cases (*fractional
cases*).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Frozen, Int32s, Integers, freeze, frozen, read_only
from eutree.c45 import _kernels_pruning
from eutree.c45._kernels import Nodes
from eutree.errors import InvalidArgumentError
from eutree.trees import DecisionTree
from eutree.trees.edit import TreeBuilder
from eutree.trees.text import printable
from eutree.trees.tree import depths

ROUNDING = 1e-10  # of shares that are sums of parts of cases, in any order


@dataclass(frozen=True, eq=False)
class C45Tree(Frozen):
    """A C4.5 tree; see the module's docstring for the meaning of its arrays.

    Attributes:
        n_values: Number of values of each nominal attribute; 0 for a continuous one.
        feature: Attribute tested at each node; ``NO_FEATURE`` at a leaf.
        threshold: Threshold of a continuous test; NaN elsewhere.
        first_child: First child of each node; ``NO_NODE`` at a leaf.
        n_children: Number of children of each node; 0 at a leaf.
        distribution: Weight of each class among the training cases of each node.
    """

    NO_FEATURE: ClassVar[int] = -1
    NO_NODE: ClassVar[int] = -1

    n_values: Int32s  # [d]
    feature: Int32s  # [M]
    threshold: Floats  # [M]
    first_child: Int32s  # [M]
    n_children: Int32s  # [M]
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
        return int(depths(self.parent).max())

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
        """Share of each attribute in the information gained by the tests, [d]; zeros if none.

        A test gains the entropy of its node less that of its children, each times its cases.
        """
        share = self.probability
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
        return frozen(_most_probable(self.probability))

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
        rows, leaf, fractional = self._routed(observations)
        if fractional.size:
            leaf[fractional] = self._shared_out(rows, fractional)[1]
        return leaf

    def predict(self, observations: ArrayLike) -> Integers:
        """Return the most probable class of each observation, shape [N]."""
        rows, leaf, fractional = self._routed(observations)
        found = self.label[leaf]
        if fractional.size:
            found[fractional] = _most_probable(self._shared_out(rows, fractional)[0])
        return found

    def predict_proba(self, observations: ArrayLike) -> Floats:
        """Return the share of each class at the leaf (or leaves) of each observation, [N, A]."""
        rows, leaf, fractional = self._routed(observations)
        found = self.probability[leaf]
        if fractional.size:
            found[fractional] = self._shared_out(rows, fractional)[0]
        return found

    @cached_property
    def _nodes(self) -> Nodes:
        return Nodes(*(getattr(self, name) for name in Nodes._fields))

    def _routed(self, observations: ArrayLike) -> tuple[Floats, Int32s, Integers]:
        """Return rows [N, d], the leaf of each, and which are fractional: these have no leaf."""
        rows = np.ascontiguousarray(observations, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.n_features:
            raise InvalidArgumentError(
                f"observations must have shape (N, {self.n_features}), got {rows.shape}"
            )
        rows, leaf = read_only(rows), np.empty(len(rows), dtype=np.int32)
        n = _kernels_pruning.find_leaves(self._nodes, rows, leaf)
        return rows, leaf, np.flatnonzero(leaf < 0) if n else np.empty(0, np.int64)

    def _shared_out(self, rows: Floats, fractional: Integers) -> tuple[Floats, Int32s]:
        """Return the probabilities of fractional cases, and the leaf of each's largest share."""
        shares = np.zeros((fractional.size, self.n_classes))
        leaves = np.empty(fractional.size, dtype=np.int32)
        weight = self.distribution.sum(axis=1)
        _kernels_pruning.share_out(
            self._nodes, weight, self.probability, rows, fractional, shares, leaves
        )
        return shares, leaves

    def to_decision_tree(self) -> tuple[DecisionTree, Integers]:
        """Return the same tree as a ``DecisionTree``, and the class of each of its leaves.

        Leaves are numbered from left to right. A test of a nominal attribute becomes tests of its
        code, which halve its remaining values. Where a value is unknown the two trees may differ.
        """
        built = TreeBuilder(self.n_features)
        work = [(_branches(self, 0), -1, 0)]  # branches, the test above, and its side
        while work:
            (feature, branches), above, side = work.pop()
            if feature == self.NO_FEATURE:
                built.leaf(int(self.label[branches[0][1]]), parent=above, side=side)
                continue
            middle = len(branches) // 2
            at = built.test(feature, branches[middle - 1][0], parent=above, side=side)
            for half, part in ((1, branches[middle:]), (0, branches[:middle])):
                below = _branches(self, part[0][1]) if len(part) == 1 else (feature, part)
                work.append((below, at, half))
        return built.build()


def _most_probable(shares: Floats) -> Integers:
    """Return the first class of the largest share of each row [., A]; rounding parts no equals."""
    first: Integers = (shares >= shares.max(axis=1, keepdims=True) - ROUNDING).argmax(axis=1)
    return first


def _branches(known: C45Tree, node: int) -> tuple[int, list[tuple[float, int]]]:
    """Return a node's attribute, and the threshold up to which each child is taken, in order.

    A leaf has itself as the only child.
    """
    feature, children = int(known.feature[node]), known.children(node)
    if feature == known.NO_FEATURE:
        return feature, [(np.inf, node)]
    ends = [float(known.threshold[node]), np.inf]
    if known.n_values[feature]:
        ends = [code + 0.5 for code in range(len(children))]
    return feature, list(zip(ends, children, strict=True))


class C45Names(NamedTuple):
    """Names of the numbers of a tree."""

    features: Sequence[str]
    classes: Sequence[str]
    values: Sequence[Sequence[str]]  # of each nominal attribute; empty for a continuous one


def _condition(tree: C45Tree, names: C45Names, node: int, branch: int) -> str:
    """Return the condition under which ``node`` hands a case to a branch."""
    name = printable(names.features[tree.feature[node]])
    if tree.n_values[tree.feature[node]]:
        return f"{name} = {printable(names.values[tree.feature[node]][branch])}"
    return f"{name} {'>' if branch else '<='} {_number(tree.threshold[node])}"


def _verdict(tree: C45Tree, names: C45Names, node: int) -> str:
    """Return the class of a leaf with its training cases and errors: ``play (4)``, ``(4/1)``."""
    total = float(tree.distribution[node].sum())
    wrong = total - float(tree.distribution[node].max())
    errors = f"/{_number(round(wrong, 2))}" if round(wrong, 2) else ""
    return f"{printable(names.classes[tree.label[node]])} ({_number(round(total, 2))}{errors})"


def to_text(tree: C45Tree, names: C45Names) -> str:
    """Return one line for each branch, indented by its depth, as C4.5 prints its trees.

    The writers of ``eutree.export`` take binary trees; this also takes tests with many branches.
    """
    if tree.n_nodes == 1:
        return _verdict(tree, names, 0)
    lines = []
    for node, depth in tree.preorder():
        if node:
            parent = int(tree.parent[node])
            text = _condition(tree, names, parent, node - int(tree.first_child[parent]))
            leaf = f" {_verdict(tree, names, node)}" if not tree.n_children[node] else ""
            lines.append(f"{'|   ' * (depth - 1)}{text}:{leaf}")
    return "\n".join(lines)


def _number(value: float) -> str:
    """Return the shortest decimal that reads back as the same double."""
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))
