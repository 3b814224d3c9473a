"""A crossing."""

import numpy as np

from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree


def crossing(statistics=None):
    schema = Schema((Feature("position", "m", 0.0, 30.0), Feature("gap", "s")), ("stop", "go"))
    tree = DecisionTree.single_leaf(2).split(0, 0, 8.0).split(0, 1, 2.5)
    return TreePolicy(tree, np.array([0, 1, 1]), schema, leaves=statistics)
