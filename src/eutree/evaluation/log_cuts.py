"""Cut a tree to fewer leaves, by what recorded episodes say of its actions.

The sequence of cuts is that of minimal cost-complexity pruning (Breiman, Friedman, Olshen and
Stone, *Classification and Regression Trees*, 1984, section 3.3): the node gives way whose leaves
earn least for each of them, where a leaf earns what single deviations to its action gained.
"""

from dataclasses import replace

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.evaluation.log_gains import Log, rows_of
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.merging import INNER, merge, rebuild

SHARES = (1 / 2, 1 / 4, 1 / 8)  # of the leaves


def cuts(policy: TreePolicy, log: Log) -> list[TreePolicy]:
    """Return a tree, and the same cut to a half, a quarter and an eighth of its leaves.

    A tree with locked leaves stays as it is.

    Args:
        policy: The tree.
        log: Episodes that say what its actions are worth.
    """
    if policy.locked:
        return [policy]
    pruning = _Pruning(policy, log)
    found = [policy]
    for share in SHARES:
        small = pruning.cut_to(max(int(share * policy.n_leaves), 1))
        if small.n_leaves < found[-1].n_leaves:
            found.append(small)
    return found


class _Pruning:
    """A tree that is cut node by node."""

    def __init__(self, policy: TreePolicy, log: Log) -> None:
        self._policy, self._tree = policy, policy.tree
        self._label = np.full(self._tree.n_nodes, INNER)
        self._label[self._tree.node_of_leaf] = policy.actions
        self._worth = _worth(policy, log)  # [M, A]

    def cut_to(self, most: int) -> TreePolicy:
        """Return the tree of at most so many leaves."""
        while True:
            value, leaves = self._below()
            if leaves[0] <= most:
                break
            inner = np.flatnonzero(leaves > 1)
            loss = value[inner] - self._worth[inner].max(axis=1)
            node = int(inner[(loss / (leaves[inner] - 1)).argmin()])
            self._label[node] = self._worth[node].argmax()
        every = np.arange(self._tree.n_nodes)
        tree, actions = merge(*rebuild(self._tree, every, self._label))
        return replace(self._policy, tree=tree, actions=actions, leaves=None)

    def _below(self) -> tuple[Floats, Integers]:
        """Return what the leaves below each node earn, and how many there are, both [M]."""
        tree, n_nodes = self._tree, self._tree.n_nodes
        value, leaves = np.zeros(n_nodes), np.zeros(n_nodes, dtype=np.int64)
        for node in range(n_nodes - 1, -1, -1):  # children have larger numbers
            if self._label[node] != INNER:
                value[node], leaves[node] = self._worth[node, self._label[node]], 1
            else:
                below = [tree.left[node], tree.right[node]]
                value[node], leaves[node] = value[below].sum(), leaves[below].sum()
        return value, leaves


def _worth(policy: TreePolicy, log: Log) -> Floats:
    """Return what single deviations to each action gained in each node, shape [M, A]."""
    tree = policy.tree
    worth = np.zeros((tree.n_nodes, log.n_actions))
    for episode in log.episodes:
        steps, actions = np.arange(len(episode)), episode.actions
        gained = log.advantages(episode) / log.chances(episode)[steps, actions]
        leaves = tree.leaf_index(rows_of(policy, episode))
        np.add.at(worth, (tree.node_of_leaf[leaves], actions), gained)
    return _summed(tree, worth)


def _summed(tree: DecisionTree, worth: Floats) -> Floats:
    """Return the sums over the leaves below each node."""
    for node in range(tree.n_nodes - 1, 0, -1):
        worth[tree.parent[node]] += worth[node]
    return worth
