"""Rivals of a policy that are pruned by imagined returns, and how far the imagining is trusted."""

from collections.abc import Sequence

import numpy as np

from eutree.learners.distilled_dqn.contenders import Contender
from eutree.learners.distilled_dqn.experience import Experience
from eutree.learners.distilled_dqn.students import Students
from eutree.learners.learner import Arrays
from eutree.learners.model_trust import ModelTrust
from eutree.policy_search.rollout_pruning import pruned_by_rollouts
from eutree.world_model import ActionTree
from eutree.world_model.ensemble import Ensemble, EnsembleSettings, fit_ensemble
from eutree.world_model.ensemble_rollouts import EnsembleRollouts

N_STARTS = 50  # first observations of imagined episodes
# Several times the leaves allowed, and whether CART was weighted; the first are made first.
PRUNED = ((3, True), (3, False), (2, False), (3, True), (3, False), (2, True))
PARTS = (1, 2, 4)  # of the leaves allowed: what CART's own trees have that race
FEW_RETURNS = 4  # below which a contender's mean says nothing


class ImaginedRivals:
    """A world model, and the trees that it speaks for.

    Args:
        settings: How the model is fitted.
        students: The teacher's labels, and trees that copy them.
        experience: What the model is fitted to.
        n_actions: Number of actions.
        max_leaves: Most leaves of a rival.

    Attributes:
        ensemble: The model; None before it is first fitted.
    """

    def __init__(
        self,
        settings: EnsembleSettings,
        students: Students,
        experience: Experience,
        n_actions: int,
        max_leaves: int,
    ) -> None:
        self._settings = settings
        self._students = students
        self._experience = experience
        self._n_actions = n_actions
        self._max_leaves = max_leaves
        self.ensemble: Ensemble | None = None

    def make(self, n: int, generator: np.random.Generator) -> list[Contender]:
        """Fit the model to all that is known; return CART's trees and ``n`` pruned ones."""
        data = self._experience.transitions(self._n_actions)
        if self.ensemble is None:
            self.ensemble = fit_ensemble(data, self._settings, generator)
        else:
            self.ensemble = self.ensemble.fitted_on(data, generator)
        observations = self._experience.history.observations
        sizes = sorted({max(self._max_leaves // part, 2) for part in PARTS}, reverse=True)
        rivals = [Contender(self._students.fit(observations, n), "cart") for n in sizes]
        for times, weighted in PRUNED[:n]:
            leaves = times * self._max_leaves
            large = self._students.fit(observations, leaves, weighted=weighted)
            rollouts = EnsembleRollouts(self.ensemble, N_STARTS, generator)
            tree, score = pruned_by_rollouts(large, rollouts, self._max_leaves, generator)
            rivals.append(Contender(tree, "pruned-weighted" if weighted else "pruned", score))
        return rivals

    def imagine(
        self, contenders: Sequence[Contender], policy: ActionTree, generator: np.random.Generator
    ) -> None:
        """Score all contenders in the same imagined episodes, which chose none of them."""
        if self.ensemble is None:
            return
        rollouts = EnsembleRollouts(self.ensemble, N_STARTS, generator)
        rollouts.run(policy)
        for one in contenders:
            one.imagined = rollouts.score(rollouts.returns_of(one.tree))

    def trust(self, contenders: Sequence[Contender]) -> ModelTrust | None:
        """Return how the model orders the trees that were really run; None without a model."""
        if self.ensemble is None:
            return None
        met = [one for one in contenders if len(one.returns) >= FEW_RETURNS]
        return ModelTrust(
            np.array([one.imagined for one in met]),
            np.array([one.mean_return for one in met]),
            np.array([len(one.returns) for one in met], dtype=np.int64),
        )

    def take_back(self, state: Arrays) -> None:
        """Go on from the model's ``state()``."""
        self.ensemble = Ensemble.from_state(state, self._settings, self._n_actions)
