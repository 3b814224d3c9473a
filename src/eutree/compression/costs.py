"""What it costs to decide otherwise: each recorded observation's cost of each action."""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree

WEIGHTS = ("visits", "q-gap")


@dataclass(frozen=True, eq=False)
class Costs:
    """Cost of each action on each recorded observation.

    Attributes:
        rows: The recorded observations.
        of_action: Cost of each action on each of them; 0 for the policy's own.
        worst: Cost of the most expensive decisions; what costs are a share of.
    """

    rows: Floats  # [N, d]
    of_action: Floats  # [N, A]
    worst: float

    @classmethod
    def of(cls, policy: TreePolicy, rows: Floats, weights: str) -> "Costs":
        """Return what other decisions than the policy's cost.

        ``"visits"``: 1 for every other action, so that a share of the worst is a share of the
        recorded observations. ``"q-gap"``: Q(s, own action) - Q(s, a), never below 0, with the Q
        of the policy's leaves; an action that was never tried counts as the worst of its leaf,
        and a leaf of which nothing else is known like the mean leaf.
        """
        leaves = policy.tree.leaf_index(rows)
        per_leaf = _one_each(policy) if weights == "visits" else _gaps(policy)
        of_action = per_leaf[leaves]
        return cls(rows, of_action, float(of_action.max(axis=1, initial=0.0).sum()))

    def of_leaves(self, tree: DecisionTree) -> Floats:
        """Return the cost of each action at each leaf of a tree, shape [L, A]."""
        total = np.zeros((tree.n_leaves, self.of_action.shape[1]))
        np.add.at(total, tree.leaf_index(self.rows), self.of_action)
        return total

    def share(self, tree: DecisionTree, actions: Integers) -> float:
        """Return what deciding by a tree costs, as a share of the worst; 0 if nothing costs."""
        if self.worst <= 0.0:
            return 0.0
        leaves = tree.leaf_index(self.rows)
        return float(self.of_action[np.arange(leaves.size), actions[leaves]].sum()) / self.worst


def _one_each(policy: TreePolicy) -> Floats:
    cost = np.ones((policy.n_leaves, policy.schema.n_actions))
    cost[np.arange(policy.n_leaves), policy.actions] = 0.0
    return cost


def _gaps(policy: TreePolicy) -> Floats:
    """Return Q(s, own action) - Q(s, a) of each leaf, with what is unknown filled in."""
    if policy.leaves is None or not policy.leaves.compares_actions:
        raise InvalidArgumentError(
            'weights must be "visits" for a policy without values of two actions in a leaf, '
            'got "q-gap"'
        )
    values, own = policy.leaves.values, np.arange(policy.n_leaves)
    gap = np.maximum(values[own, policy.actions][:, np.newaxis] - values, 0.0)  # [L, A]
    gap[own, policy.actions] = np.nan
    known = ~np.isnan(gap)
    mean = float(gap[known].mean()) if known.any() else 1.0
    worst = np.where(known, gap, -np.inf).max(axis=1, initial=-np.inf)
    worst = np.where(known.any(axis=1), worst, mean)
    filled = np.where(known, gap, worst[:, np.newaxis])
    filled[own, policy.actions] = 0.0
    return filled
