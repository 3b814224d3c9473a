"""C4.5 from a training set to a tree: grow, collapse, prune."""

import numpy as np
from numpy.typing import ArrayLike

from eutree.c45 import _kernels_pruning as _kernels
from eutree.c45._kernels import Nodes
from eutree.c45.growing import C45Settings, Training, grow_nodes
from eutree.c45.tree import C45Tree, read_only
from eutree.errors import InvalidArgumentError
from eutree.validation import check_actions, check_integer, check_numbers, check_vector


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
    return Nodes(
        feature=nodes.feature[old],
        threshold=np.where(tested, nodes.threshold[old], np.nan),
        first_child=np.where(tested, new[nodes.first_child[old]], -1).astype(np.int32),
        n_children=np.where(tested, nodes.n_children[old], 0).astype(np.int32),
        distribution=nodes.distribution[old],
    )


MOST_CLASSES = 2**15 - 1

_DEFAULT = C45Settings()


def grow(
    observations: ArrayLike,
    actions: ArrayLike,
    *,
    n_classes: int,
    weights: ArrayLike | None = None,
    n_values: ArrayLike | None = None,
    settings: C45Settings = _DEFAULT,
) -> C45Tree:
    """Return the tree that C4.5 makes of a training set.

    Args:
        observations: Numbers, shape [N, d]; NaN where a value is unknown.
        actions: Class of each row, an integer in 0..n_classes - 1, shape [N].
        n_classes: Number of classes; it enters the least size of a branch.
        weights: Weight of each row, none negative; rows of weight 0 are left out. 1 by default.
        n_values: Number of values of each nominal attribute, whose column holds the codes
            0..n_values - 1; 0 for a continuous attribute. All are continuous by default.
        settings: Every choice of the learner; release 8 by default.

    Raises:
        InvalidArgumentError: If an argument is not as described, or no row has weight.
    """
    check_integer("n_classes", n_classes, low=1, high=MOST_CLASSES)
    rows = check_numbers("observations", observations, ndim=2)
    if not rows.shape[1]:
        raise InvalidArgumentError("observations must have at least one column, got none")
    if np.isinf(rows).any():
        place = ", ".join(map(str, np.argwhere(np.isinf(rows))[0]))
        raise InvalidArgumentError(f"observations must not be infinite, got infinity at [{place}]")
    labels = check_actions("actions", actions, size=len(rows))
    if labels.size and labels.max() >= n_classes:
        raise InvalidArgumentError(
            f"actions must be in 0..{n_classes - 1}, got {int(labels.max())}"
        )
    weight = np.ones(len(rows)) if weights is None else check_vector(
        "weights", weights, size=len(rows)
    )  # fmt: skip
    if weight.size and weight.min() < 0:
        raise InvalidArgumentError(f"weights must not be negative, got {weight.min()}")
    used = weight > 0
    if not used.any():
        raise InvalidArgumentError("observations must have at least one row with weight, got none")
    if not used.all():
        rows, labels, weight = rows[used], labels[used], weight[used]
    values = np.zeros(rows.shape[1]) if n_values is None else np.asarray(n_values)
    training = Training(
        observations=read_only(rows),
        actions=labels.astype(np.int16),
        weights=weight.copy(),
        n_values=values.astype(np.int32),
        n_classes=n_classes,
    )
    nodes = grow_nodes(training, settings)
    if settings.prune:
        cases = _kernels.TrainingCases(training.observations, training.actions, training.weights)
        estimate = _kernels.ErrorEstimate(
            float(settings.confidence), settings.deviate, settings.z == "normal"
        )
        _kernels.prune(nodes, cases, estimate, settings.subtree_raising)
    return C45Tree(training.n_values, *compact(nodes))
