"""Compiled step of a learner in the leaves of a tree: where it led, its lesson, the next action.

The loops of :mod:`eutree.mdp._kernels_sweeping` and :mod:`eutree.trees._kernels` are compiled into
these: after a change there, remove the cached machine code of these too (``__pycache__``).
"""

import numpy as np

from eutree.arrays import Floats
from eutree.compiled import compiled
from eutree.mdp import DONE, TERMINAL, MDPArrays, observe
from eutree.trees import TreeNodes, descend

UNKNOWN = -1  # choice in a leaf in which nothing was tried
REFUSED = -2  # choice where the MDP took nothing: it has no room, or the transition is a bad one


@compiled
def arrive(nodes: TreeNodes, mdp: MDPArrays, observation: Floats) -> tuple[int, int]:
    """Return the leaf of an observation [d] and its greedy action (Eq. 1), or ``UNKNOWN``."""
    leaf = descend(nodes, observation, 0)
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
    nodes: TreeNodes,
    mdp: MDPArrays,
    observation: Floats,  # [d]
    leaf: int,
    action: int,
    reward: float,
    terminated: bool,
    backups: int,
) -> tuple[int, int]:
    """Take into the MDP a step that left ``leaf`` and led to an observation; return its leaf.

    Return also its greedy action after the backups, ``UNKNOWN``, or ``REFUSED`` with the MDP as it
    was.
    """
    # The leaf is looked up before anything changes, and its action after: backups change Q.
    led_to = descend(nodes, observation, 0)
    entered = TERMINAL if terminated else led_to
    if observe(mdp, leaf, action, reward, entered, backups) != DONE:
        return led_to, REFUSED
    return led_to, greedy(mdp, led_to)
