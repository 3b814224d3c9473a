"""Cut a tree to size by its expected return: by imagined returns in a world model of a history.

Labels do not show the worth of a leaf: a leaf that decides a hundredth of all observations may be
the one that brakes. Where transitions are at hand, an ensemble of networks is fitted to them and
cuts are chosen by imagined episodes; the cheapest pruning by labels is a challenger as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eutree.arrays import Floats
from eutree.compression.playing import Move, PairedEpisodes, moved
from eutree.compression.smaller_trees import Costs, Ladder, merged, with_tree
from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.learners import History
from eutree.learners.episode_buffer import transitions_of
from eutree.policies import TreePolicy
from eutree.policy_search.model_trust import rank_correlation
from eutree.world_model import ActionTree, PairedRollouts, Transitions
from eutree.world_model.action_trees import from_decision_tree, to_decision_tree
from eutree.world_model.ensemble import EnsembleSettings, fit_ensemble
from eutree.world_model.ensemble_rollouts import EnsembleRollouts, pruned_by_rollouts
from eutree.world_model.rollouts import Gain
from eutree.world_model.transitions import seen_as

ROWS = 2000  # that thresholds are placed by, and parts fitted to


class ImaginedCommonEpisodes(PairedEpisodes):
    """Imagined episodes; those of a hopeless challenger are given up, so few are not less.

    The steps of the rollouts are none of the environment's.
    """

    def __init__(self, rollouts: PairedRollouts) -> None:
        self._rollouts = rollouts
        self._known: dict[bytes, Gain] = {}  # of trees beside the present one

    @property
    def steps(self) -> int:
        """Steps imagined so far."""
        return self._rollouts.n_steps_taken

    def _draw(self) -> None:
        self._rollouts.redraw()

    def _play(self, tree: TreePolicy) -> None:
        self._known.clear()
        self._rollouts.run(acting(tree))
        self.returns, seen = self._rollouts.returns, self._rollouts.observations
        self.features = seen[:: len(seen) // ROWS + 1]  # spread evenly

    def gains(
        self, challengers: Sequence[TreePolicy], *, few: bool = False, above: float = -np.inf
    ) -> list[Gain]:
        """Return the gains over the present tree that challengers are imagined to make."""
        found = []
        for one in challengers:
            tree = one.tree
            known = tree.feature.tobytes() + tree.threshold.tobytes() + one.actions.tobytes()
            if known not in self._known:
                self._known[known] = self._rollouts.gain(acting(one), hopeless=above)
            found.append(self._known[known])
        return found

    def gains_of_moves(self, moves: Sequence[Move], *, few: bool = False) -> list[Gain]:
        """Return the imagined gains of moved thresholds, each alone."""
        present = acting(self.present)
        if present.feature.size != self.present.tree.n_nodes:  # siblings were joined
            return self.gains([moved(self.present, *one) for one in moves], above=0.0)
        found = []
        for node, at in moves:
            threshold = present.threshold.copy()
            threshold[node] = at
            found.append(self._rollouts.gain(present._replace(threshold=threshold), hopeless=0.0))
        return found


def acting(policy: TreePolicy) -> ActionTree:
    """Return the form of a policy that a world model runs."""
    tree = policy.tree
    inner = tree.feature != tree.NO_FEATURE
    if any(number != node for number, node in enumerate(tree.preorder())):
        return from_decision_tree(tree, policy.actions)
    return ActionTree(
        np.where(inner, tree.feature, -1).astype(np.int64),
        np.where(inner, tree.threshold, 0.0),
        np.where(inner, tree.left, 0).astype(np.int64),
        np.where(inner, tree.right, 0).astype(np.int64),
        np.where(inner, 0, policy.actions[tree.leaf]),
    )


Experience = History | Demonstrations | Transitions

TRIES = 6  # prunings with imagined episodes of their own
N_ASKED = TRIES + 2  # trees that the model is asked about: the input and its pruning by labels too
TIMES = 3  # leaves to prune from, in those allowed; a larger tree is cut by labels first
N_STARTS = 50  # first observations of imagined episodes
SELECTION_STARTS = 2 * N_STARTS  # of those that choose among prunings, and chose no cut


@dataclass(frozen=True)
class Pruned:
    """A tree cut to size."""

    policy: TreePolicy
    method: str  # ``"imagined"``, or ``"budget"`` where cutting by labels was better
    before: float  # score of the input in imagined episodes that chose nothing
    after: float  # the same of the result
    asked: tuple[TreePolicy, ...]  # the trees that the model was asked about, the input first
    scores: Floats  # [n]; its imagined score of each

    def check_order(self, returns: Floats) -> None:
        """Raise InvalidArgumentError unless the model orders the trees better than chance.

        ``returns`` are their mean returns in episodes of the environment, shape [n].
        """
        found = rank_correlation(self.scores, returns)
        if np.isnan(found.value):
            raise InvalidArgumentError(
                f"imagined (--imagined) must be None: {found.n} trees have one score in the world "
                "model, or earned the same, which orders them no better than chance; let the trees "
                "play instead"
            )
        if not found.better_than_chance:
            raise InvalidArgumentError(
                f"imagined (--imagined) must be None: the world model's order of {found.n} trees "
                f"has rank correlation {found.value:.2f} [{found.low:.2f}, {found.high:.2f}] with "
                "the returns that they earned, no better than chance; let the trees play instead"
            )


@dataclass(frozen=True)
class ImaginedEpisodes:
    """Episodes imagined by a world model.

    Attributes:
        experience: The data it is fitted to: a run's ``history``, demonstrations, or transitions.
        world_model: The settings of the world model.
    """

    experience: Experience
    world_model: EnsembleSettings = field(default_factory=EnsembleSettings)

    def transitions(self, policy: TreePolicy) -> Transitions:
        """Return the experience in the features of a policy.

        Raises:
            InvalidArgumentError: It has other features, or holds nothing.
        """
        if isinstance(self.experience, Transitions):
            known = self.experience
        elif isinstance(self.experience, History):
            known = transitions_of(self.experience, policy.schema.n_actions)
        else:
            shown = self.experience.with_history(policy.history, policy.past_actions)
            known = Transitions.of(shown.kept, policy.schema.n_actions)
        known = seen_as(policy.derivation, known)
        if known.observations.shape[1] != policy.tree.n_features or not known.rewards.size:
            raise InvalidArgumentError(
                f"experience must hold transitions of {policy.tree.n_features} features, "
                f"got shape {known.observations.shape}"
            )
        return known

    def pruned(
        self,
        known: Transitions,
        policy: TreePolicy,
        costs: Costs,
        max_leaves: int,
        *,
        generator: np.random.Generator,
    ) -> Pruned:
        """Return the tree cut to at most so many leaves, by the best of several prunings.

        Args:
            known: Transitions to fit a world model to.
            policy: The tree, without locks.
            costs: The costs of other decisions at the recorded observations, by labels.
            max_leaves: Most leaves of the result.
            generator: Source of all chance.
        """
        ladder = Ladder(policy, costs)
        whole = merged(policy)
        fits = whole.n_leaves <= TIMES * max_leaves
        large = whole if fits else ladder.of_size(TIMES * max_leaves)
        ensemble = fit_ensemble(known, self.world_model, generator)
        challengers = [("budget", ladder.of_size(max_leaves))]
        for _ in range(TRIES):
            rollouts = EnsembleRollouts(ensemble, N_STARTS, generator)
            tree, _ = pruned_by_rollouts(acting(large), rollouts, max_leaves, generator)
            found = to_decision_tree(tree, policy.tree.n_features)
            challengers.append(("imagined", with_tree(policy, *found)))
        fresh = EnsembleRollouts(ensemble, SELECTION_STARTS, generator)
        fresh.run(acting(whole))
        returns = fresh.returns_of_each([acting(tree) for _, tree in challengers])
        scores = [fresh.score(row) for row in returns]
        best = int(np.argmax(scores))
        method, chosen = challengers[best]
        before = fresh.score(fresh.returns)
        asked, told = (whole, *(tree for _, tree in challengers)), np.array([before, *scores])
        return Pruned(merged(chosen), method, before, scores[best], asked, told)
