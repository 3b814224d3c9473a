"""The trees that a compression chooses among."""

from dataclasses import replace

import numpy as np

from eutree.arrays import Floats
from eutree.c45 import C45Settings, grow
from eutree.compression.costs import Costs
from eutree.compression.pruning import Prunings, without_unreached
from eutree.policies import TreePolicy
from eutree.trees.grafting import graft
from eutree.trees.merging import merge

# Where some decisions may change: release 8 pruned ever more, in case less is enough.
_CONFIDENCES = (0.25, 0.05, 0.005)


def merged(policy: TreePolicy) -> TreePolicy:
    """Return the policy with equal siblings joined: the same decision everywhere."""
    tree, actions = merge(policy.tree, policy.actions)
    return replace(policy, tree=tree, actions=actions, leaves=None, locked=())


def with_locks(candidate: TreePolicy, policy: TreePolicy) -> TreePolicy:
    """Return the candidate with the locked leaves of ``policy`` in it: their boxes and actions."""
    if not policy.locked:
        return candidate
    n_actions = policy.schema.n_actions
    marks = {leaf: n_actions + leaf for leaf in policy.locked}  # one label each: never joined
    tree, labels, _ = graft(policy.tree, marks, candidate.tree, candidate.actions)
    tree, labels = merge(tree, labels)
    actions = np.concatenate([np.arange(n_actions), policy.actions])[labels]
    locked = tuple(np.flatnonzero(labels >= n_actions).tolist())
    return replace(policy, tree=tree, actions=actions, leaves=None, locked=locked)


def by_c45(policy: TreePolicy, rows: Floats, settings: C45Settings) -> TreePolicy:
    """Return what C4.5 makes of the recorded observations, labelled by the policy."""
    labels = policy.actions[policy.tree.leaf_index(rows)]
    grown = grow(rows, labels, n_classes=policy.schema.n_actions, settings=settings)
    tree, actions = grown.to_decision_tree()
    return merged(replace(policy, tree=tree, actions=actions, leaves=None, locked=()))


def lossless(policy: TreePolicy, rows: Floats) -> dict[str, TreePolicy]:
    """Return the ways that keep the decision on every recorded observation."""
    return {
        "merge": merged(policy),
        "drop": merged(without_unreached(merged(policy), rows)),
        "lossless": by_c45(policy, rows, C45Settings.lossless()),
    }


class Ladder:
    """For each number of leaves the cheapest tree among the prunings of several trees."""

    def __init__(self, policy: TreePolicy, costs: Costs) -> None:
        trees = [
            *lossless(policy, costs.rows).values(),
            by_c45(policy, costs.rows, C45Settings.unpruned()),
            *(by_c45(policy, costs.rows, C45Settings(confidence=cf)) for cf in _CONFIDENCES),
        ]
        self._prunings = [Prunings(tree, costs) for tree in trees]
        self._worst = costs.worst

    def within(self, share: float) -> TreePolicy:
        """Return the smallest tree that costs at most ``share`` of the worst."""
        limit = share * self._worst * (1 + 1e-12)
        sizes = [
            (int((prunings.costs <= limit).argmax()) + 1, float(prunings.costs.min()), number)
            for number, prunings in enumerate(self._prunings)
            if prunings.costs.min() <= limit
        ]
        size, _, number = min(sizes)
        return self._prunings[number].of_size(size)

    def of_size(self, n_leaves: int) -> TreePolicy:
        """Return the cheapest tree of at most so many leaves."""
        found = [
            (float(prunings.costs[min(n_leaves, prunings.costs.size) - 1]), number)
            for number, prunings in enumerate(self._prunings)
        ]
        prunings = self._prunings[min(found)[1]]
        return prunings.of_size(min(n_leaves, prunings.costs.size))

    def rungs(self) -> list[TreePolicy]:
        """Return the cheapest tree of every size that is worth it, the smallest first."""
        rungs: list[TreePolicy] = []
        least = float("inf")
        for size in range(1, max(p.costs.size for p in self._prunings) + 1):
            found = [
                (float(prunings.costs[min(size, prunings.costs.size) - 1]), number)
                for number, prunings in enumerate(self._prunings)
            ]
            cost, number = min(found)
            if cost < least:
                prunings = self._prunings[number]
                rungs.append(prunings.of_size(min(size, prunings.costs.size)))
                least = cost
            if cost <= 0.0:
                break
        return rungs
