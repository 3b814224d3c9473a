"""Paired rollouts: episodes of a policy in a world model, and rivals with common random numbers.

All chance comes from one table of draws, indexed by episode and step. So two policies differ in
their returns only by what they do, and only episodes in which they act differently are run again.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.world_model import _kernels, _kernels_policy
from eutree.world_model._kernels import ActionTree, Episodes
from eutree.world_model.dynamics import WorldModel

DRAWS = 2**18


@dataclass(frozen=True)
class Gain:
    """A paired difference of returns: its mean, its standard error, and if all were compared."""

    mean: float
    error: float
    complete: bool


class PairedRollouts:
    """Rollouts of a policy in a world model.

    Args:
        model: The world model.
        n_episodes: Number of episodes E.
        discount: gamma.
        generator: Source of the random numbers of ``redraw``.

    Attributes:
        policy: The policy that was run last.
    """

    policy: ActionTree

    def __init__(
        self, model: WorldModel, n_episodes: int, discount: float, generator: np.random.Generator
    ) -> None:
        self.model = model
        self.generator = generator
        self._discount = discount
        d = model.starts.shape[1]
        room = n_episodes * model.horizon
        self._episodes, self._spare = (_empty(n_episodes, room, d) for _ in range(2))
        self._departs = np.empty(n_episodes, dtype=np.int64)
        self._steps = np.empty(room, dtype=np.int64)
        self.redraw()

    @property
    def n_episodes(self) -> int:
        """Number of episodes E."""
        return self._episodes.returns.size

    @property
    def n_steps(self) -> int:
        """Number of steps K of the policy's episodes."""
        return int(self._episodes.first[-1])

    @property
    def observations(self) -> Floats:
        """Observation at each step, shape [K, d]; a view."""
        return self._episodes.states[: self.n_steps, : self.model.starts.shape[1]]

    @property
    def node(self) -> Integers:
        """Leaf node of the policy at each step, shape [K]; a view."""
        return self._episodes.node[: self.n_steps]

    @property
    def mean_return(self) -> float:
        """Mean return of the policy's episodes."""
        return float(self._episodes.returns.mean())

    def redraw(self) -> None:
        """Draw other random numbers and another order of starts; the next ``run`` uses both."""
        self._draws = self.generator.random(DRAWS)
        starts = self.model.starts
        _kernels.assign_starts(starts[self.generator.permutation(starts.shape[0])], self._episodes)
        self._departs[:] = self._episodes.first[:-1]
        self._within = np.zeros(1, dtype=np.int64)
        self._drawn = True

    def run(self, policy: ActionTree) -> None:
        """Run the policy's episodes; what it does like the policy before is not run again."""
        if not self._drawn:
            self._compare(policy)
        _kernels.record(
            self.model.world,
            self._draws,
            self._episodes,
            self._departs,
            self._within,
            policy,
            self.model.horizon,
            self._discount,
            self._spare,
        )
        self._episodes, self._spare = self._spare, self._episodes
        self.policy, self._drawn = policy, False
        self._begin = np.empty(policy.feature.size + 1, dtype=np.int64)
        _kernels_policy.bucket(self.node, self._begin, self._steps)

    def gain(self, rival: ActionTree, *, hopeless: float = -np.inf) -> Gain:
        """Return what the rival earns more than the policy; stop early below ``hopeless``.

        A comparison that stopped early returns what it expects of a complete one.
        """
        self._compare(rival)
        n, total, squares, complete = _kernels.difference(
            self.model.world,
            self._draws,
            self._episodes,
            self._departs,
            rival,
            self.model.horizon,
            self._discount,
            hopeless,
        )
        if n == 0:
            return Gain(0.0, 0.0, complete)
        share = 1.0 if complete else np.count_nonzero(self._departs >= 0) / n
        mean, square = share * total / self.n_episodes, share * squares / self.n_episodes
        error = np.sqrt(max(square - mean * mean, 0.0) / self.n_episodes)
        return Gain(mean, float(error), complete)

    def deviations(self, steps: Integers) -> Floats:
        """Return what one other action at each of the steps earns more, shape [n, A]."""
        out = np.zeros((steps.size, self.model.n_actions))
        _kernels.deviations(
            self.model.world,
            self._draws,
            self._episodes,
            self.policy,
            steps,
            self.model.horizon,
            self._discount,
            out,
        )
        return out

    def values_at(self, node: int, feature: int) -> Floats:
        """Return the sorted values of a feature among the steps whose path visits a node."""
        last = node
        while self.policy.feature[last] >= 0:
            last = self.policy.right[last]
        steps = self._steps[self._begin[node] : self._begin[last + 1]]
        return np.sort(self._episodes.states[steps, feature])

    def _compare(self, rival: ActionTree) -> None:
        """Find the first step of each episode at which a rival acts differently."""
        self._within = np.zeros(self.policy.feature.size, dtype=np.int64)
        _kernels_policy.overlay(self.policy, rival, self.model.starts.shape[1], self._within)
        _kernels_policy.departures(
            self.policy,
            rival,
            self._within,
            self._episodes,
            self._begin,
            self._steps,
            self._departs,
        )


def _empty(n_episodes: int, room: int, d: int) -> Episodes:
    """Return room for episodes."""
    return Episodes(
        states=np.empty((room, 2 * d)),
        earned=np.empty(room),
        node=np.empty(room, dtype=np.int64),
        owner=np.empty(room, dtype=np.int64),
        first=np.zeros(n_episodes + 1, dtype=np.int64),
        returns=np.empty(n_episodes),
    )
