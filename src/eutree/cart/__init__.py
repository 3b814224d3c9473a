"""CART: a classification tree of a given number of leaves, from weighted observations."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.cart import _kernels
from eutree.errors import InvalidArgumentError
from eutree.trees import DecisionTree
from eutree.validation import check_actions, check_integer, check_observations, check_vector

# Unlike C4.5's the tree has a limit: it grows where that lowers the impurity most, until it has
# so many leaves. Thresholds lie halfway between observed values, in double precision.


def grow_cart(
    observations: Floats,
    labels: Integers,
    *,
    n_classes: int,
    max_leaves: int,
    weights: Floats | None = None,
) -> tuple[DecisionTree, Integers]:
    """Return a tree of at most so many leaves, and the label of each leaf, shape [L].

    Args:
        observations: Shape [N, d].
        labels: Class of each observation, below ``n_classes``, shape [N].
        n_classes: Number of classes C.
        max_leaves: Most leaves.
        weights: How much each observation counts, none below 0, shape [N]; by default all the same.

    Raises:
        InvalidArgumentError: An argument is not as described, or there is no observation.
    """
    rows = check_observations("observations", observations)
    check_integer("n_classes", n_classes, low=1)
    check_integer("max_leaves", max_leaves, low=1)
    classes = check_actions("labels", labels, size=len(rows))
    if not classes.size:
        raise InvalidArgumentError("observations must hold at least one row, got none")
    if classes.max() >= n_classes:
        raise InvalidArgumentError(f"labels must be below {n_classes}, got {classes.max()}")
    counted = np.ones(classes.size) if weights is None else weights
    counted = check_vector("weights", counted, size=classes.size)
    if counted.min() < 0.0:
        raise InvalidArgumentError(f"weights must be at least 0, got {counted.min()}")
    size = 2 * min(max_leaves, classes.size) - 1
    X = np.ascontiguousarray(rows.T)
    order = np.argsort(X, axis=1, kind="stable").astype(np.int32)
    feature, left, right = (np.full(size, -1, dtype=np.int32) for _ in range(3))
    threshold, counts = np.full(size, np.nan), np.zeros((size, n_classes))
    nodes = _kernels.CartNodes(feature, threshold, left, right, counts)
    n_nodes = _kernels.grow(_kernels.CartRows(X, order, classes, counted), nodes)
    feature = feature[:n_nodes]
    is_leaf = feature < 0
    tree = DecisionTree(
        rows.shape[1],
        feature=np.where(is_leaf, DecisionTree.NO_FEATURE, feature).astype(np.int32),
        threshold=threshold[:n_nodes],
        left=left[:n_nodes],
        right=right[:n_nodes],
        leaf=np.where(is_leaf, np.cumsum(is_leaf) - 1, DecisionTree.NO_LEAF).astype(np.int32),
    )
    return tree, counts[:n_nodes][is_leaf].argmax(axis=1).astype(np.int64)


__all__ = ["grow_cart"]
