"""Compiled loops of boxes along axes: cut by the leaves of a tree, and joined in cells."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled

_SLACK = 2.0**-46  # of the sizes of a sum's terms: far more than all of its roundings


class Parts(NamedTuple):
    """Sets of states between bounds: the leaves of a tree, or the starts."""

    low: Floats  # [L, n]
    high: Floats  # [L, n]


class MetCells(NamedTuple):
    """Cells that boxes may meet, and the hull of what lies in each of those that were met."""

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
    """Write what of each box may lie in each part, and return how many such boxes there are."""
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

    Returns:
        How many cells were met; -1 where there is no room for so many.
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
