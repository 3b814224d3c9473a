"""Paired rollouts in model trees."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.world_model import _kernels, _kernels_lanes
from eutree.world_model._kernels import ActionTree, Conditions, Episodes
from eutree.world_model.dynamics import WorldModel

if TYPE_CHECKING:
    from eutree.world_model.ensemble import Ensemble

# All chance comes from tables of draws, indexed by episode and step. So two policies differ in
# their returns only by their actions, and only episodes in which they act differently are run
# again.

DRAWS = 2**18


@dataclass(frozen=True)
class Gain:
    """A paired difference of returns: its mean, its standard error, and if all were compared."""

    mean: float
    error: float
    complete: bool


class Rollouts(ABC):
    """Rollouts of a policy in a world model, and of challengers with the same chance.

    Args:
        model: World that episodes run in.
        n_episodes: Number of episodes E.
        generator: Source of the random numbers of ``redraw``.

    Attributes:
        policy: The policy that was run last.
        generator: As given.
        n_actions: Number of actions A.
    """

    policy: ActionTree
    _tally: Integers  # [1]

    def __init__(
        self, model: "WorldModel | Ensemble", n_episodes: int, generator: np.random.Generator
    ) -> None:
        self.generator = generator
        self.n_actions = model.n_actions
        self._n_seen = model.n_features
        self._n_features = n_features = model.starts.shape[1]
        room = n_episodes * model.horizon
        self._episodes, self._spare, self._trace = (
            empty_episodes(n_episodes, room, n_features) for _ in range(3)
        )
        self._departs = np.empty(n_episodes, dtype=np.int64)
        self.redraw()

    @property
    def n_episodes(self) -> int:
        """Number of episodes E."""
        return self._episodes.returns.size

    @property
    def returns(self) -> Floats:
        """Return of each of the policy's episodes, shape [E]; a view."""
        return self._episodes.returns

    @property
    def n_steps(self) -> int:
        """Number of steps K of the policy's episodes."""
        return int(self._episodes.first[-1])

    @property
    def observations(self) -> Floats:
        """Observation at each step, shape [K, d]; a view, the same one until the next run."""
        return self._observations

    @property
    def node(self) -> Integers:
        """Leaf node of the policy at each step, shape [K]; a view."""
        return self._episodes.node[: self.n_steps]

    @property
    def n_steps_taken(self) -> int:
        """Steps taken so far in its world model."""
        return int(self._tally[0])

    def redraw(self) -> None:
        """Draw other random numbers and other starts; the next ``run`` uses both."""
        self._draw()
        self._look()
        self._departs[:] = self._episodes.first[:-1]
        self._within = np.zeros(1, dtype=np.int64)
        self._drawn = True

    def run(self, policy: ActionTree) -> None:
        """Run the policy's episodes; steps shared with the policy before are not run again."""
        if not self._drawn:
            self._compare(policy)
        self._record(policy)
        self._episodes, self._spare = self._spare, self._episodes
        self.policy, self._drawn = policy, False
        self._look()
        n_nodes = policy.feature.size
        # Few bits are sorted by radix, in linear time.
        nodes = self.node.astype(np.min_scalar_type(n_nodes))
        self._steps = np.argsort(nodes, kind="stable")
        self._begin = np.searchsorted(nodes[self._steps], np.arange(n_nodes + 1))

    def _look(self) -> None:
        self._observations = self._episodes.states[: self.n_steps, : self._n_seen]

    def values_at(self, node: int, feature: int) -> Floats:
        """Return the sorted values of a feature among the steps whose path visits a node."""
        last = node
        while self.policy.feature[last] >= 0:
            last = self.policy.right[last]
        steps = self._steps[self._begin[node] : self._begin[last + 1]]
        return np.sort(self._episodes.states[steps, feature])

    @abstractmethod
    def _draw(self) -> None:
        """Draw the tables of chance, and write the first state of each episode."""

    @abstractmethod
    def _record(self, policy: ActionTree) -> None:
        """Write the policy's episodes to ``_spare``."""

    def _begin_at(self, starts: Floats) -> None:
        """Write episodes of one step each: the starts [S, d] in turn, to which nothing has led."""
        n, episodes = self.n_episodes, self._episodes
        episodes.states[:n, : self._n_features] = starts[np.arange(n) % len(starts)]
        episodes.states[:n, self._n_features :] = 0.0
        episodes.earned[:n], episodes.node[:n], episodes.owner[:n] = 0.0, 0, np.arange(n)
        episodes.first[:] = np.arange(n + 1)

    def _compare(self, challenger: ActionTree) -> None:
        """Find the first step of each episode at which a challenger acts differently."""
        self._within = np.zeros(self.policy.feature.size, dtype=np.int64)
        steps = self._begin, self._steps, self._departs
        _kernels.departures(self.policy, challenger, self._within, self._episodes, *steps)


def empty_episodes(n_episodes: int, room: int, d: int) -> Episodes:
    """Return room for episodes."""
    return Episodes(
        states=np.zeros((room, 2 * d)),
        earned=np.zeros(room),
        node=np.zeros(room, dtype=np.int64),
        owner=np.zeros(room, dtype=np.int64),
        first=np.zeros(n_episodes + 1, dtype=np.int64),
        returns=np.zeros(n_episodes),
    )


class PairedRollouts(Rollouts):
    """Rollouts of a policy in a world model of trees.

    Args:
        model: World that episodes run in.
        n_episodes: Number of episodes E.
        discount: gamma.
        generator: Source of the random numbers of ``redraw``.
    """

    def __init__(
        self, model: WorldModel, n_episodes: int, discount: float, generator: np.random.Generator
    ) -> None:
        self.model, self._tally = model, model.world.tally
        self._conditions = Conditions(model.world, np.empty(DRAWS), model.horizon, discount)
        super().__init__(model, n_episodes, generator)

    @property
    def mean_return(self) -> float:
        """Mean return of the policy's episodes."""
        return float(self._episodes.returns.mean())

    def gain(self, challenger: ActionTree, *, hopeless: float = -np.inf) -> Gain:
        """Return the challenger's gain over the policy; stop early below ``hopeless``.

        A comparison that stopped early returns its estimate of the complete one.
        """
        self._compare(challenger)
        here = self._conditions, self._episodes, self._departs
        bounds = hopeless, self._spread
        n, total, squares, complete = _kernels_lanes.difference(*here, challenger, *bounds)
        if n == 0:
            return Gain(0.0, 0.0, complete)
        share = 1.0 if complete else int(np.count_nonzero(self._departs >= 0)) / n
        mean, square = share * total / self.n_episodes, share * squares / self.n_episodes
        return Gain(mean, math.sqrt(max(square - mean * mean, 0.0) / self.n_episodes), complete)

    def deviations(self, steps: Integers) -> Floats:
        """Return the gain of one other action at each of the steps, shape [n, A]."""
        out = np.zeros((steps.size, self.n_actions))
        _kernels_lanes.deviations(self._conditions, self._episodes, self.policy, steps, out)
        return out

    def _draw(self) -> None:
        self.generator.random(out=self._conditions.draws)
        starts = self.model.starts
        self._begin_at(starts[self.generator.permutation(starts.shape[0])])

    def _record(self, policy: ActionTree) -> None:
        here = self._conditions, self._episodes, self._departs
        _kernels_lanes.record(*here, self._within, policy, self._trace, self._spare)
        self._spread = float(np.ptp(self._spare.returns))
