"""Compiled loops over the corners of a grid: Kuhn interpolation, influence, variance.

The corners of leaf l are ``corner_of[l, c]``; bit i of c says whether it is the upper end of
axis i. A row of the corner process is d + 1 corners with weights that sum to 1, and a discount.
"""

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import compiled, overwrite


@compiled
def interpolate(
    points: Floats,  # [N, d]
    leaf: Int32s,  # [N]
    low: Floats,  # [L, d]
    high: Floats,  # [L, d]
    corner_of: Integers,  # [L, 2^d]
    successor: Integers,  # [N, d + 1] out
    weight: Floats,  # [N, d + 1] out
) -> None:
    """Write the simplex of Kuhn's triangulation that holds each point, and its weights.

    With z the position in the box and z_(1) >= ... >= z_(d), the vertices lead from the lower
    corner to the upper one, switching the axes in that order; the weights are 1 - z_(1),
    z_(k) - z_(k+1) and z_(d). Points outside of their leaf are moved to its border.
    """
    d = points.shape[1]
    z, order = np.empty(d), np.empty(d, np.int64)
    for n in range(points.shape[0]):
        box = leaf[n]
        for i in range(d):
            # An axis without extent has position 0: its upper corner gets no weight.
            side = high[box, i] - low[box, i]
            share = (points[n, i] - low[box, i]) / side if side > 0.0 else 0.0
            z[i] = min(max(share, 0.0), 1.0)
            # Insertion: order[:i] is descending in z, equal ones by axis.
            at = i
            while at > 0 and z[order[at - 1]] < z[i]:
                order[at] = order[at - 1]
                at -= 1
            order[at] = i
        corner, above = 0, 1.0
        for k in range(d):  # `above` is z_(k), and 1 before the first
            successor[n, k] = corner_of[box, corner]
            weight[n, k] = above - z[order[k]]
            above = z[order[k]]
            # The next vertex is the upper end of one more axis.
            corner |= 1 << order[k]
        successor[n, d] = corner_of[box, corner]
        weight[n, d] = above


@compiled
def influence(
    successor: Integers,  # [C, d + 1]
    weight: Floats,  # [C, d + 1] times the discount
    source: Floats,  # [C]
    tolerance: float,
    most: int,
    total: Floats,  # [C] out
) -> int:
    """Write the solution of I = source + P^T I; return the rounds it took.

    The flow of round k is (P^T)^k source; every round the discounts make it less, so the sum of the
    flow bounds the error made by stopping.
    """
    flow, after = source.copy(), np.empty(source.shape[0])
    overwrite(total, source)
    # flow is (P^T)^n source and total the sum of the flows up to it.
    for n in range(most):
        after[:] = 0.0
        for x in range(successor.shape[0]):
            # In the first rounds the flow of most corners is still 0.
            if flow[x] != 0.0:
                for k in range(successor.shape[1]):
                    after[successor[x, k]] += weight[x, k] * flow[x]
        left = 0.0
        for x in range(after.shape[0]):
            total[x] += after[x]
            flow[x] = after[x]
            left += abs(after[x])
        if left <= tolerance:
            return n + 1
    return most


@compiled
def variance(
    successor: Integers,  # [C, d + 1]
    weight: Floats,  # [C, d + 1] sums to 1
    discount: Floats,  # [C]
    own: Floats,  # [C]
    tolerance: float,
    most: int,
    total: Floats,  # [C] in: a first guess, out
) -> int:
    """Solve s2(x) = own(x) + discount(x)^2 sum_y p(y|x) s2(y) by Gauss-Seidel sweeps."""
    for n in range(most):
        change = 0.0
        for x in range(successor.shape[0]):
            # total holds this sweep's values before x and the last one's from x on. Discounts below
            # 1 make every sweep a contraction, from any first guess.
            mean = 0.0
            for k in range(successor.shape[1]):
                mean += weight[x, k] * total[successor[x, k]]
            new = own[x] + discount[x] * discount[x] * mean
            change = max(change, abs(new - total[x]))
            total[x] = new
        if change <= tolerance:
            return n + 1
    return most
