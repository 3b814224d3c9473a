"""Binary decision trees over continuous observations, as immutable parallel arrays.

Node 0 is the root. An inner node tests ``x[feature] <= threshold``: true goes left, false goes
right, and so does NaN, which compares false. Every child has a larger index than its parent.
Leaves are numbered densely from 0 in an order of their own: ``split`` gives the left child the
number of the leaf that was split and the right child the next free number, so arrays over leaves
grow by appending.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Floats, Frozen, Int32s, Integers, freeze, frozen
from eutree.errors import InvalidArgumentError
from eutree.validation import check_integer, check_number

if TYPE_CHECKING:  # a tree that is only shown loads no compiler
    from eutree.trees import _kernels

_Scalar = TypeVar("_Scalar", bound=np.generic)

_ARRAYS = ("feature", "threshold", "left", "right", "leaf")


@dataclass(frozen=True, eq=False)
class DecisionTree(Frozen):
    """A binary tree; see the module's docstring for the meaning of its arrays.

    Attributes:
        n_features: Number of features d of the observations it locates.
        feature: Feature tested at each node; ``NO_FEATURE`` at a leaf.
        threshold: Threshold of the test; NaN at a leaf.
        left: Node for ``x[feature] <= threshold``; ``NO_NODE`` at a leaf.
        right: Node for everything else; ``NO_NODE`` at a leaf.
        leaf: Number of the leaf; ``NO_LEAF`` at an inner node.
    """

    NO_FEATURE: ClassVar[int] = -1
    NO_NODE: ClassVar[int] = -1
    NO_LEAF: ClassVar[int] = -1

    n_features: int
    feature: Int32s  # [M]
    threshold: Floats  # [M]
    left: Int32s  # [M]
    right: Int32s  # [M]
    leaf: Int32s  # [M]

    def __post_init__(self) -> None:
        freeze(self, "feature", "left", "right", "leaf", dtype=np.int32)
        freeze(self, "threshold", dtype=np.float64)
        if problem := _first_problem(self):
            raise InvalidArgumentError(f"not a decision tree: {problem}")

    @classmethod
    def single_leaf(cls, n_features: int) -> "DecisionTree":
        """Return the tree with one leaf, the whole observation space (Table 1, initialization)."""
        size = check_integer("n_features", n_features, low=1)
        no_node = np.array([cls.NO_NODE], dtype=np.int32)
        feature, leaf = np.array([[cls.NO_FEATURE], [0]], dtype=np.int32)
        return cls(size, feature, np.array([np.nan]), no_node, no_node, leaf)

    @property
    def n_nodes(self) -> int:
        """Number of nodes M."""
        return int(self.feature.size)

    @property
    def n_leaves(self) -> int:
        """Number of leaves L."""
        return (self.n_nodes + 1) // 2

    @cached_property
    def node_of_leaf(self) -> Int32s:
        """Node of each leaf, shape [L]."""
        nodes = np.flatnonzero(self.feature == self.NO_FEATURE).astype(np.int32)
        return frozen(nodes[np.argsort(self.leaf[nodes])])

    @cached_property
    def parent(self) -> Int32s:
        """Parent of each node, shape [M]; ``NO_NODE`` at the root."""
        parent = np.full(self.n_nodes, self.NO_NODE, dtype=np.int32)
        for child in (self.left, self.right):
            inner = child != self.NO_NODE
            parent[child[inner]] = np.flatnonzero(inner)
        return frozen(parent)

    @cached_property
    def depth(self) -> int:
        """Number of tests on the longest path."""
        return int(depths(self.parent).max())

    @cached_property
    def _walk(self) -> tuple[list[Any], ...]:
        """Features, thresholds, children as plain lists: one observation walks ten times faster.

        A child that is a leaf is ``~leaf``. A single leaf, whose feature is -1, is its own child.
        """
        at = np.stack([self.left, self.right])
        below = np.where(self.feature[at] < 0, ~self.leaf[at], at).tolist()
        return self.feature.tolist(), self.threshold.tolist(), *below

    @cached_property
    def nodes(self) -> "_kernels.TreeNodes":
        """The arrays together, as compiled loops take them."""
        from eutree.trees import _kernels

        return _kernels.TreeNodes(self.feature, self.threshold, self.left, self.right, self.leaf)

    @cached_property
    def _levels(self) -> "tuple[_kernels.LevelNodes, int]":
        """The nodes as a walk of many rows takes them, and how many levels they go together."""
        from eutree.trees import _kernels

        inner = self.feature != self.NO_FEATURE
        own = np.arange(self.n_nodes)
        children = np.where(inner[:, None], np.stack([self.left, self.right], 1), own[:, None])
        balanced = math.ceil(math.log2(self.n_leaves)) if self.n_leaves > 1 else 0
        levels = _kernels.LevelNodes(
            frozen(np.where(inner, self.feature, 0).astype(np.uint64)),
            frozen(children.astype(np.uint64)),
        )
        return levels, min(self.depth, 2 * balanced)

    def leaf_of(self, observation: Sequence[float]) -> int:
        """Return L(o) of one observation, a sequence of d numbers; unchecked, for inner loops.

        Each is compared as a double: a float32 beside a ``float`` would be compared in float32.
        """
        feature, threshold, left, right = self._walk
        node = 0
        while node >= 0:
            node = (
                left[node] if float(observation[feature[node]]) <= threshold[node] else right[node]
            )
        return ~node

    def leaf_index(self, observations: ArrayLike) -> Int32s:
        """Return L(o) of each observation.

        Args:
            observations: Shape [N, d]. NaN and infinities are allowed; NaN goes right.

        Returns:
            Number of the leaf of each observation, shape [N].
        """
        from eutree.trees import _kernels

        array = np.ascontiguousarray(observations, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != self.n_features:
            raise InvalidArgumentError(
                f"observations must have shape (N, {self.n_features}), got {array.shape}"
            )
        leaves = np.empty(array.shape[0], dtype=np.int32)
        _kernels.locate(self.nodes, *self._levels, array, leaves)
        return leaves

    def path(self, leaf: int) -> tuple[int, ...]:
        """Return the nodes from the root to ``leaf``, both included."""
        node = int(self.node_of_leaf[leaf])
        nodes = [node]
        while node != 0:
            node = int(self.parent[node])
            nodes.append(node)
        return tuple(reversed(nodes))

    def totals(self, of_leaves: NDArray[_Scalar]) -> NDArray[_Scalar]:
        """Return the sums over the leaves below each node, shape [M, ...], of values [L, ...]."""
        total = np.zeros((self.n_nodes, *of_leaves.shape[1:]), dtype=of_leaves.dtype)
        total[self.node_of_leaf] = of_leaves
        for node in range(self.n_nodes - 1, 0, -1):  # children have larger numbers
            total[self.parent[node]] += total[node]
        return total

    def largest_subtrees(self, most: int, *, least: int) -> Iterator[NDArray[np.bool_]]:
        """Yield which leaves [L] are below the nodes with most leaves, the largest first.

        The first is the root. At most ``most`` others follow, with at least ``least`` leaves each.
        """
        below = self.totals(np.eye(self.n_leaves, dtype=np.int64)) > 0
        sizes = below.sum(axis=1)
        for node in np.argsort(-sizes, kind="stable")[: 1 + most].tolist():
            if node == 0 or sizes[node] >= least:
                yield below[node]

    def preorder(self) -> Iterator[int]:
        """Yield all nodes, parent before left subtree before right subtree."""
        stack = [0]
        while stack:
            node = stack.pop()
            yield node
            if self.feature[node] != self.NO_FEATURE:
                stack += [int(self.right[node]), int(self.left[node])]

    def split(self, leaf: int, feature: int, threshold: float) -> "DecisionTree":
        """Return the tree with ``leaf`` cut in two at ``x[feature] <= threshold``.

        The left child keeps the number ``leaf``; the right child gets number ``n_leaves``.
        """
        return self.split_each([(leaf, feature, threshold)])

    def split_each(self, cuts: Sequence[tuple[int, int, float]]) -> "DecisionTree":
        """Return the tree after one ``split(leaf, feature, threshold)`` after another.

        Nodes that no cut changes are copied instead of checked and derived again: a learner's
        thousands of leaves grow by a few at a time.
        """
        for i, (leaf, feature, threshold) in enumerate(cuts):
            check_integer("leaf", leaf, low=0, high=self.n_leaves + i - 1)
            check_integer("feature", feature, low=0, high=self.n_features - 1)
            check_number("threshold", threshold)
        if not cuts:
            return self
        fields = {name: _lengthened(getattr(self, name), 2 * len(cuts)) for name in _ARRAYS}
        node_of_leaf = _lengthened(self.node_of_leaf, len(cuts))
        _cut(tuple(fields.values()), node_of_leaf, cuts)
        tree = object.__new__(DecisionTree)
        tree.__dict__["n_features"] = self.n_features
        for name, array in (*fields.items(), ("node_of_leaf", node_of_leaf)):
            array.setflags(write=False)
            tree.__dict__[name] = array
        return tree

    def equals(self, other: "DecisionTree") -> bool:
        """Return whether all arrays are equal, bit for bit (NaN equals NaN)."""
        return self.n_features == other.n_features and all(
            getattr(self, name).tobytes() == getattr(other, name).tobytes() for name in _ARRAYS
        )


def _lengthened(array: NDArray[_Scalar], n_new: int) -> NDArray[_Scalar]:
    """Return a copy with so many zeros behind it."""
    return np.concatenate([array, np.zeros(n_new, array.dtype)])


def _cut(
    columns: Sequence[Any], node_of_leaf: Int32s, cuts: Sequence[tuple[int, int, float]]
) -> None:
    """Write cuts into the five columns of a tree, which have room behind."""
    features, thresholds, left, right, leaves = columns
    n_leaves = len(node_of_leaf) - len(cuts)
    for leaf, feature, threshold in cuts:
        node, child = int(node_of_leaf[leaf]), 2 * n_leaves - 1
        features[node], thresholds[node] = int(feature), float(threshold)
        left[node], right[node], leaves[node] = child, child + 1, DecisionTree.NO_LEAF
        for new, number in ((child, int(leaf)), (child + 1, n_leaves)):
            features[new], thresholds[new] = DecisionTree.NO_FEATURE, np.nan
            left[new] = right[new] = DecisionTree.NO_NODE
            leaves[new], node_of_leaf[number] = number, new
        n_leaves += 1


def _first_problem(tree: DecisionTree) -> str:
    """Return the fault of the arrays, or an empty string."""
    arrays = [getattr(tree, name) for name in _ARRAYS]
    n_nodes = tree.feature.size
    if any(array.ndim != 1 or array.size != n_nodes for array in arrays):
        return f"arrays must be vectors of one length, got {[array.shape for array in arrays]}"
    if n_nodes % 2 == 0:
        return f"a binary tree has an odd number of nodes, got {n_nodes}"
    inner = tree.feature != tree.NO_FEATURE
    if (tree.feature[inner] < 0).any() or (tree.feature[inner] >= tree.n_features).any():
        return f"features must be in 0..{tree.n_features - 1} or -1 at a leaf"
    if not np.isfinite(tree.threshold[inner]).all():
        return "thresholds of inner nodes must be finite"
    if not np.isnan(tree.threshold[~inner]).all():
        return "thresholds of leaves must be NaN"
    children = np.concatenate([tree.left[inner], tree.right[inner]])
    if not np.array_equal(np.sort(children), np.arange(1, n_nodes)):
        return "every node but the root must be the child of exactly one inner node"
    if (children <= np.tile(np.flatnonzero(inner), 2)).any():
        return "every child must have a larger index than its parent"
    if (tree.left[~inner] != tree.NO_NODE).any() or (tree.right[~inner] != tree.NO_NODE).any():
        return "leaves must have no children"
    if (tree.leaf[inner] != tree.NO_LEAF).any():
        return "inner nodes must have no leaf number"
    if not np.array_equal(np.sort(tree.leaf[~inner]), np.arange(n_nodes // 2 + 1)):
        return "leaves must be numbered 0, 1, 2, ... without gaps"
    return ""


def depths(parent: Int32s) -> Integers:
    """Return the number of tests above each node, of which these are the parents, shape [M].

    Children have larger numbers; the parent of the root, node 0, is not read.
    """
    found = np.zeros(parent.size, dtype=np.int64)
    for node in range(1, parent.size):
        found[node] = found[parent[node]] + 1
    return found
