"""The MDP over the leaves, counted from the transitions that are stored (Eqs. 3, 4).

A history that forgets takes transitions back from the counts; V, Q and the queue stay.
"""

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.learners.history import History
from eutree.learners.u_tree.discretizer import Discretizer
from eutree.learners.u_tree.leaf_steps import LeafEpisode
from eutree.mdp import TabularMDP, TransitionCounts


def counted(history: History, n_leaves: int, n_actions: int, method: Discretizer) -> TabularMDP:
    """Return the MDP of the stored transitions, not solved."""
    rows = history.left, history.actions, history.rewards, history.entered
    counts = TransitionCounts.of(*rows, n_states=n_leaves, n_actions=n_actions)
    return TabularMDP(counts, method.discount, untried=method.untried_value)


def counted_again(mdp: TabularMDP, history: History, method: Discretizer) -> TabularMDP:
    """Return the MDP of the transitions that are stored now, with V, Q and the queue of ``mdp``."""
    again = counted(history, mdp.n_states, mdp.counts.n_actions, method)
    again.restore(mdp.state() | {"reward_sums": again.counts.reward_sums.copy()})
    return again


def uncount(
    mdp: TabularMDP, rewards_before: Floats, episode: LeafEpisode, stored: Booleans
) -> None:
    """Take back the counts of those transitions of the last episode that were not stored.

    Args:
        mdp: The MDP, in which all are counted.
        rewards_before: Its reward sums before the episode, shape [L, A].
        episode: The episode.
        stored: Which of its transitions are stored, shape [T].
    """
    left, actions, rewards = episode.leaves[:-1], episode.steps.actions, episode.steps.rewards
    out = ~stored
    mdp.counts.forget(left[out], actions[out], rewards[out], episode.entered[out])
    state = mdp.state()
    state["reward_sums"] = rewards_before  # to the bit: as if never added
    np.add.at(state["reward_sums"], (left[stored], actions[stored]), rewards[stored])
    mdp.restore(state)
