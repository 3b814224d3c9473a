"""Compiled loops of discretization: touching boxes, minimax costs over reverse hyper-arcs."""

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.compiled import compiled

UNKNOWN = -1.0  # cost of a cell that has none (yet)


@compiled
def touching(
    low: Floats,  # [L, d]
    high: Floats,  # [L, d]
    cell: int,
    touches: Booleans,  # [L] out
) -> None:
    """Write which boxes share a face of positive area with one box.

    Two boxes of a partition share a face if they meet in exactly one axis (the upper end of one is
    the lower end of the other, to the bit: both are the same threshold) and overlap in all others.
    """
    for other in range(low.shape[0]):
        n_met, apart = 0, other == cell
        for i in range(low.shape[1]):
            if low[other, i] >= high[cell, i] or high[other, i] <= low[cell, i]:
                # Not overlapping in this axis: met if they are next to each other, else apart.
                if low[other, i] == high[cell, i] or high[other, i] == low[cell, i]:
                    n_met += 1
                else:
                    apart = True
        touches[other] = not apart and n_met == 1


@compiled
def minimax(
    start: Integers,  # [K] cell that each aim starts from
    indptr: Integers,  # [K + 1] where the outcomes of each aim begin and end
    outcome: Integers,  # [T] outcomes, each at most once for an aim; n_cells is the goal
    cost: Floats,  # [L + 1] out, UNKNOWN where nothing leads to the goal for certain
) -> None:
    """Write the fewest aims to the goal against an adversary who chooses among outcomes.

    Breadth first from the goal along reverse hyper-arcs (Al-Ansari 2001, algorithm 4): cells leave
    the queue in the order of their costs, so the outcome that leaves last is an aim's dearest, and
    the first aim of a cell that is complete is its best. An outcome need not be a neighbour.
    """
    n_aims, n_nodes = start.shape[0], cost.shape[0]
    # Reverse hyper-arcs: aims[first[c]:first[c + 1]] may end in node c.
    first = np.zeros(n_nodes + 1, np.int64)  # [L + 2] aims that may end in each node
    for k in range(outcome.shape[0]):
        if outcome[k] >= 0:
            first[outcome[k] + 1] += 1
    for node in range(n_nodes):
        first[node + 1] += first[node]
    aims = np.empty(first[n_nodes], np.int64)
    filled = first[:-1].copy()
    waiting = np.empty(n_aims, np.int64)  # [K] outcomes that have no cost yet
    for aim in range(n_aims):
        waiting[aim] = indptr[aim + 1] - indptr[aim]
        for k in range(indptr[aim], indptr[aim + 1]):
            if outcome[k] >= 0:  # a negative outcome is lost: it is waited for in vain
                aims[filled[outcome[k]]] = aim
                filled[outcome[k]] += 1
    cost[:] = UNKNOWN
    queue = np.empty(n_nodes, np.int64)
    queue[0], cost[n_nodes - 1] = n_nodes - 1, 0.0
    n_queued, n_followed = 1, 0
    while n_followed < n_queued:  # costs in the queue never fall and differ by 1 at most
        node = queue[n_followed]
        n_followed += 1
        for k in range(first[node], first[node + 1]):
            aim = aims[k]
            waiting[aim] -= 1
            # The aim's last outcome is its dearest. A cell with a cost has a better aim already.
            if waiting[aim] == 0 and cost[start[aim]] == UNKNOWN:
                cost[start[aim]] = cost[node] + 1.0
                queue[n_queued] = start[aim]
                n_queued += 1
