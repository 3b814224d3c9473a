"""Policies whose thresholds lie on a lattice."""

import numpy as np

from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from tests import naive_trees


def lattice_policy(generator, n_features, n_actions=2, size=6):
    """Return a policy with thresholds on a lattice and bounds 0 and ``size``."""
    tree = naive_trees.random_tree(generator, int(generator.integers(1, 12)), n_features)
    schema = Schema(
        tuple(Feature(f"x{j}", "m", 0.0, float(size)) for j in range(n_features)),
        tuple(f"do {action}" for action in range(n_actions)),
    )
    return TreePolicy(tree, generator.integers(0, n_actions, tree.n_leaves), schema)


def lattice(policy):
    return naive_trees.cells(*np.array([(f.low, f.high) for f in policy.schema.features]).T)
