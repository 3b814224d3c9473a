"""Error-based pruning with subtree raising (release 8's ``EstimateErrors``)."""

import numpy as np

from eutree.c45 import _kernels_pruning as _kernels
from eutree.c45.growing import Nodes, Training
from eutree.c45.settings import C45Settings


def prune_nodes(nodes: Nodes, training: Training, settings: C45Settings) -> None:
    """Prune the tree in place; nodes that are no longer reached stay until ``compact``."""
    tree = _kernels.TreeArrays(
        nodes.feature,
        nodes.threshold,
        nodes.first_child,
        nodes.n_children,
        nodes.value_start,
        nodes.value_branch,
    )
    rows = _kernels.Rows(training.observations, training.actions, training.weights)
    estimate = _kernels.Estimate(
        float(settings.confidence), settings.deviate, settings.z == "normal"
    )
    _kernels.prune(tree, nodes.distribution, rows, estimate, settings.subtree_raising)


def compact(nodes: Nodes) -> Nodes:
    """Return the nodes that the root still reaches, numbered level by level."""
    kept = [np.array([0], dtype=np.int32)]
    while len(kept[-1]):
        inner = kept[-1][nodes.feature[kept[-1]] >= 0]
        first, forks = nodes.first_child[inner], nodes.n_children[inner]
        inside = np.arange(forks.sum()) - np.repeat(np.cumsum(forks) - forks, forks)
        kept.append((np.repeat(first, forks) + inside).astype(np.int32))
    old = np.concatenate(kept)
    new = np.full(len(nodes.feature), -1, dtype=np.int32)
    new[old] = np.arange(len(old), dtype=np.int32)
    tested = nodes.feature[old] >= 0
    nominal = tested & (nodes.value_start[old] >= 0)
    return Nodes(
        feature=nodes.feature[old],
        threshold=np.where(tested, nodes.threshold[old], np.nan),
        first_child=np.where(tested, new[nodes.first_child[old]], -1).astype(np.int32),
        n_children=np.where(tested, nodes.n_children[old], 0).astype(np.int32),
        value_start=np.where(nominal, nodes.value_start[old], -1).astype(np.int32),
        value_branch=nodes.value_branch,
        distribution=nodes.distribution[old],
    )
