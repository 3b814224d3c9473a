"""Local controllers: which action brings one nearest to a point.

A controller looks one step ahead in a model of displacements, ``argmin_a |p - (o + F(o, a))|``, and
may learn the model as it goes (Al-Ansari 2001, chapter 6): tiles of several sizes, each of which
learns the residual of the coarser ones, so that a place never seen is taken to be like its
surroundings. Lengths are in units of the box.
"""

import numpy as np

from eutree.arrays import Floats
from eutree_lab.parti_game import _kernels_tiles as kernels
from eutree_lab.parti_game._kernels_tiles import Tiles

LEVELS = (1, 4, 16)  # tiles of an axis
MOST_TILES = 100_000


class LearnedController:
    """A controller that learns its model of displacements, and explores where it is bad.

    Args:
        low: Lower corner of the box, shape [d].
        span: Its sides, shape [d].
        n_actions: Number of actions A.

    Attributes:
        tiles: The learned model; arrays that change in place.
    """

    def __init__(self, low: Floats, span: Floats, n_actions: int) -> None:
        d = low.size
        levels = np.array([n for n in LEVELS if n**d <= MOST_TILES], dtype=np.int64)
        n_tiles = int((levels**d).sum())
        self.tiles = Tiles(
            levels, np.array(low), np.array(span), np.zeros((n_actions, n_tiles, d)),
            np.ones((n_actions, n_tiles)), np.zeros((n_actions, n_tiles), np.int64), np.zeros(2),
        )  # fmt: skip
        self._moves = np.empty((n_actions, d))

    def act(self, observation: Floats, target: Floats, generator: np.random.Generator) -> int:
        """Return a random action where the model is bad and unfamiliar, else the best."""
        doubt = kernels.predict(self.tiles, observation, self._moves)
        if generator.random() < doubt:
            return int(generator.integers(len(self._moves)))
        near = nearest(observation, target, self._moves, self.tiles.span)
        return near[0] if len(near) == 1 else near[int(generator.integers(len(near)))]

    def best(self, observation: Floats, target: Floats) -> int:
        """Return the action that leads nearest to the target, without exploring; first on ties."""
        kernels.predict(self.tiles, observation, self._moves)
        return nearest(observation, target, self._moves, self.tiles.span)[0]

    def learn(self, observation: Floats, action: int, after: Floats) -> None:
        """Learn from a step."""
        kernels.learn(self.tiles, observation, action, (after - observation) / self.tiles.span)

    def predict(self, observation: Floats) -> tuple[Floats, float]:
        """Return the expected displacement of each action, [A, d], and the chance to explore."""
        doubt = kernels.predict(self.tiles, observation, self._moves)
        return self._moves * self.tiles.span, doubt


def nearest(observation: Floats, target: Floats, moves: Floats, span: Floats) -> list[int]:
    """Return the actions that lead nearest to the target, ascending.

    Args:
        observation: Where one is, shape [d].
        target: Where one wants to go, shape [d].
        moves: Displacement of each action, in units of the box, shape [A, d].
        span: The unit of lengths, shape [d].
    """
    left = np.empty(len(moves))
    kernels.nearest(observation, target, moves, span, left)
    distances: list[float] = left.tolist()
    least = min(distances) + 1e-15
    return [action for action, distance in enumerate(distances) if distance <= least]
