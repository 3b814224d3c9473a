"""The learner's tree, history and MDP agree with a naive rebuild; its phases follow Table 1."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners import PAPER, PAPER_D, Start, Step, UTree
from eutree.mdp import TabularMDP, TransitionCounts
from eutree.trees import DecisionTree
from tests import naive_learning
from tests.worlds import FEW_DRAWS, Walk, learned_to_walk, take

PRESETS = {"paper": PAPER, "paper-d": PAPER_D, "corrected": FEW_DRAWS}


@pytest.mark.promise(19)
@pytest.mark.parametrize("preset", PRESETS)
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_labels_and_counts_equal_a_rebuild_from_the_tuples(preset, seed):
    learner = learned_to_walk(PRESETS[preset], seed)
    history = learner.history
    left, entered = naive_learning.labels_of(learner.tree, history)
    assert history.left.tolist() == left
    assert history.entered.tolist() == entered
    rebuilt = TabularMDP(TransitionCounts(learner.tree.n_leaves, 2), learner.method.discount)
    rebuilt.counts.observe(history.left, history.actions, history.rewards, history.entered)
    assert learner.mdp.counts.visits.tolist() == rebuilt.counts.visits.tolist()
    assert learner.mdp.counts.reward_sums.tobytes() == rebuilt.counts.reward_sums.tobytes()
    for leaf in range(learner.tree.n_leaves):
        for action in range(2):
            mine, theirs = (
                learner.mdp.counts.successors(leaf, action),
                rebuilt.counts.successors(leaf, action),
            )
            assert [a.tolist() for a in mine] == [a.tolist() for a in theirs]


@pytest.mark.parametrize("preset", PRESETS)
def test_it_learns_to_walk_on(preset):
    learner = learned_to_walk(PRESETS[preset], phases=4)
    goes = learner.greedy_actions()[learner.tree.leaf_index([[x, 0.5] for x in np.arange(9)])]
    assert goes.mean() > 0.7


@pytest.mark.parametrize("preset", PRESETS)
def test_what_it_decided_stays_as_it_was(preset):
    learner = learned_to_walk(PRESETS[preset], phases=1)
    before = learner.decisions().policy(Walk.problem).to_bytes()
    policy = learner.decisions().policy(Walk.problem)
    Walk(np.random.default_rng(9)).run(learner, np.random.default_rng(10))
    assert policy.to_bytes() == before != learner.decisions().policy(Walk.problem).to_bytes()


def test_value_differs_away_from_the_end_too():
    """A target that uses V of the same leaf (Eq. 2 as printed) splits near the reward only."""
    settings_ = replace(PAPER, discount=0.9, exploration=0.0, untried_value=0.0)
    learner = learned_to_walk(settings_, phases=6)
    thresholds = learner.tree.threshold[learner.tree.feature == 0]
    assert thresholds.min() < 5 < thresholds.max()


@pytest.mark.parametrize("preset", PRESETS)
def test_a_learner_restored_from_its_state_goes_on_to_the_same_bytes(preset):
    original = learned_to_walk(PRESETS[preset])
    state = {k: v.copy() for k, v in original.state().items()}
    copy = PRESETS[preset].restore(Walk.problem, Start(), state)
    for learner in (original, copy):
        world, generator = Walk(np.random.default_rng(5)), np.random.default_rng(6)
        for _ in range(10):
            world.run(learner, generator)
        learner.update(generator)
    mine, theirs = original.state(), copy.state()
    assert mine.keys() == theirs.keys()
    assert all(mine[k].tobytes() == theirs[k].tobytes() for k in mine)


def test_a_discarded_episode_leaves_no_trace():
    learner = learned_to_walk(PAPER)
    before = learner.state()
    learner.start_episode(np.zeros(2), np.random.default_rng(0))
    for step in range(7):
        action = learner.act()
        learner.observe(Step(action, -3.25, np.array([step, 0.5]), False, False))
    learner.discard_episode()
    after = learner.state()
    assert all(before[k].tobytes() == after[k].tobytes() for k in before)
    learner.update(np.random.default_rng(0))


def test_updating_within_an_episode_is_refused():
    learner = learned_to_walk(PAPER)
    learner.start_episode(np.zeros(2), np.random.default_rng(0))
    learner.observe(Step(1, 0.0, np.ones(2), False, False))
    with pytest.raises(InvalidArgumentError, match="between episodes"):
        learner.update(np.random.default_rng(0))


def test_a_truncated_episode_is_not_terminal_and_a_terminated_one_is():
    for terminated, last in ((True, -1), (False, 0)):
        learner = UTree(DecisionTree.single_leaf(1), 2, PAPER)
        learner.start_episode(np.zeros(1), np.random.default_rng(0))
        take(learner, (1, 5.0, np.ones(1), terminated, not terminated))
        assert learner.history.entered.tolist() == [last]
        assert learner.mdp.counts.successors(0, 1)[0].tolist() == [last]


def test_only_leaves_that_exist_at_the_start_are_split_in_one_expansion():
    learner = learned_to_walk(PAPER, phases=1, episodes=60)
    assert learner.tree.n_leaves == 2


def test_demonstrations_fill_the_first_q_table():
    episode = Episode(
        observations=np.arange(4.0)[:, None],
        actions=np.array([1, 0, 1]),
        rewards=np.array([0.0, -2.0, 100.0]),
        terminated=True,
        truncated=False,
    )
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.5).split(1, 0, 1.5)
    learner = UTree(tree, 2, replace(PAPER, discount=1.0))
    learner.add_demonstrations([episode])
    np.testing.assert_allclose(learner.mdp.values, [98.0, 98.0, 100.0], atol=1e-5)
    assert learner.mdp.counts.visits.tolist() == [[0, 1], [1, 0], [0, 1]]
