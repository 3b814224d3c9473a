"""Leaves as boxes, and the exact share of a box on which two trees disagree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import disagreement, leaf_boxes
from eutree.trees.edit import merge
from tests import naive_trees

seeds = st.integers(0, 2**32)


def numbers(n_features):
    return Schema([Feature(f"x{j}") for j in range(n_features)], ["a", "b", "c"])


def labelled(generator, n_features):
    tree = naive_trees.random_tree(generator, int(generator.integers(1, 14)), n_features)
    return tree, generator.integers(0, 3, tree.n_leaves)


@settings(max_examples=80, deadline=None)
@given(seed=seeds)
def test_an_observation_is_in_the_box_of_its_leaf_and_in_no_other(seed):
    generator = np.random.default_rng(seed)
    tree, _ = labelled(generator, 2)
    points = generator.integers(-1, 8, (40, 2)) + generator.choice([0.0, 0.5], (40, 2))
    low, high = leaf_boxes(tree)
    inside = ((low[None] < points[:, None]) & (points[:, None] <= high[None])).all(axis=2)
    assert inside.sum(axis=1).tolist() == [1] * 40
    assert inside.argmax(axis=1).tolist() == tree.leaf_index(points).tolist()


@settings(max_examples=120, deadline=None)
@given(seed=seeds, flat=st.booleans())
def test_disagreement_equals_a_count_of_cells(seed, flat):
    generator = np.random.default_rng(seed)
    n_features = int(generator.integers(1, 4))
    first, second = labelled(generator, n_features), labelled(generator, n_features)
    low = generator.integers(-1, 3, n_features).astype(float)
    high = low + generator.integers(1, 6, n_features)
    if flat:
        high[0] = low[0]
    expected = naive_trees.disagreement(*first, *second, low, high)
    found = disagreement(*first, *second, (low, high), numbers(n_features))
    assert found == pytest.approx(expected, abs=1e-12)


@settings(max_examples=120, deadline=None)
@given(seed=seeds)
def test_only_observations_that_can_be_count_towards_disagreement(seed):
    generator = np.random.default_rng(seed)
    colours = [
        Feature(f"colour is {k}", low=0, high=1, is_integer=True, group="colour") for k in range(3)
    ]
    count = Feature("count", low=-1, high=4, is_integer=True)
    schema = Schema([*colours, count], ["a", "b", "c"])
    possible = np.array([[*one, n] for one in np.eye(3) for n in range(-1, 5)])
    first, second = labelled(generator, 4), labelled(generator, 4)
    decided = [labels[tree.leaf_index(possible)] for tree, labels in (first, second)]
    box = np.array([0.0, 0.0, 0.0, -1.0]), np.array([1.0, 1.0, 1.0, 4.0])
    expected = np.mean(decided[0] != decided[1])
    assert disagreement(*first, *second, box, schema) == pytest.approx(expected, abs=1e-12)


def test_disagreement_of_a_known_pair():
    one = DecisionTree.single_leaf(1).split(0, 0, 3.0)
    other = DecisionTree.single_leaf(1).split(0, 0, 4.0)
    labels = np.array([0, 1])
    share = disagreement(
        one, labels, other, labels, (np.array([0.0]), np.array([10.0])), numbers(1)
    )
    assert share == pytest.approx(0.1)


def test_an_infinite_box_is_refused():
    tree, labels = DecisionTree.single_leaf(1), np.array([0])
    with pytest.raises(InvalidArgumentError, match="the box must be finite"):
        disagreement(tree, labels, tree, labels, (np.array([-np.inf]), np.array([1.0])), numbers(1))


@settings(max_examples=120, deadline=None)
@given(seed=seeds)
def test_merging_never_changes_an_answer_not_even_of_nan(seed):
    generator = np.random.default_rng(seed)
    n_features = int(generator.integers(1, 4))
    tree, labels = labelled(generator, n_features)
    merged, merged_labels = merge(tree, labels)
    assert merged.n_leaves <= tree.n_leaves
    lattice = np.concatenate([np.arange(-1, 7), np.arange(-1, 7) + 0.5, [np.nan, np.inf, -np.inf]])
    points = generator.choice(lattice, (300, n_features))
    before = labels[tree.leaf_index(points)]
    assert merged_labels[merged.leaf_index(points)].tolist() == before.tolist()
    again, _ = merge(merged, merged_labels)
    assert again.n_leaves == merged.n_leaves


def test_merging_joins_siblings_through_dropped_tests():
    tree = DecisionTree.single_leaf(1).split(0, 0, 5.0).split(0, 0, 7.0).split(1, 0, 2.0)
    merged, labels = merge(tree, np.array([1, 1, 0, 1]))
    assert (merged.n_leaves, labels.tolist()) == (1, [1])
