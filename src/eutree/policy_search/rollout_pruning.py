"""Prune a tree by returns of rollouts: cut where the policy loses least, not where labels do.

A tree that copies a teacher is cut to size one node at a time. A node gives way to one of its
children; of some such cuts, drawn at random, those that cost least in a few rollouts are
compared on all of them, and the best is made.
"""

import numpy as np

from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves, with_child
from eutree.world_model.ensemble_rollouts import EnsembleRollouts

TRIED = 24  # cuts that are looked at before one is made
FIRST_LOOK = 40  # episodes, about
BEST = 5  # cuts that are compared on all episodes


def pruned_by_rollouts(
    tree: ActionTree,
    rollouts: EnsembleRollouts,
    max_leaves: int,
    generator: np.random.Generator,
) -> tuple[ActionTree, float]:
    """Return the tree pruned to at most so many leaves, and its score in the rollouts.

    Args:
        tree: The tree.
        rollouts: Where rollouts are run; they end with the result run.
        max_leaves: Most leaves of the result.
        generator: Source of the cuts that are tried.
    """
    rollouts.run(tree)
    while n_leaves(rollouts.policy) > max_leaves:
        rollouts.run(_best_cut(rollouts, generator))
    return rollouts.policy, rollouts.score(rollouts.returns)


def _best_cut(rollouts: EnsembleRollouts, generator: np.random.Generator) -> ActionTree:
    """Return the policy of the rollouts after the best of some cuts."""
    policy = rollouts.policy
    inner = np.flatnonzero(policy.feature >= 0)
    places = generator.permutation(2 * inner.size)[:TRIED]
    few = max(FIRST_LOOK * rollouts.n_episodes // 150, 1)
    few -= few % rollouts.n_members
    few = max(few, rollouts.n_members)
    looked_at = []
    for place in places.tolist():
        rival, _ = with_child(policy, int(inner[place // 2]), goes_left=place % 2 == 0)
        looked_at.append((rollouts.score(rollouts.returns_of(rival, few)), place, rival))
    looked_at.sort(key=lambda one: (-one[0], one[1]))
    best = [
        (rollouts.score(rollouts.returns_of(rival)), place, rival)
        for _, place, rival in looked_at[:BEST]
    ]
    return max(best, key=lambda one: (one[0], -one[1]))[2]
