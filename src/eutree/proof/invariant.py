"""Properties for ever: the largest set of cells that no step leaves.

The states are cut into a grid of closed boxes. A cell is safe at first if all of its states keep
the conditions. Then every cell is taken out from which some action that the policy may take there,
with some disturbance, leads to a cell that is not safe, until none is left to be taken out. No step
leaves the remaining cells, so an episode that begins in it keeps the conditions for ever.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.proof import _kernels
from eutree.proof.certificate import CELLS, COLUMNS, EMPTY, KNOWN, OPEN, Picture
from eutree.proof.intervals import Intervals
from eutree.proof.plant import Plant, State
from eutree.proof.reach import Acting
from eutree.validation import check_integer, check_range

MOST_CELLS = 20_000_000
_AT_ONCE = 1 << 16


@dataclass(frozen=True, eq=False)
class StateGrid:
    """A partition of the states into boxes."""

    edges: tuple[Floats, ...]  # bounds of the cells along each number, in order: shapes [n_j + 1]

    @classmethod
    def of(cls, plant: Plant, refine: int) -> "StateGrid":
        """Return the grid that a plant asks for, each number cut ``refine`` times as often.

        Raises:
            InvalidArgumentError: The plant has none, or it has more than ``MOST_CELLS`` cells.
        """
        counts = [check_integer("cells of a grid", n, low=1) for _, _, n in plant.grid]
        if len(counts) != len(plant.state):
            raise InvalidArgumentError(
                f"the plant of {plant.environment} has no grid{' of all numbers' * bool(counts)}, "
                "which a property for ever needs; ask for a number of steps"
            )
        ends = [check_range("each range of a grid", one[:2]) for one in plant.grid]
        parts = zip(ends, counts, strict=True)
        found = cls(tuple(np.linspace(*between, n * refine + 1) for between, n in parts))
        if found.n_cells > MOST_CELLS:
            raise InvalidArgumentError(
                f"a grid must have at most {MOST_CELLS:,} cells, got {found.n_cells:,}"
            )
        return found

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each number of the state."""
        return tuple(edges.size - 1 for edges in self.edges)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape, dtype=float))

    def boxes(self, cells: Integers) -> State:
        """Return the boxes of some cells, given by their numbers [N]."""
        places = np.unravel_index(cells, self.shape)
        return [Intervals(at[k], at[k + 1]) for at, k in zip(self.edges, places, strict=True)]

    def range(self, state: State) -> tuple[Integers, Integers]:
        """Return the first and last cell along each number that boxes meet, shapes [N, d].

        A box that ends on the edge of a cell lies in that cell. Boxes that leave the grid have -1.
        """
        first, last = [], []
        for edges, one in zip(self.edges, state, strict=True):
            low = np.searchsorted(edges, one.low, side="right") - 1
            high = np.searchsorted(edges, one.high, side="left") - 1
            leaves = ~((one.low >= edges[0]) & (one.high <= edges[-1]))
            low = np.minimum(low, edges.size - 2)
            first.append(np.where(leaves, -1, low))
            last.append(np.where(leaves, -1, np.maximum(high, low)))
        return np.stack(first, axis=1), np.stack(last, axis=1)


@dataclass(frozen=True, eq=False)
class Invariant:
    """The largest safe set that was found."""

    grid: StateGrid
    safe: Booleans  # [C]; which of them no step of the policy leaves, and keep the conditions
    starts: Booleans  # [C]; which of them hold a start
    sweeps: int  # how often all cells were looked at

    @property
    def open_cells(self) -> Booleans:
        """Which cells hold a start and are not safe, shape [C]."""
        return self.starts & ~self.safe

    @property
    def undecided(self) -> float:
        """Share of the cells with starts that are not safe."""
        return float(self.open_cells.sum() / self.starts.sum())


def largest_invariant(acting: Acting, plant: Plant, keeps: Booleans, grid: StateGrid) -> Invariant:
    """Return the largest set of cells that a policy never leaves, of those that ``keeps`` [C]."""
    firsts, lasts, counts = [], [], []
    for cells in np.array_split(np.arange(grid.n_cells), max(grid.n_cells // _AT_ONCE, 1)):
        first, last, count = _moves(acting, plant, grid, cells, keeps[cells])
        firsts.append(first)
        lasts.append(last)
        counts.append(count)
    begins = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    shape = np.array(grid.shape)
    strides = np.concatenate([np.cumprod(shape[:0:-1])[::-1], [1]])
    safe = keeps.copy()
    sweeps = _kernels.shrink(
        safe, np.concatenate(firsts), np.concatenate(lasts), begins.astype(np.int64), strides
    )
    return Invariant(grid, safe, _starting(plant, grid), int(sweeps))


def _moves(
    acting: Acting, plant: Plant, grid: StateGrid, cells: Integers, keeps: Booleans
) -> tuple[Integers, Integers, Integers]:
    """Return where each possible action leads from cells, and how many moves each cell has."""
    state = grid.boxes(cells)
    sets = acting(state)
    actions = np.arange(acting.n_actions)
    possible = ((sets[:, None] >> actions) & 1 == 1) & keeps[:, None]  # others are out anyway
    row, action = np.nonzero(possible)
    chosen = [Intervals(one.low[row], one.high[row]) for one in state]
    first, last = grid.range(plant.step(chosen, action))
    return first, last, possible.sum(axis=1)


def _starting(plant: Plant, grid: StateGrid) -> Booleans:
    box = [Intervals(np.array([low]), np.array([high])) for low, high in plant.start]
    first, last = grid.range(box)
    if (first < 0).any():
        raise InvalidArgumentError(
            f"the grid of the plant of {plant.environment} must hold all starts"
        )
    found = np.zeros(grid.shape, dtype=bool)
    found[tuple(slice(a, b + 1) for a, b in zip(first[0], last[0], strict=True))] = True
    return found.reshape(-1)


def pictures_of_grid(plant: Plant, found: Invariant) -> tuple[Picture, ...]:
    """Return which cells are never left, along the first two numbers of a grid."""
    grid = found.grid
    rank = np.select([found.starts & ~found.safe, found.starts, found.safe], [3, 2, 1])
    worst = rank.reshape(*(*grid.shape, 1)[:2], -1).max(axis=2)
    for axis, most in enumerate((COLUMNS, 1) if worst.shape[1] == 1 else (CELLS, CELLS)):
        n = worst.shape[axis]
        begins = np.unique(np.linspace(0, n, min(n, most), endpoint=False).astype(int))
        worst = np.maximum.reduceat(worst, begins, axis=axis)
    ends = [(float(edges[0]), float(edges[-1])) for edges in grid.edges[:2]]
    low, high = zip(*ends, strict=True)
    legend = "Dark: cells with starts; light: others that are never left. Black: a start in a cell "
    legend += "that may be left."
    marks = np.array([EMPTY, KNOWN, KNOWN, OPEN])[worst]
    values = np.where(worst == 2, 1.0, 0.5)
    return (Picture("The cells", plant.state[:2], low, high, values, marks, legend),)
