"""CART of eutree.cart: against a naive twin, on a textbook's numbers, at its limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.cart import grow_cart
from eutree.errors import InvalidArgumentError
from tests import naive_cart


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), max_leaves=st.integers(1, 7), weighted=st.booleans())
def test_each_cut_gains_as_much_as_the_naive_one(seed, max_leaves, weighted):
    generator = np.random.default_rng(seed)
    observations = generator.integers(0, 5, (24, 3)).astype(float)  # with many ties
    labels = generator.integers(0, 3, 24)
    weights = generator.random(24).round(2) if weighted else np.ones(24)
    tree, actions = grow_cart(
        observations, labels, n_classes=3, max_leaves=max_leaves, weights=weights
    )
    first = naive_cart.best_gain(observations, labels, weights, 3)
    own = naive_cart.impurity(labels, weights, 3)
    assert tree.n_leaves <= max_leaves
    two, _ = grow_cart(observations, labels, n_classes=3, max_leaves=2, weights=weights)
    after = naive_cart.total_impurity(two, observations, labels, weights, 3)
    assert own - after == pytest.approx(first, abs=1e-9)
    counts = np.zeros((tree.n_leaves, 3))
    np.add.at(counts, (tree.leaf_index(observations), labels), weights)
    assert (counts[np.arange(tree.n_leaves), actions] >= counts.max(axis=1) - 1e-12).all()


@pytest.mark.parametrize("seed", range(5))
def test_the_leaf_that_gains_most_is_cut_first(seed):
    generator = np.random.default_rng(seed)
    observations = generator.standard_normal((60, 2))
    labels = ((observations[:, 0] > 0) + 2 * (observations[:, 1] > 0.5)) % 3
    weights = generator.random(60)
    path = naive_cart.best_first(observations, labels, weights, 3, 8)
    for n_leaves, expected in enumerate(path, start=1):
        tree, _ = grow_cart(observations, labels, n_classes=3, max_leaves=n_leaves, weights=weights)
        mine = naive_cart.total_impurity(tree, observations, labels, weights, 3)
        assert mine == pytest.approx(expected, abs=1e-8)


def test_exclusive_or_is_learned_and_thresholds_lie_between_values():
    observations = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0]])
    labels = np.array([0, 1, 1, 0, 0])
    tree, actions = grow_cart(observations, labels, n_classes=2, max_leaves=8)
    assert actions[tree.leaf_index(observations)].tolist() == labels.tolist()
    assert set(tree.threshold[~np.isnan(tree.threshold)]) == {0.5}


def test_neighbouring_doubles_are_told_apart():
    low = 1.0
    high = np.nextafter(low, 2.0)
    tree, actions = grow_cart(
        np.array([[low], [high]]), np.array([1, 0]), n_classes=2, max_leaves=2
    )
    assert actions[tree.leaf_index(np.array([[low], [high]]))].tolist() == [1, 0]


def test_nothing_is_cut_for_nothing():
    tree, actions = grow_cart(
        np.arange(5.0)[:, np.newaxis], np.full(5, 2), n_classes=3, max_leaves=9
    )
    assert (tree.n_leaves, actions.tolist()) == (1, [2])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"labels": np.array([0, 3])}, "labels must be below 2, got 3"),
        ({"weights": np.array([1.0, -1.0])}, r"weights must be at least 0, got -1\.0"),
        ({"max_leaves": 0}, "max_leaves must be an integer >= 1, got 0"),
        ({"observations": np.zeros((0, 1)), "labels": np.zeros(0, int)}, "at least one row"),
    ],
)
def test_bad_input_is_refused(changes, message):
    arguments = {"observations": np.zeros((2, 1)), "labels": np.array([0, 1])} | changes
    observations = arguments.pop("observations")
    labels = arguments.pop("labels")
    with pytest.raises(InvalidArgumentError, match=message):
        grow_cart(observations, labels, **({"n_classes": 2, "max_leaves": 2} | arguments))
