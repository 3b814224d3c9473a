"""Paired rollouts in model trees."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.world_model import _kernels, _kernels_lanes
from eutree.world_model._kernels import ActionTree, Conditions
from eutree.world_model.common_chance import DRAWS, Gain, Rollouts
from eutree.world_model.dynamics import WorldModel


class PairedRollouts(Rollouts):
    """Rollouts of a policy in a world model of trees.

    Args:
        model: The world model.
        n_episodes: Number of episodes E.
        discount: gamma.
        generator: Source of the random numbers of ``redraw``.
    """

    def __init__(
        self, model: WorldModel, n_episodes: int, discount: float, generator: np.random.Generator
    ) -> None:
        self.model = model
        self._discount = discount
        super().__init__(n_episodes, model.horizon, model.starts.shape[1], generator)

    @property
    def n_steps_taken(self) -> int:
        """Steps taken so far in its world model."""
        return self.model.n_steps_taken

    @property
    def mean_return(self) -> float:
        """Mean return of the policy's episodes."""
        return float(self._episodes.returns.mean())

    def gain(self, rival: ActionTree, *, hopeless: float = -np.inf) -> Gain:
        """Return what the rival earns more than the policy; stop early below ``hopeless``.

        A comparison that stopped early returns what it expects of a complete one.
        """
        self._compare(rival)
        n, total, squares, complete = _kernels_lanes.difference(
            self._conditions,
            self._episodes,
            self._departs,
            rival,
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
        _kernels_lanes.deviations(self._conditions, self._episodes, self.policy, steps, out)
        return out

    def _draw(self) -> None:
        draws = self.generator.random(DRAWS)
        self._conditions = Conditions(self.model.world, draws, self.model.horizon, self._discount)
        starts = self.model.starts
        _kernels.assign_starts(starts[self.generator.permutation(starts.shape[0])], self._episodes)

    def _record(self, policy: ActionTree) -> None:
        _kernels_lanes.record(
            self._conditions,
            self._episodes,
            self._departs,
            self._within,
            policy,
            self._spare,
        )
