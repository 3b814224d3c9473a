"""A tree of at most so many leaves, from labelled and weighted observations.

CART (Breiman et al. 1984) is scikit-learn's: it grows best first up to the limit. C4.5 has no
limit: its tree is cut back to the best pruning of that size, by the weight of wrong decisions.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.c45 import grow
from eutree.compression.candidates import merged
from eutree.compression.costs import Costs
from eutree.compression.pruning import Prunings
from eutree.errors import MissingExtraError
from eutree.policies import TreePolicy
from eutree.policies.sklearn_tree import exact_tree
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree

LEARNERS = ("c4.5", "cart")


@dataclass(frozen=True, eq=False)
class Labelled:
    """Observations with the teacher's action on each.

    Attributes:
        observations: What was sensed.
        actions: What the teacher does there.
        weights: How much a wrong decision counts.
    """

    observations: Floats  # [N, d]
    actions: Integers  # [N]
    weights: Floats  # [N]


def fit(
    learner: str,
    data: Labelled,
    schema: Schema,
    environment: EnvironmentSpec | None,
    max_leaves: int | None,
) -> TreePolicy:
    """Return the tree that a learner makes of labelled observations; equal siblings are joined."""
    make = _c45 if learner == "c4.5" else _cart
    tree, actions = make(data, schema.n_actions, max_leaves)
    policy = merged(TreePolicy(tree, actions, schema, environment))
    if max_leaves is None or policy.n_leaves <= max_leaves:
        return policy
    of_action = np.repeat(data.weights[:, np.newaxis], schema.n_actions, axis=1)  # [N, A]
    of_action[np.arange(data.actions.size), data.actions] = 0.0
    costs = Costs(data.observations, of_action, float(data.weights.sum()))
    return merged(Prunings(policy, costs).of_size(max_leaves))


def _c45(data: Labelled, n_actions: int, max_leaves: int | None) -> tuple[DecisionTree, Integers]:
    grown = grow(data.observations, data.actions, n_classes=n_actions, weights=data.weights)
    return grown.to_decision_tree()


def _cart(data: Labelled, n_actions: int, max_leaves: int | None) -> tuple[DecisionTree, Integers]:
    """Return CART's tree, which decides as scikit-learn's does on every finite observation."""
    try:
        from sklearn.tree import DecisionTreeClassifier
    except ImportError as error:
        raise MissingExtraError("scikit-learn", "sklearn") from error
    limit = max_leaves if max_leaves != 1 else 2  # it knows no tree of one leaf
    model = DecisionTreeClassifier(max_leaf_nodes=limit, random_state=0)
    model.fit(data.observations, data.actions, sample_weight=data.weights)
    tree, leaves = exact_tree(model)
    return tree, model.classes_[model.tree_.value[leaves, 0, :].argmax(axis=1)].astype(np.int64)
