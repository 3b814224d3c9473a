"""Rollouts in every member of an ensemble, and challengers with the same random numbers."""

from collections.abc import Callable, Sequence

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.world_model import _kernels_ensemble_lanes as kernels
from eutree.world_model._kernels import ActionTree, Episodes
from eutree.world_model._kernels_ensemble_lanes import Draws, EnsembleConditions
from eutree.world_model._kernels_lanes import arrange
from eutree.world_model.action_trees import forest_of, n_leaves, with_child
from eutree.world_model.ensemble import Ensemble
from eutree.world_model.rollouts import DRAWS, Rollouts, empty_episodes

NOWHERE = empty_episodes(0, 0, 0)  # a trace that takes nothing
PESSIMISM = 0.5  # standard deviations of the members that are taken off a score


class EnsembleRollouts(Rollouts):
    """Paired rollouts of policy trees in an ensemble.

    Episode e starts at the observation e // M of ``n_starts`` stored first ones, in member e % M of
    the ensemble: every member meets every start.

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

    def returns_of_each(
        self, challengers: Sequence[ActionTree], first: int = 0, last: int | None = None
    ) -> Floats:
        """Return the returns of some challengers, at least one, shape [C, last - first]."""
        forest, roots = forest_of(challengers)
        departs = np.empty((roots.size, self.n_episodes), dtype=np.int64)
        for row, challenger in zip(departs, challengers, strict=True):
            self._compare(challenger)
            row[:] = self._departs
        departs = departs[:, first:last]
        out = np.tile(self._episodes.returns[first:last], (roots.size, 1))
        own = departs >= 0
        _, out[own] = self._go_on(forest, roots.repeat(own.sum(axis=1)), departs[own], NOWHERE)
        return self._cut(out)

    def score(self, returns: Floats) -> float:
        """Return the mean over members less ``PESSIMISM`` deviations, of returns [n M]."""
        of_members = returns.reshape(-1, self.n_members).mean(axis=0)
        return float(of_members.mean() - PESSIMISM * of_members.std())

    def score_of(self, challenger: ActionTree) -> float:
        """Return the score of a challenger in the policy's episodes."""
        return self.score(self.returns_of_each([challenger])[0])

    def _cut(self, returns: Floats) -> Floats:
        """Return returns no lower and no higher than nearly all real ones were."""
        return np.clip(returns, *self._range)

    def _draw(self) -> None:
        generator = self.generator
        draws = Draws(generator.random(DRAWS), generator.standard_normal(DRAWS))
        self._conditions = EnsembleConditions(self._world, draws, self._horizon)
        chosen = generator.integers(len(self._starts), size=self._n_starts)
        self._begin_at(np.repeat(self._starts[chosen], self.n_members, axis=0))

    def _record(self, policy: ActionTree) -> None:
        begins = self._departs[self._departs >= 0]
        n_own, totals = self._go_on(policy, np.zeros_like(begins), begins, self._trace)
        steps = self._within, policy, self._trace, n_own, totals
        arrange(self._episodes, self._departs, *steps, self._spare)

    def _go_on(
        self, forest: ActionTree, roots: Integers, begins: Integers, trace: Episodes
    ) -> tuple[int, Floats]:
        """Run a tree from each recorded step on; return the steps written, and the returns."""
        tasks = kernels.Tasks(forest, roots, begins, np.empty(begins.size))
        return kernels.go_on(self._conditions, self._episodes, tasks, trace), tasks.totals


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
    few = SHORT_LOOK * rollouts.n_episodes // 150
    few = max(few - few % rollouts.n_members, rollouts.n_members)
    cuts = []
    for place in places.tolist():
        cuts.append(with_child(policy, int(inner[place // 2]), goes_left=place % 2 == 0)[0])
    known = rollouts.returns_of_each(cuts, last=few)
    scores = [rollouts.score(row) for row in known]
    best = sorted(range(len(cuts)), key=lambda one: (-scores[one], places[one]))[:BEST]
    more = rollouts.returns_of_each([cuts[one] for one in best], few)
    whole = zip(map(rollouts.score, np.concatenate([known[best], more], axis=1)), best, strict=True)
    return cuts[max(whole, key=lambda one: (one[0], -places[one[1]]))[1]]


# What is left is changed at random, some changes at once, of which the best is made if it pays.

CHANGES, AT_ONCE = 50, 8


def climbed_by_rollouts(
    tree: ActionTree,
    rollouts: EnsembleRollouts,
    variant: Callable[[ActionTree, Floats], ActionTree | None],
) -> ActionTree:
    """Return the tree after changes that pay in the rollouts, which end with it run.

    ``variant`` changes a tree whose episodes visit observations [K, d]; None if what it makes is
    too large or too small.
    """
    rollouts.run(tree)
    best = rollouts.score(rollouts.returns)
    for _ in range(CHANGES):
        made = (variant(rollouts.policy, rollouts.observations) for _ in range(AT_ONCE))
        if changed := [one for one in made if one is not None]:
            scores = [rollouts.score(row) for row in rollouts.returns_of_each(changed)]
            if max(scores) > best:
                best = max(scores)
                rollouts.run(changed[scores.index(best)])
    return rollouts.policy
