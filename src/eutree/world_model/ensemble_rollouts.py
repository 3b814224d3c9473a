"""Rollouts in every member of an ensemble, and challengers with the same random numbers."""

import numpy as np

from eutree.arrays import Floats
from eutree.world_model import _kernels_ensemble as kernels
from eutree.world_model._kernels import ActionTree
from eutree.world_model._kernels_ensemble import Draws, EnsembleConditions
from eutree.world_model.action_trees import n_leaves, with_child
from eutree.world_model.ensemble import Ensemble
from eutree.world_model.rollouts import DRAWS, Rollouts

PESSIMISM = 0.5  # standard deviations of the members that are taken off a score


class EnsembleRollouts(Rollouts):
    """Paired rollouts of policy trees in an ensemble.

    Episode e starts at the observation e // M, in member e % M: every member meets every start.

    Args:
        ensemble: The world model, M members.
        n_starts: Stored first observations to start from.
        generator: Source of starts and of all random numbers.

    Attributes:
        n_members: Members M.
    """

    def __init__(self, ensemble: Ensemble, n_starts: int, generator: np.random.Generator) -> None:
        self._world = ensemble.world
        self._tally = self._world.tally
        self._range = ensemble.returns
        self._horizon = ensemble.horizon
        self._starts, self._n_starts = ensemble.starts, n_starts
        self.n_members = len(ensemble.weights)
        super().__init__(ensemble, n_starts * self.n_members, generator)

    @property
    def returns(self) -> Floats:
        """Return of each of the policy's episodes, shape [E]."""
        return self._cut(self._episodes.returns)

    def returns_of(self, challenger: ActionTree, first: int = 0, last: int | None = None) -> Floats:
        """Return a challenger's returns in episodes ``first`` to ``last`` - 1, by default all."""
        self._compare(challenger)
        out = np.empty(self.n_episodes if last is None else last)
        here = self._conditions, self._episodes, self._departs
        kernels.challenger_returns(*here, challenger, first, out.size, out)
        return self._cut(out[first:])

    def score(self, returns: Floats) -> float:
        """Return the mean over members less ``PESSIMISM`` deviations, of returns [n M]."""
        of_members = returns.reshape(-1, self.n_members).mean(axis=0)
        return float(of_members.mean() - PESSIMISM * of_members.std())

    def _cut(self, returns: Floats) -> Floats:
        """Return returns no lower and no higher than nearly all real ones were."""
        return np.clip(returns, *self._range)

    def _draw(self) -> None:
        generator = self.generator
        draws = Draws(generator.random(DRAWS), generator.standard_normal(DRAWS))
        self._conditions = EnsembleConditions(self._world, draws, self._horizon)
        chosen = generator.integers(len(self._starts), size=self._n_starts)
        starts = np.repeat(self._starts[chosen], self.n_members, axis=0)
        self._begin_at(starts)

    def _record(self, policy: ActionTree) -> None:
        here = self._conditions, self._episodes, self._departs
        kernels.record(*here, self._within, policy, self._spare)


# A tree that copies a teacher is cut to size one node at a time. A node gives way to one of its
# children; of some such cuts, drawn at random, those that cost least in a few rollouts are
# compared on all of them, and the best is made.

TRIED = 24  # cuts that are looked at before one is made
SHORT_LOOK = 40  # episodes of pruning, about
BEST = 5  # cuts that are compared on all episodes


def pruned_by_rollouts(
    tree: ActionTree, rollouts: EnsembleRollouts, max_leaves: int, generator: np.random.Generator
) -> tuple[ActionTree, float]:
    """Return the tree pruned to at most so many leaves, and its score in the rollouts.

    The rollouts end with the result run; ``generator`` draws the cuts that are tried.
    """
    rollouts.run(tree)
    while n_leaves(rollouts.policy) > max_leaves:
        rollouts.run(_best_cut(rollouts, generator))
    return rollouts.policy, rollouts.score(rollouts.returns)


def _best_cut(rollouts: EnsembleRollouts, generator: np.random.Generator) -> ActionTree:
    """Return the policy of the rollouts after the best of some cuts."""
    policy = rollouts.policy
    inner = np.flatnonzero(policy.feature >= 0)
    places = generator.permutation(2 * inner.size)[:TRIED]
    few = max(SHORT_LOOK * rollouts.n_episodes // 150, 1)
    few -= few % rollouts.n_members
    few = max(few, rollouts.n_members)
    looked_at = []
    for place in places.tolist():
        challenger, _ = with_child(policy, int(inner[place // 2]), goes_left=place % 2 == 0)
        known = rollouts.returns_of(challenger, last=few)
        looked_at.append((rollouts.score(known), place, challenger, known))
    looked_at.sort(key=lambda one: (-one[0], one[1]))
    best = [
        (rollouts.score(np.append(known, rollouts.returns_of(challenger, few))), place, challenger)
        for _, place, challenger, known in looked_at[:BEST]
    ]
    return max(best, key=lambda one: (one[0], -one[1]))[2]
