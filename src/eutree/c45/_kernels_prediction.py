"""Compiled loops of prediction: the leaf of each row, and the shares of fractional cases."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.c45._kernels import branch_of
from eutree.compiled import compiled_later


class Branches(NamedTuple):
    """The tests of a tree and where their branches lead; see ``C45Tree``."""

    feature: Int32s  # [M]
    threshold: Floats  # [M]
    first_child: Int32s  # [M]
    n_children: Int32s  # [M]
    value_start: Int32s  # [M]
    value_branch: Int32s  # [V]


@compiled_later
def find_leaves(
    tree: Branches,
    observations: Floats,  # [N, d]
    out: Int32s,  # [N]
) -> int:
    """Write the leaf (its node) of each row, -1 if a tested value is unknown; count those."""
    feature, threshold, first_child = tree.feature, tree.threshold, tree.first_child
    value_start, value_branch = tree.value_start, tree.value_branch
    unknown = 0
    # Until a leaf is reached, ``node`` is a test and ``j`` its attribute; -1 is an unknown value.
    for i in range(observations.shape[0]):
        node = 0
        j = feature[0]
        while j >= 0:
            value = observations[i, j]
            if value_start[node] < 0:
                # Both comparisons are false for NaN, so an unknown value needs no test of its own.
                if value <= threshold[node]:
                    node = first_child[node]
                elif value > threshold[node]:
                    node = first_child[node] + 1
                else:
                    node = -1
                    break
            else:
                b = branch_of(value, 0.0, value_start[node], value_branch)
                if b < 0:
                    node = -1
                    break
                node = first_child[node] + b
            j = feature[node]
        out[i] = node
        if node < 0:
            unknown += 1
    return unknown


@compiled_later
def share_out(
    tree: Branches,
    size: Floats,  # [M] training weight of each node
    probability: Floats,  # [M, A]
    observations: Floats,  # [N, d]
    rows: Integers,  # [n] rows to predict
    out: Floats,  # [n, A] probabilities; zeros on entry
    leaf: Int32s,  # [n] out: the leaf with the largest share, the first of equal ones
) -> None:
    """Predict fractional cases: a row goes down all branches of a test whose value is unknown."""
    feature, threshold, first_child = tree.feature, tree.threshold, tree.first_child
    value_start, value_branch = tree.value_start, tree.value_branch
    # The stack holds what is left to visit: its parts and those of the leaves seen add up to 1.
    # A row meets a node once at most, so M places are enough.
    stack = np.empty(feature.size, np.int32)
    parts = np.empty(feature.size)
    for k in range(rows.size):
        i = rows[k]
        stack[0] = 0
        parts[0] = 1.0
        depth = 1
        largest = 0.0
        while depth > 0:
            depth -= 1
            node, part = stack[depth], parts[depth]
            if feature[node] < 0:
                for c in range(out.shape[1]):
                    out[k, c] += part * probability[node, c]
                # Branches are visited in order, so of equal shares the first leaf wins.
                if part > largest:
                    largest = part
                    leaf[k] = node
                continue
            value = observations[i, feature[node]]
            b = branch_of(value, threshold[node], value_start[node], value_branch)
            first = first_child[node]
            if b >= 0:
                stack[depth] = first + b
                parts[depth] = part
                depth += 1
                continue
            total = 0.0
            for fork in range(tree.n_children[node]):
                total += size[first + fork]
            # In reverse, because the stack turns the order round: sums over leaves go from the
            # first branch to the last, which fixes their last bits.
            for fork in range(tree.n_children[node] - 1, -1, -1):
                if size[first + fork] > 0.0:
                    stack[depth] = first + fork
                    parts[depth] = part * size[first + fork] / total
                    depth += 1
