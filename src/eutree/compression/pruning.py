"""The best prunings of a tree: for every number of leaves, the one that costs least.

A pruning turns some inner nodes into leaves. What the leaves of a subtree cost does not depend on
the rest of the tree, so the best pruning of every size follows bottom-up from those of the two
subtrees (the knapsack on trees): exact, in time proportional to the square of the leaves.
"""

from dataclasses import replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.compression.costs import Costs
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.merging import INNER, rebuild


class Prunings:
    """All best prunings of one policy.

    Attributes:
        costs: Least cost with 1, 2, ... leaves, in that order; never rises.
    """

    def __init__(self, policy: TreePolicy, costs: Costs) -> None:
        tree = policy.tree
        self.policy = policy
        self._total = node_totals(tree, costs.of_leaves(tree))  # [M, A]
        self._best: list[Floats] = [np.empty(0)] * tree.n_nodes
        for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
            alone = np.array([self._total[node].min()])
            if tree.feature[node] != tree.NO_FEATURE:
                split = _combined(self._best[tree.left[node]], self._best[tree.right[node]])
                alone = np.minimum.accumulate(np.concatenate([alone, split]))
            self._best[node] = alone
        self.costs = self._best[0]

    def of_size(self, n_leaves: int) -> TreePolicy:
        """Return the cheapest pruning with at most so many leaves."""
        tree = self.policy.tree
        label = np.full(tree.n_nodes, INNER, dtype=np.int64)
        work = [(0, n_leaves)]
        while work:
            node, size = work.pop()
            left, right = int(tree.left[node]), int(tree.right[node])
            cost = self._best[node][size - 1]
            size = int((self._best[node] <= cost).argmax()) + 1  # no leaf for nothing
            if self._total[node].min() <= cost:
                label[node] = self._total[node].argmin()
                continue
            ones, others = self._best[left], self._best[right]
            lefts = np.arange(max(1, size - others.size), min(ones.size, size - 1) + 1)
            sums = ones[lefts - 1] + others[size - lefts - 1]
            chosen = int(lefts[sums.argmin()])
            work += [(left, chosen), (right, size - chosen)]
        return _rebuilt(self.policy, np.arange(tree.n_nodes), label)


def without_unreached(policy: TreePolicy, rows: Floats) -> TreePolicy:
    """Return the policy without the tests that all recorded observations answer alike."""
    tree = policy.tree
    reached = _reached(tree, rows)
    source = np.arange(tree.n_nodes)
    for node in range(tree.n_nodes - 1, -1, -1):
        if tree.feature[node] == tree.NO_FEATURE:
            continue
        left, right = tree.left[node], tree.right[node]
        if not reached[right]:
            source[node] = source[left]
        elif not reached[left]:
            source[node] = source[right]
    label = np.full(tree.n_nodes, INNER, dtype=np.int64)
    label[tree.node_of_leaf] = policy.actions
    return _rebuilt(policy, source, label)


def node_totals(tree: DecisionTree, of_leaves: Floats) -> Floats:
    """Return the sums over the leaves below each node, shape [M, ...], of values [L, ...]."""
    total = np.zeros((tree.n_nodes, *of_leaves.shape[1:]))
    total[tree.node_of_leaf] = of_leaves
    for node in range(tree.n_nodes - 1, 0, -1):
        total[tree.parent[node]] += total[node]
    return total


def _reached(tree: DecisionTree, rows: Floats) -> Booleans:
    """Return which nodes some row reaches, shape [M]."""
    counts = np.bincount(tree.leaf_index(rows), minlength=tree.n_leaves)
    reached: Booleans = node_totals(tree, counts.astype(np.float64)) > 0
    return reached


def _combined(left: Floats, right: Floats) -> Floats:
    """Return the least cost of both subtrees together with 2, 3, ... leaves."""
    if left.size > right.size:
        left, right = right, left
    best = np.full(left.size + right.size - 1, np.inf)
    for size, cost in enumerate(left.tolist()):
        part = best[size : size + right.size]
        np.minimum(part, cost + right, out=part)
    return best


def _rebuilt(policy: TreePolicy, source: Integers, label: Integers) -> TreePolicy:
    tree, actions = rebuild(policy.tree, source, label)
    return replace(policy, tree=tree, actions=actions, leaves=None, locked=())
