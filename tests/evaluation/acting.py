"""Policies that are evaluated."""

import numpy as np

from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree


def random_policy(n_features, *, n_leaves=30, history=0, seed=0):
    generator = np.random.default_rng(seed)
    size = n_features * (history + 1)
    tree = DecisionTree.single_leaf(size)
    for _ in range(n_leaves - 1):
        tree = tree.split(
            leaf=int(generator.integers(tree.n_leaves)),
            feature=int(generator.integers(size)),
            threshold=float(generator.uniform(-10, 25)),
        )
    actions = (generator.random(n_leaves) < 0.7).astype(int)
    schema = Schema.anonymous(n_features, 2).with_history(history)
    return TreePolicy(tree, actions, schema, history=history)
