"""Compiled loops of proofs: outward rounding, and the actions of a tree in a box."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Integers, Unsigned
from eutree.compiled import compiled
from eutree.trees import TreeNodes

_ULP = 2.0**-52  # of |x|: at least one unit in the last place of x, at most two
_TINY = 5e-324  # the distance of 0 from its neighbours


class ActingNodes(NamedTuple):
    """The nodes of a policy's tree, and the actions of its leaves."""

    nodes: TreeNodes
    actions: Integers  # [L]


@compiled
def widen(low: Floats, high: Floats) -> None:
    """Move bounds [N] outward, each past its neighbouring double, in place.

    One rounding to nearest errs by half a unit in the last place: a bound that was computed and is
    then moved by a whole one encloses the exact result and every double that rounds to it.
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


_SLACK = 2.0**-46  # of the sizes of a sum's terms: far more than all of its roundings


class Parts(NamedTuple):
    """Sets of states between bounds: the leaves of a tree, or the starts."""

    low: Floats  # [L, n]
    high: Floats  # [L, n]


class MetCells(NamedTuple):
    """Cells that boxes may meet, and the hull of the states in each of those that were met."""

    width: Floats  # [d]
    first: Integers  # [d] number of the lowest along each axis
    counts: Integers  # [d] how many along each axis
    slot: Integers  # [C] place of each among those that were met; -1 before
    low: Floats  # [M, d]
    high: Floats  # [M, d]


@compiled
def narrow(back: Floats, low: Floats, high: Floats, least: Floats, most: Floats) -> bool:
    """Narrow a box [d] to where ``back @ x`` is between bounds, in place; False if nowhere.

    No x of the box that is between the bounds is lost; others may stay.
    """
    for i in range(back.shape[0]):
        if least[i] == -np.inf and most[i] == np.inf:
            continue
        for j in range(low.size):
            if back[i, j] == 0.0:
                continue
            below, above, size = 0.0, 0.0, 0.0
            for k in range(low.size):
                one, other = back[i, k] * low[k], back[i, k] * high[k]
                size += max(abs(one), abs(other))
                if k != j:
                    below += min(one, other)
                    above += max(one, other)
            one = (least[i] - above - _SLACK * size) / back[i, j]
            other = (most[i] - below + _SLACK * size) / back[i, j]
            low[j] = max(low[j], min(one, other))
            high[j] = min(high[j], max(one, other))
            if low[j] > high[j]:
                return False
    return True


@compiled
def cut(
    back: Floats,  # [n, d] from places on the axes to the state
    parts: Parts,
    low: Floats,  # [N, d]
    high: Floats,  # [N, d]
    out_low: Floats,  # [N * L, d]
    out_high: Floats,  # [N * L, d]
    out_part: Integers,  # [N * L]
) -> int:
    """Write a box around each intersection of a box with a part; return their number."""
    size = 0
    for i in range(low.shape[0]):
        for part in range(parts.low.shape[0]):
            out_low[size], out_high[size] = low[i], high[i]
            least, most = parts.low[part], parts.high[part]
            if narrow(back, out_low[size], out_high[size], least, most):
                out_part[size] = part
                size += 1
    return size


@compiled
def join(cells: MetCells, low: Floats, high: Floats) -> int:
    """Cut boxes [N, d] at the bounds of cells, and write the hull of each cell that is met.

    Return how many there are; -1 where there is no room for so many.
    """
    d, met = low.shape[1], 0
    begin, end = np.empty(d, dtype=np.int64), np.empty(d, dtype=np.int64)
    for i in range(low.shape[0]):
        for j in range(d):
            begin[j] = int(np.floor(low[i, j] / cells.width[j]))
            end[j] = int(np.floor(high[i, j] / cells.width[j]))
        at = begin.copy()
        while True:  # counts through the cells like the digits of a number
            cell = 0
            for j in range(d):
                cell = cell * cells.counts[j] + at[j] - cells.first[j]
            slot = cells.slot[cell]
            if slot < 0:
                if met == cells.low.shape[0]:
                    return -1
                slot, met = met, met + 1
                cells.slot[cell] = slot
                cells.low[slot], cells.high[slot] = np.inf, -np.inf
            for j in range(d):
                # Both neighbours compute their common bound alike, and the box has its own ends.
                one = low[i, j] if at[j] == begin[j] else at[j] * cells.width[j]
                other = high[i, j] if at[j] == end[j] else (at[j] + 1) * cells.width[j]
                cells.low[slot, j] = min(cells.low[slot, j], one)
                cells.high[slot, j] = max(cells.high[slot, j], other)
            j = d - 1
            while j >= 0 and at[j] == end[j]:
                at[j] = begin[j]
                j -= 1
            if j < 0:
                break
            at[j] += 1
    return met
