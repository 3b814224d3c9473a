"""Imagined episodes of one policy, and how rivals would have done with the same luck."""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.imagination import _kernels
from eutree.imagination._kernels import ActionTree, Episodes
from eutree.imagination.world_model import WorldModel

DRAWS = 2**18


@dataclass(frozen=True)
class Gain:
    """A paired difference of returns: its mean, its standard error, and if all were compared."""

    mean: float
    error: float
    complete: bool


class Rehearsal:
    """Imagined episodes of a policy in a world model.

    Args:
        model: The world model.
        n_episodes: Number of episodes E.
        discount: gamma.
        generator: Source of the luck of ``reshuffle``.

    Attributes:
        policy: The policy rehearsed last.
        taken: Its action at each step.
        node: Leaf node of each step.
    """

    def __init__(
        self, model: WorldModel, n_episodes: int, discount: float, generator: np.random.Generator
    ) -> None:
        d = model.starts.shape[1]
        room = n_episodes * model.horizon
        self.model = model
        self.generator = generator
        self._discount = discount
        self._room = Episodes(
            observations=np.empty((room, d)),
            displacements=np.empty((room, d)),
            earned=np.empty(room),
            first=np.zeros(n_episodes + 1, dtype=np.int64),
            returns=np.empty(n_episodes),
        )
        self._differences = np.empty(n_episodes)
        self.reshuffle()

    @property
    def n_episodes(self) -> int:
        """Number of episodes E."""
        return self._room.returns.size

    @property
    def n_steps(self) -> int:
        """Number of steps K of the policy's episodes."""
        return int(self._room.first[-1])

    @property
    def observations(self) -> Floats:
        """Observation at each step, shape [K, d]; a view."""
        return self._room.observations[: self.n_steps]

    @property
    def mean_return(self) -> float:
        """Mean return of the policy's episodes."""
        return float(self._room.returns.mean())

    def reshuffle(self) -> None:
        """Draw new luck, and deal the starts anew; the next ``rehearse`` uses both."""
        self._draws = self.generator.random(DRAWS)
        starts = self.model.starts
        self._starts = starts[self.generator.permutation(starts.shape[0])]

    def rehearse(self, policy: ActionTree) -> None:
        """Imagine the policy's episodes."""
        _kernels.record(
            self.model.forest,
            self._draws,
            self._starts,
            policy,
            self.model.horizon,
            self._discount,
            self._room,
        )
        self.policy = policy
        self.node = np.empty(self.n_steps, dtype=np.int64)
        _kernels.locate(policy, self.observations, self.node)
        self.taken = policy.action[self.node]

    def gain(self, rival: ActionTree, *, hopeless: float = -np.inf) -> Gain:
        """Return what the rival earns more than the policy; stop early below ``hopeless``."""
        out = self._differences
        n = _kernels.difference(
            self.model.forest,
            self._draws,
            self._room,
            self.taken,
            rival,
            self.model.horizon,
            self._discount,
            hopeless,
            out,
        )
        complete = n == self.n_episodes
        return Gain(float(out[:n].mean()), float(out[:n].std() / np.sqrt(n)), complete)

    def deviations(self, steps: Integers) -> Floats:
        """Return what one other action at each of the steps earns more, shape [n, A]."""
        out = np.zeros((steps.size, self.model.n_actions))
        _kernels.deviations(
            self.model.forest,
            self._draws,
            self._room,
            self.policy,
            steps,
            np.searchsorted(self._room.first, steps, side="right") - 1,
            self.taken[steps],
            self.model.horizon,
            self._discount,
            out,
        )
        return out

    def values_at(self, node: int, feature: int) -> Floats:
        """Return the sorted values of a feature among the steps whose path visits a node."""
        rows = np.empty(self.n_steps, dtype=np.int64)
        n = _kernels.passes(self.policy, node, self.observations, rows)
        return np.sort(self.observations[rows[:n], feature])
