"""Compiled loops of proofs: outward rounding, and the actions of a tree in a box."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Integers, Unsigned
from eutree.compiled import compiled
from eutree.trees import TreeNodes

_ULP = 2.0**-52  # of |x|: at least one unit in the last place of x, at most two
_TINY = 5e-324  # the distance of 0 from its neighbours


class ActingNodes(NamedTuple):
    """The nodes of a policy's tree, and what its leaves decide."""

    nodes: TreeNodes
    actions: Integers  # [L]


@compiled
def widen(low: Floats, high: Floats) -> None:
    """Move bounds [N] outward, each past its neighbouring double, in place.

    One rounding to nearest errs by half a unit in the last place: what was computed from bounds,
    and is then moved by a whole one, holds the exact result and every double that rounds to it.
    """
    for i in range(low.size):
        low[i] = low[i] - (abs(low[i]) * _ULP + _TINY)
        high[i] = high[i] + (abs(high[i]) * _ULP + _TINY)


@compiled
def decide(
    policy: ActingNodes,
    low: Floats,  # [N, d]
    high: Floats,  # [N, d]
    out: Unsigned,  # [N]
) -> None:
    """Write the set of actions that a tree takes in each closed box, a bit for each action."""
    feature, threshold, left, right, leaf = policy.nodes
    # A node is on the stack at most once, so there is room for all.
    stack = np.empty(feature.size + 1, dtype=np.int64)
    for i in range(low.shape[0]):
        chosen = np.uint64(0)
        stack[0], size = 0, 1
        while size > 0:  # the box meets the box of every node on the stack
            size -= 1
            node = stack[size]
            j = feature[node]
            if j < 0:
                chosen |= np.uint64(1) << np.uint64(policy.actions[leaf[node]])
                continue
            # Not "above" and "not at most" alone: bounds that are NaN go both ways.
            if not low[i, j] > threshold[node]:
                stack[size] = left[node]
                size += 1
            if not high[i, j] <= threshold[node]:
                stack[size] = right[node]
                size += 1
        out[i] = chosen


@compiled
def shrink(
    safe: Booleans,  # [C] out
    first: Integers,  # [K, d] lowest cell of each move, along each number; negative: outside
    last: Integers,  # [K, d]
    begins: Integers,  # [C + 1] where the moves of each cell begin
    strides: Integers,  # [d] cells are numbered with the last number fastest
) -> int:
    """Take out cells until every move of a safe cell ends in safe cells; return the sweeps."""
    d = strides.size
    at = np.empty(d, dtype=np.int64)
    sweeps, changed = 0, True
    while changed:  # each sweep takes out at least one cell, or is the last
        changed = False
        sweeps += 1
        for c in range(safe.size):
            if not safe[c]:
                continue
            for k in range(begins[c], begins[c + 1]):
                # Counts through the cells from ``first`` to ``last`` like the digits of a number.
                holds = True
                for j in range(d):
                    at[j] = first[k, j]
                    holds = holds and first[k, j] >= 0
                while holds:
                    cell = 0
                    for j in range(d):
                        cell += at[j] * strides[j]
                    if not safe[cell]:
                        holds = False
                        break
                    j = d - 1
                    while j >= 0 and at[j] == last[k, j]:
                        at[j] = first[k, j]
                        j -= 1
                    if j < 0:
                        break
                    at[j] += 1
                if not holds:
                    safe[c] = False
                    changed = True
                    break
    return sweeps
