"""Compiled loops over the parallel arrays of a tree."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers, Unsigned
from eutree.compiled import compiled_later

_BLOCK = 128


class TreeNodes(NamedTuple):
    """The arrays of a decision tree, with their meaning there."""

    feature: Int32s  # [M]
    threshold: Floats  # [M]
    left: Int32s  # [M]
    right: Int32s  # [M]
    leaf: Int32s  # [M]


class LevelNodes(NamedTuple):
    """The nodes of a tree as a walk of many rows takes them: no branch, no sign to be checked."""

    feature: Unsigned  # [M] 0 at a leaf
    child: Unsigned  # [M, 2] left and right; a leaf is its own child


@compiled_later
def descend(nodes: TreeNodes, observation: Floats, node: int) -> int:
    """Return the leaf below ``node`` of one observation [d]; NaN compares false, so goes right."""
    while nodes.feature[node] >= 0:  # the observation is in the box of ``node``
        if observation[nodes.feature[node]] <= nodes.threshold[node]:
            node = nodes.left[node]
        else:
            node = nodes.right[node]
    return int(nodes.leaf[node])


@compiled_later
def locate(
    nodes: TreeNodes,
    levels: LevelNodes,
    rounds: int,
    observations: Floats,  # [N, d]
    out: Int32s,  # [N]
) -> None:
    """Write the leaf of each observation to ``out``.

    A block of observations goes down ``rounds`` levels together, without a branch that the
    processor could guess wrong: whoever is at a leaf stays there. Then each walks on by itself,
    as few do. Node numbers are unsigned, so no index has to be checked for its sign.
    """
    n = observations.shape[0]
    feature, child, threshold = levels.feature, levels.child, nodes.threshold
    at = np.zeros(_BLOCK, dtype=np.uint64)
    for start in range(0, n, _BLOCK):
        block = observations[start : min(n, start + _BLOCK)]
        size = block.shape[0]
        for k in range(size):
            at[k] = 0
        for _ in range(rounds):  # each row is as many levels down, or at its leaf
            for k in range(size):
                node = at[k]
                # Not "above": NaN compares false and goes right, as in ``descend``.
                goes_right = not (block[k, feature[node]] <= threshold[node])
                at[k] = child[node, np.uint64(goes_right)]
        for k in range(size):
            out[start + k] = descend(nodes, block[k], int(np.int64(at[k])))


class LabelledNodes(NamedTuple):
    """The nodes of a tree, and the labels of its leaves."""

    nodes: TreeNodes
    labels: Integers  # [L]


@compiled_later
def disagreeing_volume(
    leaf_low: Floats,  # [L, d] boxes of the first tree's leaves, clipped
    leaf_high: Floats,  # [L, d]
    labels: Integers,  # [L]
    other: LabelledNodes,  # the second tree
    width: Floats,  # [d] of the whole box
    counts: Booleans,  # [d] whether the feature is a dimension of the box
) -> float:
    """Return the share of the box on which the labels of two trees differ.

    Where a feature is no dimension of the box, ``leaf_high`` is its one value.
    The second tree is walked with a stack of nodes, each with its part of the first leaf's box.
    """
    n_features = leaf_low.shape[1]
    feature, threshold, left, right, leaf = other.nodes
    n_nodes = feature.shape[0]
    # The pieces on the stack are disjoint: with those counted they make up the first leaf's box.
    # A node is on the stack once at most; popped, its place takes the left child, the next one the
    # right.
    stack = np.empty(n_nodes + 1, dtype=np.int64)
    low = np.empty((n_nodes + 1, n_features))
    high = np.empty((n_nodes + 1, n_features))
    total = 0.0
    for i in range(leaf_low.shape[0]):
        stack[0] = 0
        low[0] = leaf_low[i]
        high[0] = leaf_high[i]
        size = 1
        while size > 0:
            size -= 1
            node = stack[size]
            tested = feature[node]
            if tested < 0:
                if other.labels[leaf[node]] != labels[i]:
                    volume = 1.0
                    for j in range(n_features):
                        if high[size, j] <= low[size, j]:
                            volume = 0.0
                        elif counts[j]:
                            volume *= (high[size, j] - low[size, j]) / width[j]
                    total += volume
                continue
            cut = threshold[node]
            # Boxes are open below and closed above, as tests are: a value at the cut goes left.
            goes_right = high[size, tested] > cut
            goes_left = low[size, tested] < cut if counts[tested] else not goes_right
            if goes_left and goes_right:
                low[size + 1] = low[size]
                high[size + 1] = high[size]
                high[size, tested] = cut
                stack[size] = left[node]
                low[size + 1, tested] = cut
                stack[size + 1] = right[node]
                size += 2
            else:
                stack[size] = left[node] if goes_left else right[node]
                size += 1
    return total
