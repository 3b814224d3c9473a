"""Repair a tree where it does harm, with nothing but what was shown there.

C4.5 takes the most frequent action of a leaf. Whoever waits shows the waiting many times and the
going on once: where no test tells them apart, the leaf waits for ever. Three changes of such a leaf
stay within what was shown: another action that was shown there; the cuts that C4.5 finds in the
leaf's own steps when neither penalty nor pruning forbids them; and the most frequent action below
the test above it, which gives that test up. Which of them is right, if any, playing says.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.data import Demonstrations
from eutree.fitting.playing import Played
from eutree.policies import TreePolicy
from eutree.trees.edit import graft, merge

_FREE = C45Settings(use_penalty=False, prune=False, collapse=False, use_min_split=False)


def shown_in(policy: TreePolicy, demonstrations: Demonstrations) -> Integers:
    """Return how often each action was shown in each leaf, shape [L, A]."""
    known = demonstrations.with_history(policy.history)
    counts = np.zeros((policy.n_leaves, policy.schema.n_actions), dtype=np.int64)
    np.add.at(counts, (policy.tree.leaf_index(known.observations), known.actions), 1)
    return counts


def blame(played: Played, failed: Booleans) -> Floats:
    """Return how much each leaf has to do with failing, shape [L].

    The share of the failed episodes in which it decided last, and by how much more of them than of
    the others it decided in at all.

    Args:
        played: What the tree has played.
        failed: Which of the episodes failed, shape [E].
    """
    n_leaves = played.policy.n_leaves
    leaves = played.leaves()
    if not failed.any():
        return np.zeros(n_leaves)
    last = np.array([path[-1] for path in leaves])
    visited = np.array([np.bincount(path, minlength=n_leaves) > 0 for path in leaves])
    ends = np.bincount(last[failed], minlength=n_leaves) / failed.sum()
    elsewhere = visited[~failed].mean(axis=0) if not failed.all() else np.zeros(n_leaves)
    more = np.maximum(visited[failed].mean(axis=0) - elsewhere, 0.0)
    guilt: Floats = ends + more
    return guilt


def repairs(
    policy: TreePolicy, demonstrations: Demonstrations, leaf: int
) -> Iterator[tuple[TreePolicy, str]]:
    """Yield trees in which one leaf is changed, and what was changed, in words."""
    shown = shown_in(policy, demonstrations)
    taken, names = int(policy.actions[leaf]), policy.schema.actions
    for action in np.argsort(-shown[leaf], kind="stable").tolist():
        if action != taken and shown[leaf, action]:
            labels = policy.actions.copy()
            labels[leaf] = action
            words = f"{names[action]} in place of {names[taken]} where both were shown"
            yield _labelled(policy, labels), words
    if np.count_nonzero(shown[leaf]) > 1:
        yield _cut(policy, demonstrations, leaf), "a leaf cut further"
    parent = int(policy.tree.parent[policy.tree.node_of_leaf[leaf]])
    if parent >= 0:
        below = [n for n in range(policy.n_leaves) if parent in policy.tree.path(n)]
        labels = policy.actions.copy()
        labels[below] = shown[below].sum(axis=0).argmax()
        yield _labelled(policy, labels), "a test dropped"


def _labelled(policy: TreePolicy, labels: Integers) -> TreePolicy:
    tree, actions = merge(policy.tree, labels)
    return replace(policy, tree=tree, actions=actions)


def _cut(policy: TreePolicy, demonstrations: Demonstrations, leaf: int) -> TreePolicy:
    known = demonstrations.with_history(policy.history)
    rows = policy.tree.leaf_index(known.observations) == leaf
    scion, labels = grow(
        known.observations[rows],
        known.actions[rows],
        n_classes=policy.schema.n_actions,
        settings=_FREE,
    ).to_decision_tree()
    kept = {n: action for n, action in enumerate(policy.actions.tolist()) if n != leaf}
    if kept:
        scion, labels, _ = graft(policy.tree, kept, scion, labels)
    return _labelled(replace(policy, tree=scion, actions=labels), labels)
