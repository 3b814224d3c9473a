"""The state of N-Evasion as a picture of characters: render mode ``ansi``."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.envs._dynamics import EvasionParameters, EvasionState

WIDTH, HEIGHT = 61, 13  # characters; the main path is the middle row


def text_picture(parameters: EvasionParameters, state: EvasionState) -> str:
    """Return the agent ``A``, the opponents ``^`` and ``v`` by direction, paths and goal ``G``."""
    canvas = np.full((HEIGHT, WIDTH), " ")
    middle = HEIGHT // 2
    canvas[middle] = "-"
    canvas[middle, -1] = "G"
    columns = _cells(parameters.crossing / parameters.main_path_length, WIDTH)
    canvas[:, columns] = ":"
    rows = _cells(0.5 - state.opponents / parameters.path_length, HEIGHT)
    canvas[rows, columns] = np.where(state.directions > 0.0, "^", "v")
    canvas[middle, _cells(state.position / parameters.main_path_length, WIDTH)] = "A"
    return "\n".join("".join(row).rstrip() for row in canvas)


def _cells(shares: Floats, count: int) -> Integers:
    """Return the cell, of ``count``, in which each share of the whole lies."""
    return np.asarray(np.rint(shares * (count - 1)), dtype=np.int64)
