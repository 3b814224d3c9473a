"""Climb in a world model: many small random changes of a policy tree, each kept if it earns more.

What :mod:`eutree.policy_search.improvement` leaves are thresholds that have to move together, or by
less than its few places allow. It takes thousands of rollouts, which cost no step.
"""

from eutree.policy_search.variation import Variation
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves
from eutree.world_model.rollouts import Rollouts

TRIES = 1000
DRAWN = 4  # times that all chance of the rollouts is drawn again: one may be climbed on too long


def climbed(
    rollouts: Rollouts, policy: ActionTree, variation: Variation, *, price: float
) -> ActionTree:
    """Return what many random changes make of a policy.

    Args:
        rollouts: Where to run rollouts.
        policy: The policy to start from.
        variation: Makes the changes.
        price: Return that a leaf must earn.
    """
    for _ in range(DRAWN):
        rollouts.redraw()
        rollouts.run(policy)
        for _ in range(TRIES // DRAWN):
            rival = variation.of(rollouts.policy, rollouts.observations)
            if rival is None:
                continue
            needed = price * (n_leaves(rival) - n_leaves(rollouts.policy))
            gain = rollouts.gain(rival, hopeless=needed)
            if gain.complete and gain.mean > needed:
                rollouts.run(rival)
        policy = rollouts.policy
    return policy
