"""Tests beyond all that can come are dropped, and nothing else changes."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from eutree.compression import compress
from eutree.compression.smaller_trees import merged, with_locks
from eutree.policies import LeafStatistics, TreePolicy
from eutree.policies.reach import within_kinds, within_reach
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes

BOX = np.array([0.0, -1.0]), np.array([10.0, 1.0])


def policy_of(*cuts):
    """Return a tree of cuts (leaf, feature, threshold) with an action of its own in each leaf."""
    tree = DecisionTree.single_leaf(2)
    for cut in cuts:
        tree = tree.split(*cut)
    n = tree.n_leaves
    known = LeafStatistics(*(np.arange(n * 9.0).reshape(n, 9) for _ in range(3)))
    policy = TreePolicy(tree, np.arange(n), Schema.anonymous(2, 9), leaves=known)
    return replace(policy, locked=(n - 1,))


@pytest.mark.parametrize(
    ("cut", "kept"),
    [((0, 0, 10.0), 0), ((0, 0, 12.0), 0), ((0, 0, -0.5), 1), ((0, 1, 1.5), 0)],
)
def test_a_test_with_one_answer_is_dropped(cut, kept):
    small = within_reach(policy_of(cut), *BOX)
    assert small.n_leaves == 1
    assert small.actions.tolist() == [kept]
    assert small.leaves.visits[0, 0] == 9 * kept
    assert small.locked == ((0,) if kept == 1 else ())


def test_what_can_be_answered_in_two_ways_stays():
    policy = policy_of((0, 0, 9.9), (0, 0, 0.0), (1, 1, -1.0))
    assert within_reach(policy, *BOX) is policy


@pytest.mark.parametrize("seed", range(20))
def test_it_decides_the_same_everywhere_in_the_box(seed):
    chance = np.random.default_rng(seed)
    cuts = [
        (int(chance.integers(k + 1)), int(chance.integers(2)), float(chance.uniform(-6, 16)))
        for k in range(8)
    ]
    policy = policy_of(*cuts)
    small = within_reach(policy, *BOX)
    points = chance.uniform(*BOX, size=(300, 2))
    before = policy.actions[policy.tree.leaf_index(points)]
    assert np.array_equal(small.actions[small.tree.leaf_index(points)], before)
    within = (small.tree.threshold >= BOX[0][small.tree.feature]) & (
        small.tree.threshold < BOX[1][small.tree.feature]
    )
    assert within[small.tree.left >= 0].all()


KINDS = Schema(
    (
        *(Feature(f"mode {one}", low=0, high=1, is_integer=True, group="mode") for one in "ABC"),
        Feature("open", low=0, high=1, is_integer=True),
        Feature("phase", low=1, high=3, is_integer=True, categories=("red", "amber", "green")),
        Feature("tariff", is_integer=True),
        Feature("level"),
    ),
    ("wait", "go"),
)
A, B, C, OPEN, PHASE, TARIFF, LEVEL = range(7)
TARIFFS, LEVELS = range(-3, 4), (-2.0, 0.3, 0.6, 5.0)  # beyond all thresholds, between any two


def everything_allowed():
    """Return every observation that the kinds allow, of quantities one between any two cuts."""
    parts = itertools.product(np.eye(3), (0, 1), (1, 2, 3), TARIFFS, LEVELS)
    return np.array([[*mode, *others] for mode, *others in parts])


ALLOWED = everything_allowed()


def random_policy(seed, schema=KINDS):
    """Return a tree that asks for kinds at random, often for what is decided already."""
    chance = np.random.default_rng(seed)
    tree = DecisionTree.single_leaf(7)
    cuts = {PHASE: (0.5, 1.0, 1.5, 2.5, 3.0), TARIFF: (-1.5, 0.2, 0.7, 1.0), LEVEL: (0.0, 0.5, 1.0)}
    for k in range(14):
        feature = int(chance.integers(7))
        cut = float(chance.choice(cuts.get(feature, (0.0, 0.5, -0.5, 1.0))))
        tree = tree.split(int(chance.integers(k + 1)), feature, cut)
    n = tree.n_leaves
    known = LeafStatistics(*(np.arange(n * 2.0).reshape(n, 2) for _ in range(3)))
    return TreePolicy(tree, chance.integers(2, size=n), schema, leaves=known)


def decisions(policy, rows=ALLOWED):
    return policy.actions[policy.tree.leaf_index(rows)]


def are_all_reached(policy):
    """Return whether each leaf is, of those that tests of quantities alone do not contradict."""
    return set(policy.tree.leaf_index(ALLOWED).tolist()) == set(range(policy.n_leaves))


@pytest.mark.parametrize("seed", range(60))
def test_kinds_leave_each_leaf_an_observation_and_each_observation_its_decision(seed):
    policy = random_policy(seed)
    for small in (within_kinds(policy), merged(policy)):
        assert np.array_equal(decisions(small), decisions(policy))
    assert are_all_reached(merged(policy))
    leaf, was = (one.tree.leaf_index(ALLOWED) for one in (within_kinds(policy), policy))
    known = within_kinds(policy).leaves
    assert np.array_equal(known.visits[leaf], policy.leaves.visits[was])


@pytest.mark.parametrize("seed", range(40))
def test_locked_leaves_stay_whether_they_are_reached_or_not(seed):
    policy = random_policy(seed)
    low, high = leaf_boxes(policy.tree)
    locked = np.flatnonzero((low < high).all(axis=1))[::3]  # some of those no test contradicts
    policy = replace(policy, locked=tuple(locked.tolist()))
    small = within_kinds(policy)
    assert sorted(small.leaves.visits[list(small.locked), 0]) == (2.0 * locked).tolist()
    grafted = with_locks(merged(policy), policy)
    for one in (small, grafted):
        assert len(one.locked) == locked.size
        assert np.array_equal(decisions(one), decisions(policy))
    reached = set(grafted.tree.leaf_index(ALLOWED).tolist())
    assert reached | set(grafted.locked) == set(range(grafted.n_leaves))


@pytest.mark.parametrize("seed", range(20))
def test_without_kinds_nothing_is_dropped(seed):
    plain = Schema.anonymous(7, 2)
    policy = random_policy(seed, plain)
    assert within_kinds(policy) is policy


def test_what_one_member_of_a_group_says_is_not_asked_of_another():
    cuts = [(0, A, 0.5), (1, B, 0.5), (0, B, 0.5), (0, C, 0.5), (0, LEVEL, 0.0)]
    tree = DecisionTree.single_leaf(7).split_each(cuts)
    small = within_kinds(TreePolicy(tree, np.arange(6) % 2, KINDS))
    assert small.n_leaves == 3
    asked = [[int(small.tree.feature[one]) for one in small.tree.path(k)[:-1]] for k in range(3)]
    assert asked == [[A, B], [A, B], [A]]


@pytest.mark.parametrize("mode", ["merge", "auto", "lossless"])
@pytest.mark.parametrize("seed", range(4))
def test_compression_hands_over_no_leaf_that_nothing_reaches(seed, mode):
    policy = random_policy(seed)
    small, _ = compress(policy, ALLOWED, mode=mode)
    assert are_all_reached(small)
    assert np.array_equal(decisions(small), decisions(policy))
