"""The history's labels and lists always equal those of a naive recount."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.learners.history import History
from eutree.learners.u_tree import LambdaReturn, OneStep
from eutree.trees import DecisionTree
from tests import naive_learning
from tests.learners.histories import assert_consistent

N_FEATURES = 2


def add_episode(history, tree, generator):
    steps = int(generator.integers(0, 30))
    observations = generator.integers(0, 5, (steps + 1, N_FEATURES)).astype(float)
    history.append_episode(
        observations,
        generator.integers(0, 2, steps),
        generator.integers(-2, 3, steps).astype(float),
        tree.leaf_index(observations),
        terminated=bool(generator.integers(2)),
    )


def random_history(generator, n_operations):
    tree = DecisionTree.single_leaf(N_FEATURES)
    history = History(N_FEATURES, 1)
    for _ in range(n_operations):
        if generator.random() < 0.6:
            add_episode(history, tree, generator)
            continue
        leaf = int(generator.integers(tree.n_leaves))
        feature = int(generator.integers(N_FEATURES))
        threshold = float(generator.integers(-1, 6)) + 0.5
        tree = tree.split(leaf, feature, threshold)
        history.split(leaf, tree.n_leaves - 1, feature, threshold)
    return tree, history


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), n_operations=st.integers(1, 25))
def test_labels_and_lists_equal_a_recount(seed, n_operations):
    tree, history = random_history(np.random.default_rng(seed), n_operations)
    assert_consistent(tree, history)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_split_reports_exactly_the_rows_it_touches(seed):
    generator = np.random.default_rng(seed)
    tree, history = random_history(generator, 12)
    before_left, before_entered = history.left.copy(), history.entered.copy()
    leaf = int(generator.integers(tree.n_leaves))
    moved = history.split(leaf, tree.n_leaves, 0, 2.5)
    touched = np.flatnonzero((before_left == leaf) | (before_entered == leaf))
    assert moved.rows.tolist() == touched.tolist()
    assert moved.leaving.tolist() == np.flatnonzero(before_left == leaf).tolist()
    assert moved.old_left.tolist() == before_left[touched].tolist()
    assert moved.old_entered.tolist() == before_entered[touched].tolist()
    assert moved.new_left.tolist() == history.left[touched].tolist()
    assert moved.new_entered.tolist() == history.entered[touched].tolist()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), decay=st.sampled_from([0.0, 0.5, 0.95, 1.0]))
def test_targets_equal_their_definitions(seed, decay):
    generator = np.random.default_rng(seed)
    tree, history = random_history(generator, 12)
    values = generator.normal(size=tree.n_leaves)
    greedy = generator.integers(0, 2, tree.n_leaves).astype(np.int32)
    rows = np.flatnonzero(generator.random(history.size) < 0.5)
    given_ = {"values": values, "greedy": lambda: greedy, "discount": 0.9}
    one_step = [naive_learning.one_step_target(history, r, values, 0.9) for r in rows]
    np.testing.assert_allclose(OneStep().of(history, rows, **given_), one_step, atol=1e-12)
    returns = [naive_learning.lambda_target(history, r, values, greedy, 0.9, decay) for r in rows]
    got = LambdaReturn(decay).of(history, rows, **given_)
    np.testing.assert_allclose(got, returns, atol=1e-12)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_goes_on_alone(copied):
    generator = np.random.default_rng(0)
    tree, history = random_history(generator, 12)
    again, size = copied(history), history.size
    add_episode(again, tree, generator)
    assert again.size > history.size == size
    assert_consistent(tree, again)
    assert_consistent(tree, history)


def test_memory_of_a_transition_stays_below_120_bytes():
    history = History(3, 1)
    generator = np.random.default_rng(0)
    tree = DecisionTree.single_leaf(3)
    for _ in range(2000):
        observations = generator.random((26, 3))
        history.append_episode(
            observations,
            generator.integers(0, 2, 25),
            generator.random(25),
            tree.leaf_index(observations),
            terminated=True,
        )
        if history.size > 1000:
            assert history.columns.nbytes / history.size <= 120
