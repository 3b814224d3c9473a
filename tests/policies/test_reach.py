"""Tests beyond all that can come are dropped, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.policies import LeafStatistics, TreePolicy
from eutree.policies.reach import within_reach
from eutree.schema import Schema
from eutree.trees import DecisionTree

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
