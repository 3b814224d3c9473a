"""What challenges a policy in a race: plans, prunings, random changes.

Several world models, none of which need be right, each propose improved or smaller trees; C4.5
proposes prunings; and of several random changes the one is proposed that recorded steps speak for.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compression.candidates import Costs, Ladder, with_locks
from eutree.contests.rules import Lead
from eutree.data import Episode
from eutree.policies import TreePolicy
from eutree.policy_search.improvement import Improvement
from eutree.policy_search.planner import FEWEST_ROLLOUTS
from eutree.training.variants import Advantages, Variation
from eutree.validation import check_integer, check_number
from eutree.world_model import ActionTree, PairedRollouts, Transitions, WorldModel, fit_world_models
from eutree.world_model.action_trees import from_decision_tree, to_decision_tree
from eutree.world_model.dynamics import MAX_LEAVES

MOST_LEAVES = 40
ROWS_PER_LEAF = 100  # of a detailed model
DEARER = (1.0, 6.0)  # prices of a leaf at which each model proposes
MOST_RUNGS = 12  # prunings that race
MOST_KNOWN = 50_000  # transitions that models are fitted to
RECENT = 300  # episodes whose advantages are known
VARIANTS = 10  # of which one is tried
PROMISING = 4  # challengers that race, where models can be trusted
# Standard errors, and share of a typical return, by which a model may miss the incumbent's returns;
# the next episode may have the worst return seen, too.
SURE, NEAR = 2.0, 0.1


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """How long to search, and for what.

    Attributes:
        steps: Most environment steps to run. An episode begins only if the longest possible one
            still fits: the environment's own limit, or else the longest seen so far.
        leaf_price: Return that a leaf must earn, as a share of a typical return's size.
        max_leaves: Most leaves of the result; a policy that has more is replaced by the winner of
            a race of smaller ones, whatever it earns. None allows as many as there are, or
            ``MOST_LEAVES``.
        model_steps: Steps in a world model that judge each change, about; at least 100 episodes.
        keep_success: Whether a challenger must also succeed as often, in the same episodes.
    """

    steps: int
    leaf_price: float = 0.001
    max_leaves: int | None = None
    model_steps: int = 100_000
    keep_success: bool = False

    def __post_init__(self) -> None:
        check_integer("race_steps", self.steps, low=0)
        check_number("leaf_price", self.leaf_price, low=0.0)
        if self.max_leaves is not None:
            check_integer("max_leaves", self.max_leaves, low=2)
        check_integer("model_steps", self.model_steps, low=1)


@dataclass(frozen=True)
class _Proposing:
    """How to fit one of the world models that propose."""

    gap: float = 0.5
    memory: bool = True
    noise: bool = True
    detailed: bool = False


_MODELS = (
    _Proposing(gap=0.9),
    _Proposing(noise=False, detailed=True),
    _Proposing(memory=False, detailed=True),
    _Proposing(memory=False, noise=False, detailed=True),
)


class Proposals:
    """Makes challengers.

    Args:
        start: The policy that the search starts from; its locked leaves are in every challenger.
        data: What was stored in learning.
        settings: The price of a leaf, and how long to plan.
        generator: Source of all chance.

    Attributes:
        max_leaves: Most leaves of a challenger.
        leaf_price: Return that a leaf must earn.
    """

    def __init__(
        self,
        start: TreePolicy,
        data: Transitions,
        settings: SearchSettings,
        generator: np.random.Generator,
    ) -> None:
        self.max_leaves = settings.max_leaves or max(start.n_leaves, MOST_LEAVES)
        self._scale = data.typical_return
        self.leaf_price = settings.leaf_price * self._scale
        self._improvement = Improvement(price=settings.leaf_price, max_leaves=self.max_leaves)
        self._settings = settings
        self._start = start
        self._data = data
        self._generator = generator

    def promising(
        self, policy: TreePolicy, own: Sequence[Episode], known: Advantages
    ) -> TreePolicy | None:
        """Return the one of several variants that recorded steps speak for most.

        Args:
            policy: What is varied.
            own: Some of its episodes.
            known: What recorded steps gained.
        """
        visited = np.concatenate([episode.observations[:-1] for episode in own])
        variation = Variation(policy.schema.n_actions, self.max_leaves, self._generator)
        tree = from_decision_tree(policy.tree, policy.actions)
        decided = _decisions(policy, known)
        best, most = None, -math.inf
        for _ in range(VARIANTS):
            variant = variation.of(tree, visited)
            if variant is None:
                continue
            rival = self._policy_of(variant)
            if key(rival) == key(policy) or rival.n_leaves > self.max_leaves:
                continue
            score = known.speak_for(decided, _decisions(rival, known))
            if score > most:
                best, most = rival, score
        return best

    def advantages(self, episodes: Sequence[Episode], generator: np.random.Generator) -> Advantages:
        """Return what the steps of the last of some episodes gained."""
        data = self._data.followed_by(episodes[-RECENT:])
        numbers = np.unique(data.episodes)
        return Advantages.of(data.since(int(numbers[-RECENT:][0])), generator)

    def pruned(self, policy: TreePolicy) -> list[TreePolicy]:
        """Return prunings of the policy by C4.5, of all sizes."""
        ladder = Ladder(policy, Costs.of(policy, self._data.observations, "visits")).rungs()
        kept = [with_locks(rung, self._start) for rung in ladder]
        rungs = [rung for rung in kept if 2 <= rung.n_leaves <= self.max_leaves]
        if not rungs:
            return []
        chosen = np.unique(np.linspace(0, len(rungs) - 1, MOST_RUNGS).round().astype(int))
        return [rungs[number] for number in chosen]

    def planned(self, policy: TreePolicy, episodes: Sequence[Episode]) -> Iterator[TreePolicy]:
        """Yield what each world model makes of the policy, at several prices of a leaf."""
        start = from_decision_tree(policy.tree, policy.actions)
        for model in self._models(episodes):
            rollouts = self._rollouts(model)
            if policy.n_leaves > self.max_leaves:
                for tree in self._improvement.shrunk(rollouts, start, self._scale):
                    yield self._policy_of(tree)
                continue
            tree = start
            for factor in DEARER:
                dearer = replace(self._improvement, price=self._improvement.price * factor)
                tree = dearer.improve(rollouts, tree, self._scale)
                yield self._policy_of(tree)

    def guessed(
        self,
        policy: TreePolicy,
        own: Sequence[Episode],
        rivals: Sequence[TreePolicy],
        episodes: Sequence[Episode],
    ) -> tuple[tuple[TreePolicy, ...], tuple[float, ...]]:
        """Return the challengers that promise most, and what each is guessed to earn.

        It is what the tree earns in the first of the models that foretells the incumbent's returns.
        Where none does all are returned, without a guess.

        Args:
            policy: The incumbent.
            own: Real episodes of it.
            rivals: The challengers.
            episodes: All episodes run so far.
        """
        lead = Lead.of(np.array([episode.undiscounted_return for episode in own]))
        low, high = self.range_seen(episodes)
        reach = SURE * lead.error + NEAR * self._scale + (high - low) / len(own)
        for model in self._models(episodes):
            expected, *guesses = self._returns(model, [policy, *rivals]).tolist()
            if abs(expected - lead.mean) <= reach:
                break
        else:
            return tuple(rivals), ()
        worth = np.array(guesses) - self.leaf_price * np.array([one.n_leaves for one in rivals])
        best = np.argsort(-worth, kind="stable")[:PROMISING].tolist()
        return tuple(rivals[k] for k in best), tuple(guesses[k] for k in best)

    def range_seen(self, episodes: Sequence[Episode]) -> tuple[float, float]:
        """Return the lowest and highest return of all that was stored, and of some episodes."""
        raced = np.array([episode.undiscounted_return for episode in episodes])
        seen = np.concatenate([self._data.episode_returns, raced])
        return float(seen.min()), float(seen.max())

    def _returns(self, model: WorldModel, trees: Sequence[TreePolicy]) -> Floats:
        """Return what trees earn in common episodes of a world model, shape [trees]."""
        first, *others = (from_decision_tree(tree.tree, tree.actions) for tree in trees)
        rollouts = self._rollouts(model)
        rollouts.redraw()
        rollouts.run(first)
        gains = [0.0, *(rollouts.gain(tree).mean for tree in others)]
        return rollouts.mean_return + np.array(gains)

    def _models(self, episodes: Sequence[Episode]) -> Iterator[WorldModel]:
        """Yield the world models that propose."""
        recent = self._data.followed_by(episodes).recent(MOST_KNOWN)
        detail = max(MAX_LEAVES, recent.rewards.size // ROWS_PER_LEAF)
        for kind in _MODELS:
            known = replace(recent, memory=kind.memory)
            size = detail if kind.detailed else MAX_LEAVES
            (model,) = fit_world_models(known, [kind.gap], max_leaves=size)
            yield model if kind.noise else model.without_noise()

    def _rollouts(self, model: WorldModel) -> PairedRollouts:
        n_episodes = max(int(self._settings.model_steps / self._data.mean_length), FEWEST_ROLLOUTS)
        return PairedRollouts(model, n_episodes, 1.0, self._generator)

    def prefer(self, policy: TreePolicy, rival: TreePolicy, episodes: Sequence[Episode]) -> bool:
        """Return whether the challenger earns more in every world model, by a standard error."""
        return all(self._prefers(model, policy, rival) for model in self._models(episodes))

    def _prefers(self, model: WorldModel, policy: TreePolicy, rival: TreePolicy) -> bool:
        """Return whether the challenger earns more in a world model, by a standard error."""
        rollouts = self._rollouts(model)
        rollouts.run(from_decision_tree(policy.tree, policy.actions))
        gain = rollouts.gain(from_decision_tree(rival.tree, rival.actions))
        return gain.mean > gain.error

    def _policy_of(self, tree: ActionTree) -> TreePolicy:
        """Return a tree as a policy, with the locked leaves of the start in it."""
        state_tree, actions = to_decision_tree(tree, self._start.tree.n_features)
        free = replace(self._start, tree=state_tree, actions=actions, leaves=None, locked=())
        return with_locks(free, self._start)


def key(tree: TreePolicy) -> bytes:
    """Return what trees that decide alike by the same tests have in common."""
    return tree.tree.feature.tobytes() + tree.tree.threshold.tobytes() + tree.actions.tobytes()


def _decisions(policy: TreePolicy, known: Advantages) -> Integers:
    """Return what a policy does at each recorded step, shape [N]."""
    return policy.actions[policy.tree.leaf_index(known.observations)]
