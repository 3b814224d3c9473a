"""A step in one compiled call against a walk, a count and a choice one after the other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.learners import Step
from eutree.learners.u_tree.leaves import LeafSteps
from eutree.mdp import TERMINAL, TabularMDP, TransitionCounts
from eutree.trees import DecisionTree

N_LEAVES, N_ACTIONS = 40, 3


def grown(generator):
    """Return a tree of many leaves over two features."""
    tree = DecisionTree.single_leaf(2)
    for _ in range(N_LEAVES - 1):
        leaf, feature = generator.integers(tree.n_leaves), generator.integers(2)
        tree = tree.split(int(leaf), int(feature), float(generator.random()))
    return tree


def naive_choice(mdp, leaf, prior):
    """Return the first of the best actions that have a Q."""
    known = [(-q, a) for a, q in enumerate(mdp.action_values[leaf].tolist()) if q == q]
    return min(known)[1] if known else int(prior[leaf])


@pytest.mark.parametrize("untried", [None, 0.0])
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10_000), backups=st.integers(0, 5))
def test_it_equals_its_naive_twin(untried, seed, backups):
    """150 steps: more than there is room for at first, in the episode and in the MDP's pool."""
    generator = np.random.default_rng(seed)
    tree, prior = grown(generator), generator.integers(N_ACTIONS, size=N_LEAVES)
    mine, twin = (
        TabularMDP(TransitionCounts(N_LEAVES, N_ACTIONS), 0.9, untried=untried) for _ in range(2)
    )
    steps = LeafSteps()
    for length in (150, 1):
        observations = generator.random((length + 1, 2))
        observations[generator.random(observations.shape) < 0.05] = np.nan
        actions = generator.integers(N_ACTIONS, size=length)
        rewards = generator.normal(size=length)
        leaves = [tree.leaf_of(o) for o in observations.tolist()]
        steps.start(tree, mine, observations[0], generator)
        assert steps.leaf == leaves[0]
        assert steps.greedy(prior) == naive_choice(twin, leaves[0], prior)
        for t in range(length):
            ends = t == length - 1
            row = int(actions[t]), float(rewards[t]), observations[t + 1], ends, False
            steps.add(Step(*row), backups)
            entered = TERMINAL if ends else leaves[t + 1]
            twin.observe(leaves[t], int(actions[t]), float(rewards[t]), entered, backups)
            assert steps.leaf == leaves[t + 1]
            assert steps.greedy(prior) == naive_choice(twin, leaves[t + 1], prior)
            assert len(steps) == t + 1
        episode, mine_leaves, mine_entered = steps.finish()
        assert mine_leaves.tolist() == leaves
        assert mine_entered.tolist() == [*leaves[1:-1], TERMINAL]
        np.testing.assert_array_equal(episode.observations, observations)
        assert episode.actions.tolist() == actions.tolist()
        assert episode.rewards.tolist() == rewards.tolist()
        assert episode.terminated
        assert len(steps) == 0
    states = mine.state(), twin.state()
    assert all(states[0][name].tobytes() == states[1][name].tobytes() for name in states[0])
    assert mine.counts.visits.tolist() == twin.counts.visits.tolist()


@pytest.mark.parametrize(("action", "reward"), [(2, 0.0), (-1, 0.0), (0, np.inf), (0, np.nan)])
def test_a_bad_step_is_refused_and_counts_nothing(action, reward):
    mdp = TabularMDP(TransitionCounts(1, 2), 0.9)
    steps = LeafSteps()
    steps.start(DecisionTree.single_leaf(1), mdp, np.zeros(1), np.random.default_rng(0))
    with pytest.raises(InvalidArgumentError, match=r"a transition must have states in 0\.\.0"):
        steps.add(Step(action, reward, np.zeros(1), False, False), 1)
    assert len(steps) == 0
    assert not mdp.counts.visits.any()


def test_whole_numbers_are_rewards_too():
    mdp = TabularMDP(TransitionCounts(1, 2), 0.9)
    steps = LeafSteps()
    steps.start(DecisionTree.single_leaf(1), mdp, np.zeros(1), np.random.default_rng(0))
    steps.add(Step(np.int64(1), 3, np.zeros(1, dtype=np.float32), np.False_, True), 0)
    assert mdp.counts.reward_sums.tolist() == [[0.0, 3.0]]
