"""Compiled loops over the parallel arrays of a tree."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Unsigned
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
    processor could guess wrong: an observation at a leaf stays there. Then each walks on by itself,
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
