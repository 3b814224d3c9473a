"""Which cells parti-game splits when the present one is losing.

    Q   = the losing cells
    Q'  = those of Q that have a non-losing neighbour (or the goal)
    Q'' = Q' and the non-losing neighbours of Q'

``pg`` halves Q'' (Moore and Atkeson 1995, algorithm 4), ``lppg`` Q', ``llppg`` the largest of Q'
(Al-Ansari and Williams 1998). *Global improvement* is theirs too: where nothing is lost any more,
costs that differ by more than 1 across a border tell of a barrier, or of a way that cells are too
coarse to see; the largest cells on the side of the higher costs are halved.

With noise, ``explained_cuts`` splits only where the starting place tells the outcome, and there:
the best threshold by information gain, if it passes a chi-square test.
"""

import math
from collections.abc import Sequence

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.features import threshold_between
from eutree_lab.parti_game.cells import Cells
from eutree_lab.parti_game.outcomes import AimCosts, Outcomes

VARIANTS = ("pg", "lppg", "llppg")
FEWEST = 5  # starts on either side of an explained cut


def border(cells: Cells, costs: AimCosts) -> Integers:
    """Return Q', ascending: losing cells beside a cell, or the goal, from which one can win."""
    losing = costs.losing
    beside = cells.beside_goal
    return np.array(
        [
            cell
            for cell in np.flatnonzero(losing)
            if beside[cell] or not losing[cells.neighbours[cell]].all()
        ],
        dtype=np.int64,
    )


def cells_to_split(cells: Cells, costs: AimCosts, variant: str) -> Integers:
    """Return the cells that a variant halves, ascending.

    Args:
        cells: Present partition.
        costs: J of each.
        variant: One of ``VARIANTS``.
    """
    edge = border(cells, costs)
    if variant == "pg" and edge.size:
        losing = costs.losing
        beyond = np.concatenate([cells.neighbours[cell] for cell in edge])
        both: Integers = np.union1d(edge, beyond[~losing[beyond]])
        return both
    if variant == "llppg" and edge.size:
        volumes = cells.volumes[edge]
        edge = edge[volumes >= volumes.max() * (1.0 - 1e-9)]
    return edge


def cells_to_improve(cells: Cells, costs: AimCosts) -> Integers:
    """Return the largest of the cells that cost over 1 more than a neighbour, ascending.

    The goal is a neighbour of cost 0.

    Args:
        cells: Present partition.
        costs: J of each.
    """
    dear = [
        cell
        for cell in np.flatnonzero(~costs.losing).tolist()
        if costs.cost[cell]
        > 1.0
        + min(
            costs.cost[cells.neighbours[cell]].min(initial=np.inf),
            0.0 if cells.beside_goal[cell] else np.inf,
        )
    ]
    edge = np.array(dear, dtype=np.int64)
    if edge.size:
        volumes = cells.volumes[edge]
        edge = edge[volumes >= volumes.max() * (1.0 - 1e-9)]
    return edge


def explained_cuts(
    cells: Cells, costs: AimCosts, outcomes: Outcomes, *, level: float = 0.01
) -> list[tuple[int, int, float]]:
    """Return cuts (cell, axis, threshold) of border cells whose starts explain the outcomes.

    Args:
        cells: Present partition.
        costs: J of each.
        outcomes: Where one set out, and arrived.
        level: Chance of a cut as good where starts explain nothing, over all that were tried.
    """
    cuts = []
    for cell in border(cells, costs).tolist():
        best: tuple[float, int, float] | None = None
        n_tried = 0
        for (start, aim), rows in outcomes.starts.items():
            if start != cell:
                continue
            places = np.array([place for place, _ in rows])
            arrived = np.array([aim == k for _, k in rows])
            gain, axis, threshold, tried = _best_threshold(places, arrived)
            n_tried += tried
            inside = cells.low[cell, axis] < threshold < cells.high[cell, axis]
            if tried and inside and (best is None or gain > best[0]):
                best = (gain, axis, threshold)
        # 2 n times the gain in nats is chi-square with one degree of freedom (Wilks).
        if best is not None and n_tried * math.erfc(math.sqrt(best[0])) < level:
            cuts.append((cell, best[1], best[2]))
    return cuts


def _best_threshold(places: Floats, arrived: Booleans) -> tuple[float, int, float, int]:
    """Return the best cut's n times information gain in nats, axis, threshold, number tried."""
    found, n_tried = (0.0, 0, math.nan), 0
    if arrived.all() or not arrived.any():
        return (*found, n_tried)
    n = len(arrived)
    before = n * _entropy(arrived.mean())
    for axis in range(places.shape[1]):
        order = np.argsort(places[:, axis], kind="stable")
        values, right = places[order, axis], np.cumsum(arrived[order])
        for i in range(FEWEST, n - FEWEST + 1):
            if values[i - 1] == values[i]:
                continue
            n_tried += 1
            below = i * _entropy(right[i - 1] / i)
            above = (n - i) * _entropy((right[-1] - right[i - 1]) / (n - i))
            if before - below - above > found[0] + 1e-12:
                cut = threshold_between(*values[i - 1 : i + 1].tolist())
                found = (before - below - above, axis, cut)
    return (*found, n_tried)


def _entropy(share: float) -> float:
    return -sum(p * math.log(p) for p in (share, 1.0 - share) if p > 0.0)


def split(
    cells: Cells, outcomes: Outcomes, cuts: Sequence[tuple[int, int, float]]
) -> tuple[Cells, Outcomes]:
    """Return the cells after cuts, and the outcomes without triples that mention a cut cell."""
    return cells.split(cuts), outcomes.without(cell for cell, _, _ in cuts)
