"""DecisionTree against a naive twin made of nested tuples, and every rule of a well-formed tree."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.trees import DecisionTree
from tests.policies.strategies import finite, trees

cuts = st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 2), finite), max_size=12)


def naive_split(node, leaf, feature, threshold, new_leaf):
    """Split ``leaf`` in nested tuples (feature, threshold, left, right) with ints as leaves."""
    if isinstance(node, int):
        return (feature, threshold, leaf, new_leaf) if node == leaf else node
    test, at, left, right = node
    return (
        test,
        at,
        naive_split(left, leaf, feature, threshold, new_leaf),
        naive_split(right, leaf, feature, threshold, new_leaf),
    )


def naive_leaf(node, observation):
    while not isinstance(node, int):
        feature, threshold, left, right = node
        node = left if observation[feature] <= threshold else right
    return node


def naive_depth(node):
    return 0 if isinstance(node, int) else 1 + max(naive_depth(node[2]), naive_depth(node[3]))


@given(cuts=cuts, seed=st.integers(0, 2**32 - 1))
def test_equals_nested_tuples_on_and_around_every_threshold(cuts, seed):
    tree, twin = DecisionTree.single_leaf(3), 0
    for number, feature, threshold in cuts:
        leaf, new_leaf = number % tree.n_leaves, tree.n_leaves
        tree = tree.split(leaf, feature, threshold)
        twin = naive_split(twin, leaf, feature, threshold, new_leaf)
    thresholds = np.array([0.0, *(threshold for _, _, threshold in cuts)])
    around = [math.nextafter(t, end) for t in thresholds for end in (math.inf, -math.inf)]
    values = [*thresholds, *around, math.nan, math.inf, -math.inf, -0.0, 5e-324]
    points = np.random.default_rng(seed).choice(values, size=(200, 3))
    expected = [naive_leaf(twin, point) for point in points]
    assert tree.leaf_index(points).tolist() == expected
    assert [tree.leaf_of(point) for point in points.tolist()] == expected
    assert tree.depth == naive_depth(twin)
    assert tree.n_leaves == len(cuts) + 1
    numbered = [(number % (i + 1), *cut) for i, (number, *cut) in enumerate(cuts)]
    assert DecisionTree.single_leaf(3).split_each(numbered).equals(tree)


@given(tree=trees())
def test_paths_parents_and_preorder_fit_together(tree):
    assert sorted(tree.preorder()) == list(range(tree.n_nodes))
    assert tree.parent[0] == tree.NO_NODE
    for leaf in range(tree.n_leaves):
        path = tree.path(leaf)
        assert path[0] == 0
        assert tree.leaf[path[-1]] == leaf
        assert [int(tree.parent[node]) for node in path[1:]] == list(path[:-1])
    assert max(len(tree.path(leaf)) - 1 for leaf in range(tree.n_leaves)) == tree.depth


@given(tree=trees(), data=st.data())
def test_split_changes_only_the_leaf_it_splits(tree, data):
    leaf = data.draw(st.integers(0, tree.n_leaves - 1))
    feature = data.draw(st.integers(0, tree.n_features - 1))
    threshold = data.draw(finite)
    points = data.draw(
        st.lists(st.lists(finite, min_size=tree.n_features, max_size=tree.n_features), min_size=1)
    )
    before = tree.leaf_index(points)
    after = tree.split(leaf, feature, threshold).leaf_index(points)
    elsewhere = before != leaf
    assert (after[elsewhere] == before[elsewhere]).all()
    right = np.array(points)[~elsewhere, feature] > threshold
    assert (after[~elsewhere] == np.where(right, tree.n_leaves, leaf)).all()


def test_nan_goes_right():
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.0)
    assert tree.leaf_index([[math.nan], [0.0], [-math.inf]]).tolist() == [1, 0, 0]


def test_a_tree_is_frozen_all_the_way_down():
    tree = DecisionTree.single_leaf(2).split(0, 1, 0.5)
    for name in ("feature", "threshold", "left", "right", "leaf", "parent", "node_of_leaf"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(tree, name)[0] = 0


def test_equality_is_bit_for_bit():
    tree = DecisionTree.single_leaf(1)
    assert tree.split(0, 0, 0.5).equals(tree.split(0, 0, 0.5))
    assert not tree.split(0, 0, 0.0).equals(tree.split(0, 0, -0.0))
    assert not DecisionTree.single_leaf(1).equals(DecisionTree.single_leaf(2))


@pytest.mark.promise(3)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"feature": [0, -1]}, "vectors of one length"),
        ({"feature": [7, -1, -1]}, r"features must be in 0\.\.1"),
        ({"feature": [-2, -1, -1]}, r"features must be in 0\.\.1"),
        ({"threshold": [math.nan] * 3}, "thresholds of inner nodes must be finite"),
        ({"threshold": [math.inf, math.nan, math.nan]}, "thresholds of inner nodes must be finite"),
        ({"threshold": [0.5, 0.5, math.nan]}, "thresholds of leaves must be NaN"),
        ({"left": [2, -1, -1]}, "child of exactly one"),
        ({"left": [0, -1, -1]}, "child of exactly one"),
        ({"right": [9, -1, -1]}, "child of exactly one"),
        ({"left": [1, 2, -1]}, "leaves must have no children"),
        ({"leaf": [0, 0, 1]}, "inner nodes must have no leaf number"),
        ({"leaf": [-1, 0, 0]}, "numbered 0, 1, 2"),
        ({"leaf": [-1, 0, 2]}, "numbered 0, 1, 2"),
    ],
)
def test_what_is_no_tree_is_refused(changes, message):
    tree = DecisionTree.single_leaf(2).split(0, 1, 0.5)
    with pytest.raises(InvalidArgumentError, match=message):
        replace(tree, **changes)


@pytest.mark.promise(3)
def test_an_even_number_of_nodes_and_a_cycle_are_refused():
    with pytest.raises(InvalidArgumentError, match="odd number of nodes"):
        DecisionTree(1, feature=[], threshold=[], left=[], right=[], leaf=[])
    nan = math.nan
    with pytest.raises(InvalidArgumentError, match="larger index than its parent"):
        DecisionTree(
            1,
            feature=[0, 0, -1, -1, 0, -1, -1],
            threshold=[0.0, 0.0, nan, nan, 0.0, nan, nan],
            left=[3, 4, -1, -1, 1, -1, -1],
            right=[6, 2, -1, -1, 5, -1, -1],
            leaf=[-1, -1, 0, 1, -1, 2, 3],
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1, 0, 0.0), "leaf must be an integer from 0 to 0, got 1"),
        ((0, 2, 0.0), "feature must be an integer from 0 to 1, got 2"),
        ((0, 0, math.nan), "threshold must be a number"),
    ],
)
def test_splits_that_cannot_be_are_refused(arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        DecisionTree.single_leaf(2).split(*arguments)


def test_observations_of_another_shape_are_refused():
    with pytest.raises(InvalidArgumentError, match=r"shape \(N, 2\), got \(2,\)"):
        DecisionTree.single_leaf(2).leaf_index([0.0, 1.0])


@given(tree=trees(), data=st.data(), asked_before=st.booleans())
def test_what_a_split_hands_on_equals_what_a_tree_works_out_for_itself(tree, data, asked_before):
    leaves = st.integers(0, tree.n_leaves - 1)
    one_each = data.draw(st.lists(leaves, max_size=5, unique=True))
    cuts = [(leaf, data.draw(st.integers(0, tree.n_features - 1)), 0.5) for leaf in one_each]
    points = np.random.default_rng(0).normal(size=(20, tree.n_features))
    before = tree.leaf_index(points).tolist()
    if asked_before:
        assert [tree.leaf_of(point) for point in points.tolist()] == before
    grown = tree.split_each(cuts)
    rebuilt = replace(grown)  # checked, and nothing derived yet
    assert grown.equals(rebuilt)
    assert grown.node_of_leaf.tolist() == rebuilt.node_of_leaf.tolist()
    assert grown.node_of_leaf.dtype == rebuilt.node_of_leaf.dtype
    assert [grown.leaf_of(point) for point in points.tolist()] == [
        rebuilt.leaf_of(point) for point in points.tolist()
    ]
    for mine, theirs in zip(grown._walk, rebuilt._walk, strict=True):
        assert np.array_equal(mine, theirs, equal_nan=True)
        assert [type(value) for value in mine] == [type(value) for value in theirs]
    assert not grown.threshold.flags.writeable
    assert [tree.leaf_of(point) for point in points.tolist()] == before


@given(trees(), st.integers(0, 5), st.integers(1, 6))
def test_the_largest_subtrees_are_the_root_and_those_of_most_leaves(
    tree: DecisionTree, most: int, least: int
) -> None:
    below = [[] for _ in range(tree.n_nodes)]  # type: list[list[int]]
    for leaf in range(tree.n_leaves):
        for node in tree.path(leaf):
            below[node].append(leaf)
    found = [np.flatnonzero(leaves).tolist() for leaves in tree.largest_subtrees(most, least=least)]
    assert found[0] == list(range(tree.n_leaves))
    sizes = sorted((len(leaves) for leaves in below[1:] if len(leaves) >= least), reverse=True)
    assert [len(leaves) for leaves in found[1:]] == sizes[:most]
    assert all(leaves in below[1:] for leaves in found[1:])
