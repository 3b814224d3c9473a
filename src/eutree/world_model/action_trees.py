"""Policy trees under change: nested tuples to edit, parallel arrays to run.

A nested tree is an action, or ``(feature, threshold, left, right)``.
"""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees import DecisionTree
from eutree.world_model import _kernels
from eutree.world_model._kernels import ActionTree

Nested: TypeAlias = "int | tuple[int, float, Nested, Nested]"


def n_leaves(tree: ActionTree) -> int:
    """Return the number of leaves."""
    return (tree.feature.size + 1) // 2


def forest_of(trees: Sequence[ActionTree]) -> tuple[ActionTree, Integers]:
    """Return the arrays of all trees, one after the other, and the node where each begins, [C]."""
    sizes = [tree.feature.size for tree in trees]
    roots = np.cumsum([0, *sizes[:-1]])
    shift = roots.repeat(sizes)
    forest = ActionTree._make(map(np.concatenate, zip(*trees, strict=True)))
    return forest._replace(left=forest.left + shift, right=forest.right + shift), roots


def packed(nested: Nested) -> ActionTree:
    """Return the arrays of a nested tree, after merging sibling leaves of equal action."""
    rows: list[tuple[float, ...]] = []

    def add(tree: Nested) -> int:
        node = len(rows)
        if not isinstance(tree, tuple):
            rows.append((-1, 0.0, 0, 0, tree))
            return node
        rows.append(())  # its place: in preorder a parent comes before its children
        left, right = add(tree[2]), add(tree[3])
        one, other = rows[left], rows[right]
        if one[0] < 0 and other[0] < 0 and one[4] == other[4]:
            rows[node:] = [one]
        else:
            rows[node] = (tree[0], tree[1], left, right, 0)
        return node

    add(nested)
    columns = np.array(rows)
    feature, left, right, action = (columns[:, i].astype(np.int64) for i in (0, 2, 3, 4))
    return ActionTree(feature, np.ascontiguousarray(columns[:, 1]), left, right, action)


def nested(
    tree: ActionTree, node: int = 0, *, instead: Mapping[int, Nested] | None = None
) -> Nested:
    """Return the subtree at ``node`` as a nested tree, with some nodes replaced."""
    instead = instead or {}
    feature, threshold, left, right, action = (column.tolist() for column in tree)

    def at(node: int) -> Nested:
        if node in instead:
            return instead[node]
        if feature[node] < 0:
            return int(action[node])
        return feature[node], threshold[node], at(left[node]), at(right[node])

    return at(node)


def with_child(tree: ActionTree, node: int, *, goes_left: bool) -> tuple[ActionTree, Integers]:
    """Return the tree with ``node`` replaced by a child, and the node that each node was, [M].

    Sibling leaves of equal action are merged.
    """
    out = ActionTree._make(np.empty_like(array) for array in tree)
    source = np.empty_like(tree.action)
    child = int((tree.left if goes_left else tree.right)[node])
    n = _kernels.replace_by_child(tree, node, child, out, source)
    return ActionTree._make(array[:n] for array in out), source[:n]


def with_box(box: Floats, inside: int, outside: int) -> Nested:
    """Return the tree that takes ``inside`` within the box [d, 2] and ``outside`` elsewhere."""
    result: Nested = inside
    for feature, (low, high) in enumerate(box.tolist()):
        if np.isfinite(high):
            result = (feature, high, result, outside)
        if np.isfinite(low):
            result = (feature, low, outside, result)
    return result


def from_decision_tree(tree: DecisionTree, actions: Integers) -> ActionTree:
    """Return the arrays of a state tree whose leaves have these actions [L]."""

    def at(node: int) -> Nested:
        if tree.feature[node] == tree.NO_FEATURE:
            return int(actions[tree.leaf[node]])
        test = int(tree.feature[node]), float(tree.threshold[node])
        return (*test, at(int(tree.left[node])), at(int(tree.right[node])))

    return packed(at(0))


def to_decision_tree(tree: ActionTree, n_features: int) -> tuple[DecisionTree, Integers]:
    """Return the state tree, leaves numbered in preorder, and the actions of its leaves [L]."""
    is_leaf = tree.feature < 0
    leaf = np.where(is_leaf, np.cumsum(is_leaf) - 1, DecisionTree.NO_LEAF)
    state_tree = DecisionTree(
        n_features,
        feature=np.where(is_leaf, DecisionTree.NO_FEATURE, tree.feature).astype(np.int32),
        threshold=np.where(is_leaf, np.nan, tree.threshold),
        left=np.where(is_leaf, DecisionTree.NO_NODE, tree.left).astype(np.int32),
        right=np.where(is_leaf, DecisionTree.NO_NODE, tree.right).astype(np.int32),
        leaf=leaf.astype(np.int32),
    )
    return state_tree, tree.action[is_leaf]
