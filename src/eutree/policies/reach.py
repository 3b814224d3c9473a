"""A policy of other leaves: without tests that all observations answer alike, or edited."""

from dataclasses import replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.policies.tree_policy import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.boxes import possible_nodes
from eutree.trees.edit import holding, reachable


def within_reach(policy: TreePolicy, low: Floats, high: Floats) -> TreePolicy:
    """Return the policy without tests beyond a box; the same one where there are none.

    A cut made in a model of the world may lie beyond all observations of the world.
    """
    tree = policy.tree
    inner = np.flatnonzero(tree.feature != tree.NO_FEATURE)
    feature, threshold = tree.feature[inner], tree.threshold[inner]
    reached = np.ones(tree.n_nodes, dtype=np.bool_)
    reached[tree.left[inner]] = threshold >= low[feature]
    reached[tree.right[inner]] = threshold < high[feature]
    return _reached(policy, reached)


def within_kinds(policy: TreePolicy) -> TreePolicy:
    """Return the policy without tests that the kinds of features answer; the same one if none.

    The tests above may leave one answer only: below ``mode is A`` no ``mode is B`` is true. So
    every observation that the kinds allow gets its leaf, and each leaf has some. Locked leaves
    stay, whether any observation reaches them or not.
    """
    held = holding(policy.tree, policy.locked)
    return _reached(policy, held | possible_nodes(policy.tree, policy.schema))


def _reached(policy: TreePolicy, reached: Booleans) -> TreePolicy:
    """Return the policy without the tests that have a child which is not reached."""
    tree, leaves = reachable(policy.tree, reached)
    return policy if tree.n_leaves == policy.n_leaves else with_pieces(policy, tree, leaves)


def with_pieces(policy: TreePolicy, tree: DecisionTree, pieces: Integers) -> TreePolicy:
    """Return the policy with another tree, whose leaves are pieces of its own leaves.

    Their numbers are ``pieces``, [L]; of a negative one, a new leaf, nothing is known or locked.
    """
    known, ranks = policy.leaves, policy.ranks
    return replace(
        policy,
        tree=tree,
        actions=policy.actions[pieces],
        leaves=known and known.of(pieces),
        ranks=None if ranks is None else np.where(pieces[:, np.newaxis] < 0, 0, ranks[pieces]),
        locked=tuple(np.flatnonzero(np.isin(pieces, policy.locked)).tolist()),
    )


def with_actions(policy: TreePolicy, actions: Integers) -> TreePolicy:
    """Return the policy with these actions of its leaves, [L].

    Where actions may be masked, a leaf that has its old one falls back on the same as before,
    whatever becomes of the leaves around it.
    """
    ranks = policy.ranks
    if policy.masked:
        same = np.equal(actions, policy.actions)[:, np.newaxis]
        ranks = np.where(same, np.argsort(policy.orders, axis=1), 0)
    return replace(policy, actions=actions, ranks=ranks)


def among_allowed(policy: TreePolicy, observations: Floats, allowed: Booleans) -> TreePolicy:
    """Return a policy whose leaves name no action that was never allowed where they decided.

    Such a leaf names the first action of its order that was; what follows is found anew. Actions
    were masked at ``observations``, [N, d], where those of ``allowed``, [N, A], were left.
    """
    ever = ever_allowed(policy, observations, allowed)
    ever[list(policy.locked)] = True
    inside = np.take_along_axis(ever, policy.orders, axis=1).argmax(axis=1)
    return replace(policy, actions=policy.orders[np.arange(policy.n_leaves), inside], masked=True)


def ever_allowed(policy: TreePolicy, observations: Floats, allowed: Booleans) -> Booleans:
    """Return which actions were ever allowed where each leaf decides, shape [L, A].

    Of a leaf that none of the observations [N, d] reached nothing is known: all are.
    """
    ever = np.zeros((policy.n_leaves, allowed.shape[1]), dtype=np.bool_)
    np.logical_or.at(ever, policy.tree.leaf_index(observations), allowed)
    ever[~ever.any(axis=1)] = True
    return ever
