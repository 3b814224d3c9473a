"""Policy trees under change: nested tuples to edit, parallel arrays to run.

A nested tree is an action, or ``(feature, threshold, left, right)``.
"""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees import DecisionTree
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
    last = node
    while tree.feature[last] >= 0:
        last = tree.right[last]
    # Preorder: a subtree is a slice, a left child comes directly after its parent.
    begin, end = (tree.left[node], tree.right[node]) if goes_left else (tree.right[node], last + 1)
    parts = np.arange(node), np.arange(begin, end), np.arange(last + 1, tree.feature.size)
    source = np.concatenate(parts)
    feature, action = tree.feature[source], tree.action[source]
    while (twins := _twins(feature, action)).size:
        feature[twins], action[twins] = -1, action[twins + 1]
        gone = np.concatenate([twins + 1, twins + 2])
        feature, action, source = (np.delete(column, gone) for column in (feature, action, source))
    place = np.zeros(tree.feature.size, dtype=np.int64)
    place[source] = np.arange(source.size)
    place[node] = place[begin]
    inner = feature >= 0
    links = np.arange(1, source.size + 1), place[tree.right[source]]
    left, right = (np.where(inner, link, 0) for link in links)
    threshold = np.where(inner, tree.threshold[source], 0.0)
    return ActionTree(feature, threshold, left, right, action), source


def _twins(feature: Integers, action: Integers) -> Integers:
    """Return the nodes [M] of a tree in preorder whose children are leaves of equal action."""
    ends = feature < 0
    return np.flatnonzero(~ends[:-2] & ends[1:-1] & ends[2:] & (action[1:-1] == action[2:]))


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
    feature = np.where(is_leaf, DecisionTree.NO_FEATURE, tree.feature)
    threshold = np.where(is_leaf, np.nan, tree.threshold)
    left, right = (np.where(is_leaf, DecisionTree.NO_NODE, to) for to in (tree.left, tree.right))
    leaf = np.where(is_leaf, np.cumsum(is_leaf) - 1, DecisionTree.NO_LEAF)
    return DecisionTree(n_features, feature, threshold, left, right, leaf), tree.action[is_leaf]
