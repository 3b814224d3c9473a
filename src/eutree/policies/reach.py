"""A policy without the tests that no observation can answer in two ways."""

from dataclasses import replace

from eutree.arrays import Floats
from eutree.policies.leaf_statistics import LeafStatistics
from eutree.policies.tree_policy import TreePolicy
from eutree.trees.edit import reachable


def within_reach(policy: TreePolicy, low: Floats, high: Floats) -> TreePolicy:
    """Return the policy without tests beyond a box; the same one where there are none.

    What a learner cuts in a model of the world may lie where nothing of the world does.

    Args:
        policy: The policy.
        low: Smallest value of each feature that may come, shape [d].
        high: Largest value of each feature that may come, shape [d].
    """
    tree, leaves = reachable(policy.tree, low, high)
    if tree.n_leaves == policy.n_leaves:
        return policy
    known, locked = policy.leaves, set(policy.locked)
    if known is not None:
        known = LeafStatistics(known.visits[leaves], known.values[leaves], known.deviations[leaves])
    return replace(
        policy,
        tree=tree,
        actions=policy.actions[leaves],
        leaves=known,
        locked=tuple(new for new, leaf in enumerate(leaves.tolist()) if leaf in locked),
    )
