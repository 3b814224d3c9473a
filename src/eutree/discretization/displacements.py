"""Local controllers: which action brings one nearest to a point.

A controller looks one step ahead in a model of displacements, ``argmin_a |p - (o + F(o, a))|``, and
may learn the model as it goes (Al-Ansari 2001, chapter 6): tiles of several sizes, each of which
learns what the coarser ones leave unexplained, so that a place never seen is taken to be like its
surroundings. Lengths are in units of the box.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from eutree.arrays import Floats, Integers

RATE = 0.1  # least rate of learning; the first values seen are averaged
FAMILIARITY = 1.05  # by which each visit divides the chance to explore
LEVELS = (1, 4, 16)  # tiles of an axis
MOST_TILES = 100_000


class Controller(Protocol):
    """Brings the system towards a point, as well as it can."""

    def act(self, observation: Floats, target: Floats, generator: np.random.Generator) -> int:
        """Return the action to take at an observation on the way to a target, both [d]."""

    def learn(self, observation: Floats, action: int, after: Floats) -> None:
        """Take note of a step."""


class GivenController:
    """A controller with a known model of displacements.

    Args:
        displacements: From an observation [d] to what each action adds to it, [A, d].
        span: Sides of the box, the unit of lengths, shape [d].
    """

    def __init__(self, displacements: Callable[[Floats], Floats], span: Floats) -> None:
        self._displacements = displacements
        self._span = span

    def act(self, observation: Floats, target: Floats, generator: np.random.Generator) -> int:
        """Return the action that leads nearest to the target; the first on ties."""
        return int(missed(observation, target, self._displacements(observation), self._span))

    def learn(self, observation: Floats, action: int, after: Floats) -> None:
        """Learn nothing: the model is known."""


class LearnedController:
    """A controller that learns its model of displacements, and explores where it is bad.

    Args:
        low: Lower corner of the box, shape [d].
        span: Its sides, shape [d].
        n_actions: Number of actions A.

    Attributes:
        means: What tiles of each level add to the displacement, in units of the box.
        errors: Mean squared error of the prediction at each tile, normalized.
        visits: How often each tile was seen.
        size: Mean square of a displacement, the unit of errors, and how many it is of.
    """

    def __init__(self, low: Floats, span: Floats, n_actions: int) -> None:
        self._low, self._span, self._n_actions = low, span, n_actions
        d = low.size
        self._levels = [n for n in LEVELS if n**d <= MOST_TILES]
        self.means = [np.zeros((n_actions, n**d, d)) for n in self._levels]
        self.errors = [np.ones((n_actions, n**d)) for n in self._levels]
        self.visits = [np.zeros((n_actions, n**d), dtype=np.int64) for n in self._levels]
        self.size = np.zeros(2)

    def act(self, observation: Floats, target: Floats, generator: np.random.Generator) -> int:
        """Return a random action where the model is bad and unfamiliar, else the best."""
        tiles = self._tiles(observation)
        if generator.random() < self._doubt(tiles):
            return int(generator.integers(self._n_actions))
        there = self.predict(observation) * self._span
        return int(missed(observation, target, there, self._span, generator))

    def learn(self, observation: Floats, action: int, after: Floats) -> None:
        """Learn from a step."""
        seen = (after - observation) / self._span
        self.size += [float(seen @ seen), 1.0]
        typical = max(self.size[0] / self.size[1], 1e-12)
        left = seen
        for level, tile in enumerate(self._tiles(observation)):
            visits = self.visits[level]
            visits[action, tile] += 1
            rate = max(RATE, 1.0 / visits[action, tile])
            left = left - self.means[level][action, tile]
            error = min(float(left @ left) / typical, 1.0)
            self.errors[level][action, tile] += rate * (error - self.errors[level][action, tile])
            self.means[level][action, tile] += rate * left

    def predict(self, observation: Floats) -> Floats:
        """Return what each action is expected to add, in units of the box, shape [A, d]."""
        tiles = self._tiles(observation)
        total = np.zeros((self._n_actions, observation.size))
        for means, tile in zip(self.means, tiles, strict=True):
            total += means[:, tile]
        return total

    def _doubt(self, tiles: Integers) -> float:
        """Return the mean error of the finest tiles seen, less where they are familiar."""
        error = np.ones(self._n_actions)
        n_seen = 0
        for errors, visits, tile in zip(self.errors, self.visits, tiles, strict=True):
            error = np.where(visits[:, tile] > 0, errors[:, tile], error)
            n_seen = int(visits[:, tile].sum())
        return float(error.mean()) * FAMILIARITY**-n_seen

    def _tiles(self, observation: Floats) -> Integers:
        """Return the tile of each level that holds an observation."""
        share = np.clip((observation - self._low) / self._span, 0.0, 1.0 - 1e-12)
        return np.array(
            [np.ravel_multi_index((share * n).astype(np.int64).tolist(), (n,) * share.size)
             for n in self._levels]
        )  # fmt: skip


def missed(
    observation: Floats,
    target: Floats,
    displacements: Floats,
    span: Floats,
    generator: np.random.Generator | None = None,
) -> int:
    """Return the action that leads nearest to the target.

    Args:
        observation: Where one is, shape [d].
        target: Where one wants to go, shape [d].
        displacements: What each action adds, shape [A, d].
        span: Unit of lengths, shape [d].
        generator: Decides ties; None takes the first.
    """
    apart = ((target - observation - displacements) / span) ** 2
    distance = apart.sum(axis=1)
    near = np.flatnonzero(distance <= distance.min() + 1e-15)
    return int(near[0] if generator is None else generator.choice(near))
