"""Pictures of a certificate: cells of one number or two, to be coloured."""

import numpy as np

from eutree.arrays import Booleans, Integers
from eutree.proof.certificate import EMPTY, FAILS, KNOWN, NEVER, OPEN, Picture, Pieces
from eutree.proof.invariant import Invariant
from eutree.proof.plant import Plant

COLUMNS, CELLS = 320, 64  # along one number, and along each of two
BREAKS = "Black: not decided; red: it fails."


def picture_of(pieces: Pieces, values: Integers, marks: Integers, legend: str) -> Picture | None:
    """Return the starts, cut into pieces, along the first two numbers that vary.

    Args:
        pieces: The pieces.
        values: What is known of each, shape [N]; a cell gets the highest.
        marks: A mark for each; a cell gets the worst, shape [N].
        legend: What the colours mean.
    """
    low, high = pieces.low.min(axis=0), pieces.high.max(axis=0)
    varying = np.flatnonzero(high > low)[:2]
    if not varying.size:
        return None
    low, high = low[varying], high[varying]
    shape = (COLUMNS, 1) if varying.size == 1 else (CELLS, CELLS)
    scale = np.array(shape[: varying.size]) / (high - low)
    begins = np.floor((pieces.low[:, varying] - low) * scale).astype(int)
    finish = np.maximum(np.ceil((pieces.high[:, varying] - low) * scale).astype(int), begins + 1)
    found, marked = np.zeros(shape), np.full(shape, EMPTY)
    for k in np.lexsort((values, marks)):  # the worst is painted last
        room = tuple(slice(b, e) for b, e in zip(begins[k], finish[k], strict=True))
        found[room], marked[room] = values[k], marks[k]
    names = tuple(pieces.names[k] for k in varying)
    ends = tuple(low.tolist()), tuple(high.tolist())
    return Picture("The starts", names, *ends, found, marked, legend)


def pictures_of_pieces(pieces: Pieces, fails: Booleans, open_: Booleans) -> tuple[Picture, ...]:
    """Return the starts by the steps that they take at most; none where the starts are a point."""
    ends = (pieces.last != NEVER) & ~fails & ~open_
    steps = np.where(ends, pieces.last, 0)
    legend = f"Blue: it holds. {BREAKS}"
    if ends.any():
        fewest = int(steps[ends].min())
        legend = f"Light: {fewest} steps; dark: {int(steps.max())}. {BREAKS}"
    marks = np.select([fails, open_], [FAILS, OPEN], KNOWN)
    found = picture_of(pieces, steps, marks, legend) if pieces.low.size else None
    return () if found is None else (found,)


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
