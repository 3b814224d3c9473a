"""Random policies, and what they do."""

import numpy as np

from eutree.policies import TreePolicy
from eutree.schema import Schema
from tests import naive_trees


def random_policy(seed, n_leaves, n_actions=2):
    generator = np.random.default_rng(seed)
    tree = naive_trees.random_tree(generator, n_leaves, 3, n_values=12)
    actions = generator.integers(0, n_actions, n_leaves)
    return TreePolicy(tree, actions, Schema.anonymous(3, n_actions))


def actions_on(policy, observations):
    return policy.actions[policy.tree.leaf_index(observations)]
