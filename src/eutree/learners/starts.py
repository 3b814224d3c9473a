"""The paper's three learners: one class with three starts.

| learner      | state tree at the start | history at the start   |
|--------------|-------------------------|------------------------|
| C. U-Tree    | a single leaf           | empty                  |
| EU-Tree - DT | the expert tree         | empty                  |
| EU-Tree      | the expert tree         | the demonstrations     |
"""

from eutree.data import Demonstrations
from eutree.learners.settings import Settings
from eutree.learners.u_tree import UTree
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree

LEARNERS = ("c-u-tree", "eu-tree-dt", "eu-tree")


def c_u_tree(schema: Schema, settings: Settings) -> UTree:
    """Return the Continuous U-Tree: a single leaf, an empty history."""
    return UTree(DecisionTree.single_leaf(schema.n_features), schema.n_actions, settings)


def eu_tree_dt(expert: TreePolicy, settings: Settings) -> UTree:
    """Return the EU-Tree without the demonstrations' transitions: the expert tree alone."""
    return UTree(
        expert.tree,
        expert.schema.n_actions,
        settings,
        inherited=expert.actions,
        locked=expert.locked,
    )


def eu_tree(expert: TreePolicy, demonstrations: Demonstrations, settings: Settings) -> UTree:
    """Return the EU-Tree: the expert tree and the demonstrations' transitions."""
    learner = eu_tree_dt(expert, settings)
    learner.add_demonstrations(demonstrations.kept)
    return learner
