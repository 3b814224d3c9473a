"""Compiled step of a learner in the leaves of a tree: where it led, what it taught, what to do.

The loops of :mod:`eutree.mdp._kernels_sweeping` are compiled into these: after a change there,
remove the cached machine code of these too (``__pycache__``).
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import compiled
from eutree.mdp import DONE, TERMINAL, MDPArrays, observe

UNKNOWN = -1  # choice in a leaf in which nothing was tried
REFUSED = -2  # choice where the MDP took nothing: it has no room, or the transition is a bad one


class TreeArrays(NamedTuple):
    """The arrays of a decision tree, with their meaning there."""

    feature: Int32s  # [M]
    threshold: Floats  # [M]
    left: Int32s  # [M]
    right: Int32s  # [M]
    leaf: Int32s  # [M]


class EpisodeArrays(NamedTuple):
    """The episode under way, with room for C steps: o, L(o), a and r of the present step at t."""

    observations: Floats  # [C + 1, d]
    leaves: Int32s  # [C + 1]
    actions: Integers  # [C]
    rewards: Floats  # [C]


@compiled
def arrive(tree: TreeArrays, mdp: MDPArrays, episode: EpisodeArrays, t: int) -> tuple[int, int]:
    """Write the leaf of observation t; return it and its greedy action (Eq. 1), or ``UNKNOWN``."""
    node = 0
    while tree.feature[node] >= 0:  # the observation is in the box of ``node``; NaN goes right
        if episode.observations[t, tree.feature[node]] <= tree.threshold[node]:
            node = tree.left[node]
        else:
            node = tree.right[node]
    leaf = int(tree.leaf[node])
    episode.leaves[t] = leaf
    return leaf, greedy(mdp, leaf)


@compiled
def greedy(mdp: MDPArrays, leaf: int) -> int:
    """Return the first action of highest Q in a leaf, or ``UNKNOWN``; NaN is no Q."""
    best, best_value = UNKNOWN, -np.inf
    for action in range(mdp.action_values.shape[1]):  # best is that of the actions before
        if mdp.action_values[leaf, action] > best_value:
            best, best_value = action, mdp.action_values[leaf, action]
    return best


@compiled
def step(
    tree: TreeArrays,
    mdp: MDPArrays,
    episode: EpisodeArrays,
    t: int,
    action: int,
    reward: float,
    terminated: bool,
    backups: int,
) -> tuple[int, int]:
    """Take step t, which led to observation t + 1, into episode and MDP.

    Returns:
        The leaf that was entered, and its greedy action after the backups, ``UNKNOWN``, or
        ``REFUSED`` with the MDP unchanged.
    """
    leaf, _ = arrive(tree, mdp, episode, t + 1)
    episode.actions[t] = action
    episode.rewards[t] = reward
    entered = TERMINAL if terminated else leaf
    if observe(mdp, int(episode.leaves[t]), action, reward, entered, backups) != DONE:
        return leaf, REFUSED
    return leaf, greedy(mdp, leaf)
