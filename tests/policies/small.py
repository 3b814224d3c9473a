"""A policy of few leaves."""

import numpy as np

from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees import DecisionTree


def small_policy():
    tree = DecisionTree.single_leaf(2).split(0, 0, 0.5).split(1, 1, -1.25)
    schema = Schema((Feature("position", "m", 0.0), Feature("speed", "m/s")), ("stop", "go"))
    statistics = LeafStatistics(
        np.array([[1, 2], [3, 0], [0, 0]]),
        np.array([[0.1, 2.0], [3.0, np.nan], [np.nan, np.nan]]),
        np.full((3, 2), np.nan),
    )
    environment = EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 4.2})
    return TreePolicy(tree, np.array([0, 1, 1]), schema, environment, leaves=statistics)
