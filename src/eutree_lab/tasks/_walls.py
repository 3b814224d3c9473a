"""Plans of the mazes of Al-Ansari's thesis, and walking among straight walls."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats

SIDE = 10.0  # of the square
GAP = 1e-6  # how far before a wall a step is halted


class Maze(NamedTuple):
    """Walls as (x, y, x', y'), start (x, y) and goal box (x, y, x', y') of one maze."""

    walls: tuple[tuple[float, ...], ...]
    start: tuple[float, float]
    goal: tuple[float, float, float, float]


BORDER = ((0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0))
PLANS = {  # read off the figures of the thesis, exact to about 0.02
    "a": Maze(
        ((0.5, 2, 5.1, 2), (5.1, 2, 5.1, 6), (2, 8, 7, 8), (7, 8, 7, 0)),
        (1, 1), (8.4, 4.7, 8.8, 5.1),
    ),
    "b": Maze(
        ((4, 0, 4, 6), (0.5, 6, 4, 6), (6, 4, 6, 5.5), (6, 6, 6, 10), (6, 4, 10, 4)),
        (1, 1), (8.6, 8.8, 9.0, 9.2),
    ),
    "c": Maze(
        tuple((0.5, k, k, 0.5) for k in (2, 4, 6, 8, 9.5)),
        (1, 1), (8.65, 8.8, 9.05, 9.2),
    ),
    "d": Maze(((10, 2, 2, 2),), (1, 9), (8.6, 0.85, 9.0, 1.25)),
}  # fmt: skip


def walk(walls: Floats, states: Floats, moves: Floats) -> Floats:
    """Return where each move ends: at its full length, or just before the first wall.

    Args:
        walls: Ends x, y, x', y' of each wall, shape [W, 4].
        states: Where to start, shape [N, 2].
        moves: Where to, relative to the start, shape [N, 2].
    """
    along = walls[:, 2:] - walls[:, :2]  # [W, 2]
    apart = walls[np.newaxis, :, :2] - states[:, np.newaxis]  # [N, W, 2]
    there = moves[:, np.newaxis]
    with np.errstate(divide="ignore", invalid="ignore"):
        # states + t moves = wall + u along; parallels give nan or inf and never meet.
        across = _cross(there, along)  # [N, W]
        t, u = _cross(apart, along) / across, _cross(apart, there) / across
    meets = (t >= 0.0) & (u >= -1e-9) & (u <= 1.0 + 1e-9)
    first = np.where(meets, t, np.inf).min(axis=1)
    length = np.maximum(np.hypot(moves[:, 0], moves[:, 1]), GAP)
    share = np.clip(first - GAP / length, 0.0, 1.0)
    ends: Floats = np.clip(states + share[:, np.newaxis] * moves, 0.0, SIDE)
    return ends


def _cross(a: Floats, b: Floats) -> Floats:
    product: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
