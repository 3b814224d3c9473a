"""Outcomes of aiming at a neighbour, and the fewest aims that surely lead to the goal.

    J(GOAL) = 0,   J(i) = 1 + min over aims j of i of  max over k in OUTCOMES(i, j) of J(k)

(Moore and Atkeson 1995, section 3). OUTCOMES(i, j) are the cells in which one arrived who set out
from cell i for j, or {j} as long as nobody has tried. With noise one unlucky arrival would count
for ever: ``floor`` keeps only outcomes whose share is above it for certain (Wilson, 95 %).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree_lab.parti_game import _kernels
from eutree_lab.parti_game.cells import GOAL, Cells

EXPERT = -2
"""The aim of acting as the expert does until the cell is left."""

LOST = -3
"""The outcome of an episode that ended badly."""

Z = 1.96  # 95 %

Triple = tuple[int, int, int]
"""Set out from a cell, for an aim, arrived in a cell."""


@dataclass
class Outcomes:
    """Triples (from, aim, arrived), counted, with the start of each.

    Attributes:
        floor: Share above which an outcome is reckoned with, for certain; 0 takes all.
        arrivals: For each (from, aim): how often one arrived where.
        starts: For each (from, aim): where in the cell one set out, and where one arrived.
    """

    floor: float = 0.0
    arrivals: dict[tuple[int, int], dict[int, int]] = field(default_factory=dict)
    starts: dict[tuple[int, int], list[tuple[Floats, int]]] = field(default_factory=dict)

    def add(self, triple: Triple, start: Floats) -> bool:
        """Count a triple; return whether it is one that was never seen."""
        cell, aim, arrived = triple
        counts = self.arrivals.setdefault((cell, aim), {})
        counts[arrived] = counts.get(arrived, 0) + 1
        self.starts.setdefault((cell, aim), []).append((start, arrived))
        return counts[arrived] == 1

    def of(self, cell: int, aim: int) -> tuple[int, ...]:
        """Return OUTCOMES(cell, aim), ascending; none for an expert who was never there."""
        counts = self.arrivals.get((cell, aim))
        if not counts:
            return () if aim == EXPERT else (aim,)
        total = sum(counts.values())
        likely = [k for k, n in counts.items() if wilson(n, total) > self.floor]
        return tuple(sorted(likely or [max(counts, key=lambda k: (counts[k], -k))]))

    def copy(self) -> "Outcomes":
        """Return outcomes of their own."""
        return Outcomes(
            self.floor,
            {key: dict(counts) for key, counts in self.arrivals.items()},
            {key: list(starts) for key, starts in self.starts.items()},
        )

    def without(self, cells: Iterable[int]) -> "Outcomes":
        """Return the outcomes without triples that mention one of these cells."""
        gone = frozenset(cells)
        kept = Outcomes(self.floor)
        for (cell, aim), starts in self.starts.items():
            if cell not in gone and aim not in gone:
                for start, arrived in starts:
                    if arrived not in gone:
                        kept.add((cell, aim, arrived), start)
        return kept


def wilson(count: int, total: int) -> float:
    """Return the lower 95 % limit of a share (Wilson 1927)."""
    share = count / total
    spread = Z * math.sqrt(share * (1.0 - share) / total + Z * Z / (4.0 * total * total))
    return (share + Z * Z / (2.0 * total) - spread) / (1.0 + Z * Z / total)


@dataclass(frozen=True, eq=False)
class AimCosts:
    """J of every cell, and its possible aims.

    Attributes:
        cost: J(i); infinite where nothing leads to the goal for certain. The last is the goal's.
        cell: Cell that each aim starts from, ascending.
        aim: The aim: a cell, GOAL or EXPERT.
        worst: J of the dearest outcome of each aim.
    """

    cost: Floats  # [L + 1]
    cell: Integers  # [K]
    aim: Integers  # [K]
    worst: Floats  # [K]

    @property
    def losing(self) -> Booleans:
        """Whether each cell is losing, shape [L]."""
        lost: Booleans = np.isinf(self.cost[:-1])
        return lost

    def best_aim(self, cell: int) -> int:
        """Return the aim with the cheapest worst outcome.

        The first on ties: the expert, who was seen to succeed, before the goal, before neighbours.
        """
        first, last = np.searchsorted(self.cell, [cell, cell + 1])
        return int(self.aim[first + np.argmin(self.worst[first:last])])


def aims(cells: Cells, *, expert: bool) -> tuple[Integers, Integers]:
    """Return cell and aim of all that can be aimed at; of each cell EXPERT, GOAL, neighbours."""
    beside = cells.beside_goal
    start, target = [], []
    for cell, neighbours in enumerate(cells.neighbours):
        mine = [EXPERT] * expert + [GOAL] * bool(beside[cell]) + neighbours.tolist()
        start += [cell] * len(mine)
        target += mine
    return np.array(start, dtype=np.int64), np.array(target, dtype=np.int64)


def costs(n_cells: int, cell: Integers, aim: Integers, outcomes: Outcomes) -> AimCosts:
    """Return J of all cells in one pass.

    Args:
        n_cells: Number of cells L.
        cell: Cell of each aim, ascending, shape [K].
        aim: The aim, shape [K].
        outcomes: Outcomes of the aims.
    """
    arcs = [outcomes.of(i, j) for i, j in zip(cell.tolist(), aim.tolist(), strict=True)]
    sizes = np.array([max(len(arc), 1) for arc in arcs], dtype=np.int64)
    indptr = np.concatenate([[0], np.cumsum(sizes)])
    flat = np.array([k for arc in arcs for k in arc or (LOST,)], dtype=np.int64)
    flat = np.where(flat == GOAL, n_cells, flat)
    cost = np.empty(n_cells + 1)
    _kernels.minimax(cell, indptr, flat, cost)
    cost[cost == _kernels.UNKNOWN] = np.inf
    reached = np.where(flat >= 0, cost[np.clip(flat, 0, n_cells)], np.inf)
    worst = np.maximum.reduceat(reached, indptr[:-1]) if len(arcs) else np.empty(0)
    return AimCosts(cost, cell, aim, worst)


def expert_outcomes(cells: Cells, episodes: Iterable[tuple[Floats, int]]) -> list[
    tuple[Triple, Floats]
]:  # fmt: skip
    """Return the outcomes of following the expert, segment by segment of its episodes.

    Args:
        cells: Present partition.
        episodes: Observations of each episode, [T + 1, d], and how it ended: GOAL, LOST or 0 where
            it was cut short.
    """
    found = []
    for observations, ending in episodes:
        labels = cells.tree.leaf_index(observations)
        if ending != 0:  # the last observation belongs to no cell: the episode was over
            labels = labels[:-1]
        entered = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
        for n, row in enumerate(entered.tolist()):
            if n + 1 < entered.size:
                arrived = int(labels[entered[n + 1]])
            elif ending != 0:
                arrived = ending
            else:
                continue
            found.append(((int(labels[row]), EXPERT, arrived), observations[row]))
    return found


def counted(triples: Iterable[tuple[Triple, Floats]], floor: float) -> Outcomes:
    """Return the outcomes of some triples."""
    outcomes = Outcomes(floor)
    for triple, start in triples:
        outcomes.add(triple, start)
    return outcomes


def merged(first: Outcomes, second: Outcomes) -> Outcomes:
    """Return both together."""
    both = first.copy()
    for (cell, aim), starts in second.starts.items():
        for start, arrived in starts:
            both.add((cell, aim, arrived), start)
    return both
