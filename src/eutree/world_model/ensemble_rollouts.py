"""Rollouts in every member of an ensemble, and rivals with the same random numbers."""

import numpy as np

from eutree.arrays import Floats
from eutree.world_model import _kernels, _kernels_policy
from eutree.world_model import _kernels_ensemble as kernels
from eutree.world_model._kernels import ActionTree, Episodes
from eutree.world_model._kernels_ensemble import Draws
from eutree.world_model.ensemble import Ensemble

DRAWS = 2**18


class EnsembleRollouts:
    """Paired rollouts of policy trees in an ensemble.

    Episode e starts at the observation e // M, in member e % M: every member meets every start.

    Args:
        ensemble: The world model, M members.
        n_starts: Stored first observations to start from.
        generator: Source of starts and of all random numbers.
        pessimism: k of the score, the mean over members minus k standard deviations.

    Attributes:
        n_members: Members M.
        policy: The policy that rivals are compared with.
    """

    policy: ActionTree

    def __init__(
        self,
        ensemble: Ensemble,
        n_starts: int,
        generator: np.random.Generator,
        *,
        pessimism: float = 0.5,
    ) -> None:
        self._world = ensemble.world
        self._range = ensemble.returns
        self._horizon = ensemble.horizon
        self.n_members = len(ensemble.weights)
        self._pessimism = pessimism
        self._draws = Draws(generator.random(DRAWS), generator.standard_normal(DRAWS))
        d = ensemble.starts.shape[1]
        n = n_starts * self.n_members
        self._episodes, self._spare = (_empty(n, n * self._horizon, d) for _ in range(2))
        chosen = generator.integers(len(ensemble.starts), size=n_starts)
        _kernels.assign_starts(
            np.repeat(ensemble.starts[chosen], self.n_members, axis=0), self._episodes
        )
        self._departs = self._episodes.first[:-1].copy()
        self._within = np.zeros(1, dtype=np.int64)
        self._steps = np.empty(n * self._horizon, dtype=np.int64)
        self._new = True

    @property
    def n_episodes(self) -> int:
        """Number of episodes E."""
        return self._episodes.returns.size

    @property
    def observations(self) -> Floats:
        """Observation at each step of the policy's episodes, shape [K, d]; a view."""
        n_steps = int(self._episodes.first[-1])
        return self._episodes.states[:n_steps, : self._world.move.size]

    @property
    def returns(self) -> Floats:
        """Return of each of the policy's episodes, shape [E]."""
        return self._cut(self._episodes.returns)

    def run(self, policy: ActionTree) -> None:
        """Imagine a policy's episodes; what it does like the one before is kept."""
        if not self._new:
            self._compare(policy)
        kernels.record(
            self._world,
            self._draws,
            self._episodes,
            self._departs,
            self._within,
            policy,
            self._horizon,
            self._spare,
        )
        self._episodes, self._spare = self._spare, self._episodes
        self.policy, self._new = policy, False
        n_steps = int(self._episodes.first[-1])
        self._begin = np.empty(policy.feature.size + 1, dtype=np.int64)
        _kernels_policy.bucket(self._episodes.node[:n_steps], self._begin, self._steps)

    def returns_of(self, rival: ActionTree, n_episodes: int | None = None) -> Floats:
        """Return what a rival of the policy earns in the first n episodes, by default all."""
        self._compare(rival)
        n = self.n_episodes if n_episodes is None else n_episodes
        out = np.empty(n)
        kernels.rival_returns(
            self._world,
            self._draws,
            self._episodes,
            self._departs,
            rival,
            self._horizon,
            0,
            n,
            out,
        )
        return self._cut(out)

    def score(self, returns: Floats) -> float:
        """Return the mean over members minus k standard deviations, of returns [n M]."""
        of_members = returns.reshape(-1, self.n_members).mean(axis=0)
        return float(of_members.mean() - self._pessimism * of_members.std())

    def _cut(self, returns: Floats) -> Floats:
        """Return returns no lower and no higher than nearly all real ones were."""
        return np.clip(returns, *self._range)

    def _compare(self, rival: ActionTree) -> None:
        """Find the first step of each episode at which a rival acts otherwise."""
        self._within = np.zeros(self.policy.feature.size, dtype=np.int64)
        n_features = self._world.move.size
        _kernels_policy.overlay(self.policy, rival, n_features, self._within)
        _kernels_policy.departures(
            self.policy,
            rival,
            self._within,
            self._episodes,
            self._begin,
            self._steps,
            self._departs,
        )


def _empty(n_episodes: int, n_steps: int, d: int) -> Episodes:
    """Return room for episodes."""
    return Episodes(
        states=np.zeros((n_steps, 2 * d)),
        earned=np.zeros(n_steps),
        node=np.zeros(n_steps, dtype=np.int64),
        owner=np.zeros(n_steps, dtype=np.int64),
        first=np.zeros(n_episodes + 1, dtype=np.int64),
        returns=np.zeros(n_episodes),
    )
