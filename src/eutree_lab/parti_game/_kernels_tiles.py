"""Compiled loops of the learned local controller: tiles of several sizes, one step at a time."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled

RATE = 0.1  # least rate of learning; the first values seen are averaged
FAMILIARITY = 1.05  # by which each visit divides the chance to explore


class Tiles(NamedTuple):
    """Tiles of all levels, one level after another; each learns the residual of coarser ones."""

    levels: Integers  # [K] tiles of an axis
    low: Floats  # [d]
    span: Floats  # [d]
    means: Floats  # [A, T, d] displacement in units of the box
    errors: Floats  # [A, T] mean squared error after this level, normalized
    visits: Integers  # [A, T]
    size: Floats  # [2] sum and number of squared displacements, the unit of errors


@compiled
def tile(tiles: Tiles, observation: Floats, level: int, first: int) -> int:
    """Return the tile of a level that holds an observation; ``first`` is the level's first tile."""
    n, number = tiles.levels[level], 0
    for i in range(observation.size):
        # Row by row, the last axis fastest; outside of the box the tiles at its border answer.
        share = (observation[i] - tiles.low[i]) / tiles.span[i]
        number = number * n + min(max(int(share * n), 0), n - 1)
    return first + number


@compiled
def learn(tiles: Tiles, observation: Floats, action: int, left: Floats) -> None:
    """Learn from a displacement ``left``, in units of the box; it is changed to the residual."""
    square = 0.0
    for i in range(left.size):
        square += left[i] * left[i]
    tiles.size[0] += square
    tiles.size[1] += 1.0
    # Mean squared displacement so far: errors measured by it compare between tasks.
    typical = max(tiles.size[0] / tiles.size[1], 1e-12)
    first = 0
    for level in range(tiles.levels.size):
        at = tile(tiles, observation, level, first)
        first += tiles.levels[level] ** observation.size
        tiles.visits[action, at] += 1
        # 1 / n averages the first 1 / RATE values exactly; later ones replace older ones slowly.
        rate = max(RATE, 1.0 / tiles.visits[action, at])
        error = 0.0
        for i in range(left.size):  # the residual of this level is the next one's target
            left[i] -= tiles.means[action, at, i]
            error += left[i] * left[i]
            tiles.means[action, at, i] += rate * left[i]
        error = min(error / typical, 1.0)
        tiles.errors[action, at] += rate * (error - tiles.errors[action, at])


@compiled
def predict(tiles: Tiles, observation: Floats, moves: Floats) -> float:
    """Write the displacements [A, d] of actions, in units of the box; return the chance to explore.

    That is the mean error of the finest tiles seen of each action, less where they are familiar.
    """
    moves[:] = 0.0
    n_actions = moves.shape[0]
    errors = np.ones(n_actions)
    first, n_seen = 0, 0
    for level in range(tiles.levels.size):
        at = tile(tiles, observation, level, first)
        first += tiles.levels[level] ** observation.size
        n_seen = 0
        for action in range(n_actions):
            # errors[a]: of the finest level seen so far, 1 as long as there is none.
            if tiles.visits[action, at] > 0:
                errors[action] = tiles.errors[action, at]
            n_seen += tiles.visits[action, at]
            for i in range(observation.size):
                moves[action, i] += tiles.means[action, at, i]
    doubt: float = errors.mean() * FAMILIARITY ** (-n_seen)
    return doubt


@compiled
def nearest(observation: Floats, target: Floats, moves: Floats, span: Floats, left: Floats) -> None:
    """Write the squared distance to the target that each action leaves, [A]; moves by span."""
    for action in range(moves.shape[0]):
        left[action] = 0.0
        for i in range(observation.size):
            apart = (target[i] - observation[i]) / span[i] - moves[action, i]
            left[action] += apart * apart
