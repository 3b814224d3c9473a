"""Compiled loops of CART: the best cut of a node, and growing best node first."""

from typing import NamedTuple

import numpy as np

from eutree import features
from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import compiled, overwrite

threshold_between = compiled(features.threshold_between)

SAME = 1e-12  # share of a node's impurity that counts as no gain


class CartRows(NamedTuple):
    """The rows that a tree is grown from."""

    X: Floats  # [d, N]
    order: Int32s  # [d, N] rows, ascending by each feature; those of a node stand together
    labels: Integers  # [N]
    weights: Floats  # [N]


class CartNodes(NamedTuple):
    """A tree while it grows, with room for M nodes."""

    feature: Int32s  # [M] -1 at a leaf
    threshold: Floats  # [M]
    left: Int32s  # [M]
    right: Int32s  # [M]
    counts: Floats  # [M, C] weight of each class


@compiled
def best_cut(
    rows: CartRows,
    begin: int,
    end: int,
    counts: Floats,  # [C] weight of each class in the node
) -> tuple[float, int, int]:
    """Return gain, feature and position of the cut that lowers the Gini impurity most.

    The impurity of a part of weight w, times w, is w - sum_c w_c^2 / w; so the cut is best where
    the sum of sum_c w_c^2 / w over both parts is largest. The position is that of the first row of
    the right part; the gain is 0 if no cut is worth it.
    """
    X, order, labels, weights = rows
    total, squares = 0.0, 0.0
    for c in range(counts.size):
        total += counts[c]
        squares += counts[c] * counts[c]
    most, feature, position = 0.0, -1, -1
    if total <= 0.0:
        return most, feature, position
    own = squares / total
    below, above = np.zeros(counts.size), np.zeros(counts.size)
    for j in range(X.shape[0]):
        # below and above hold the weight of each class before and from row k on; left, right their
        # sums; left_squares, right_squares the sums of their squares.
        below[:] = 0.0
        overwrite(above, counts)
        left, right, left_squares, right_squares = 0.0, total, 0.0, squares
        for k in range(begin, end - 1):
            row = order[j, k]
            c, w = labels[row], weights[row]
            # (b + w)^2 - b^2 = w (2 b + w): only one class changes, so the sums of squares need no
            # loop.
            left_squares += w * (2.0 * below[c] + w)
            right_squares += w * (w - 2.0 * above[c])
            below[c] += w
            above[c] -= w
            left += w
            right -= w
            # No threshold separates equal values, and a part without weight has no impurity.
            if X[j, row] == X[j, order[j, k + 1]] or left <= 0.0 or right <= 0.0:
                continue
            gain = left_squares / left + right_squares / right - own
            # Rounding does not choose between equal cuts: the first feature and position win.
            if gain > most + SAME * total:
                most, feature, position = gain, j, k + 1
    return most, feature, position


@compiled
def cut(
    order: Int32s,  # [d, N] changed between begin and end
    begin: int,
    end: int,
    feature: int,
    position: int,
    goes_left: Booleans,  # [N] scratch
    scratch: Int32s,  # [N]
) -> None:
    """Sort the node's rows into a left and a right part, in every feature's order."""
    # Indexed by row: the same answer serves the order of every feature.
    for k in range(begin, end):
        goes_left[order[feature, k]] = k < position
    for j in range(order.shape[0]):
        at, n = begin, 0
        # order[j, begin:at] are the left rows met so far, scratch[:n] the right ones: at <= k.
        for k in range(begin, end):
            row = order[j, k]
            if goes_left[row]:
                order[j, at] = row
                at += 1
            else:
                scratch[n] = row
                n += 1
        for k in range(n):
            order[j, at + k] = scratch[k]


@compiled
def grow(rows: CartRows, out: CartNodes) -> int:
    """Grow a tree, always cutting the leaf that gains most; return its number of nodes.

    The rows' order changes.
    """
    X, order, labels, weights = rows
    feature, threshold, left, right, counts = out
    n_rows = labels.size
    size = feature.size
    begin, end = np.zeros(size, np.int64), np.zeros(size, np.int64)
    gain = np.zeros(size)
    where = np.zeros((size, 2), np.int64)
    goes_left, scratch = np.zeros(n_rows, np.bool_), np.zeros(n_rows, np.int32)
    end[0] = n_rows
    for i in range(n_rows):
        counts[0, labels[i]] += weights[i]
    feature[0] = -1
    # A leaf's best cut (feature, position) is found once, when the leaf is made.
    gain[0], where[0, 0], where[0, 1] = best_cut(rows, 0, n_rows, counts[0])
    n_nodes = 1
    # Each round turns the leaf of the largest gain into a node with two leaves.
    while n_nodes + 2 <= size:
        node = -1
        for other in range(n_nodes):
            if feature[other] < 0 and gain[other] > 0.0 and (node < 0 or gain[other] > gain[node]):
                node = other
        if node < 0:
            break
        chosen, position = where[node, 0], where[node, 1]
        low = X[chosen, order[chosen, position - 1]]
        high = X[chosen, order[chosen, position]]
        cut(order, begin[node], end[node], chosen, position, goes_left, scratch)
        feature[node], threshold[node] = chosen, threshold_between(low, high)
        left[node], right[node] = n_nodes, n_nodes + 1
        for child in range(n_nodes, n_nodes + 2):
            is_left = child == n_nodes
            begin[child] = begin[node] if is_left else position
            end[child] = position if is_left else end[node]
            feature[child] = -1
            for k in range(begin[child], end[child]):
                row = order[0, k]
                counts[child, labels[row]] += weights[row]
            gain[child], where[child, 0], where[child, 1] = best_cut(
                rows, begin[child], end[child], counts[child]
            )
        n_nodes += 2
    return n_nodes
