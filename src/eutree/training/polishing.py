"""Polish a learned tree: many rivals, none to be trusted, and real episodes that decide.

Planning inside a learning run trusts one world model. Where that model is poor, what it prefers
is not what earns more. Here several models, none of which need be right, each propose improved or
smaller trees, C4.5 proposes prunings, and what is best so far is varied at random. All of them have
to prove themselves in real episodes, on the same luck as the policy; one replaces it only if it
earns more by a standard error, or is smaller and does as well. All steps are counted, and an
episode begins only if the budget allows for the longest.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Integers
from eutree.compression.candidates import Ladder, merged
from eutree.compression.costs import Costs
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.history import History
from eutree.learners.model_planning import transitions_of
from eutree.policies import TreePolicy
from eutree.policy_search.improvement import Improvement
from eutree.policy_search.planner import FEWEST_ROLLOUTS
from eutree.training.trials import FIRST_BLOCK, Trials, key
from eutree.training.variants import Advantages, Variation
from eutree.validation import check_integer, check_number, check_seed
from eutree.world_model import ActionTree, Transitions, fit_world_models
from eutree.world_model.action_trees import from_decision_tree, to_decision_tree
from eutree.world_model.dynamics import MAX_LEAVES, WorldModel
from eutree.world_model.rollouts import PairedRollouts

PROPOSING_STREAM = 32
MOST_LEAVES = 40
ROWS_PER_LEAF = 100  # of a detailed model
ROUNDS = 3  # of imagination, at most
ROUND_SHARE = 0.25  # of the steps, for a round
DEARER = (1.0, 6.0)  # prices of a leaf at which each imagination proposes
MOST_RUNGS = 12  # prunings that race
MOST_KNOWN = 50_000  # transitions that models are fitted to
RECENT = 300  # episodes whose advantages are known
NEWS = 0.05  # share of steps after which they are fitted anew
VARIANTS = 10  # of which one is tried
IDLE = 100  # of those tried, without a step: nothing is left to vary


@dataclass(frozen=True)
class PolishReport:
    """What polishing did.

    Attributes:
        n_leaves_before: Leaves of the input.
        n_leaves_after: Leaves of the result.
        rivals: Trees that were tried.
        won: How often one of them replaced the policy.
        environment_steps: Steps of all episodes run.
    """

    n_leaves_before: int
    n_leaves_after: int
    rivals: int
    won: int
    environment_steps: int


@dataclass(frozen=True)
class _Way:
    """One way of imagining."""

    gap: float = 0.5
    memory: bool = True
    noise: bool = True
    detailed: bool = False


_WAYS = (
    _Way(gap=0.9),
    _Way(noise=False, detailed=True),
    _Way(memory=False, detailed=True),
    _Way(memory=False, noise=False, detailed=True),
)


def polish(
    policy: TreePolicy,
    history: History,
    env: gymnasium.Env[Any, Any],
    *,
    steps: int,
    price: float = 0.001,
    max_leaves: int | None = None,
    n_steps: int = 100_000,
    seed: int = 0,
) -> tuple[TreePolicy, PolishReport]:
    """Return a tree that earns more in real episodes, or does as well with fewer leaves.

    Args:
        policy: The policy to polish.
        history: All transitions stored in learning it (``LearningResult.history``).
        env: Where episodes are run.
        steps: Most environment steps to run. An episode begins only if the longest possible one
            still fits: the environment's own limit, or else the longest seen so far.
        price: Return that a leaf must earn, as a share of a typical return's size.
        max_leaves: Most leaves of the result; a policy that has more is replaced by the winner of
            a race of smaller ones, whatever it earns. None allows as many as there are, or
            ``MOST_LEAVES``.
        n_steps: Imagined steps that judge each change, about; at least 100 episodes.
        seed: The same seed gives the same tree.

    Raises:
        InvalidArgumentError: An argument is not as described, or leaves are locked.
    """
    check_integer("steps", steps, low=1)
    limit = max(policy.n_leaves, MOST_LEAVES)
    if max_leaves is not None:
        limit = check_integer("max_leaves", max_leaves, low=2)
    check_integer("n_steps", n_steps, low=1)
    check_number("price", price, low=0.0)
    check_seed(seed)
    if policy.locked:
        raise InvalidArgumentError(f"policy must have no locked leaves, got {policy.locked}")
    data = transitions_of(history, policy.schema.n_actions)
    if not data.rewards.size:
        raise InvalidArgumentError("history must hold transitions, got none")
    worth = price * data.typical_return
    trials = Trials(env, policy.history, seed=seed, worth=worth, longest=data.longest())
    generator = np.random.default_rng(np.random.SeedSequence((seed, PROPOSING_STREAM)))
    polishing = _Polishing(
        trials, data, Improvement(price=price, max_leaves=limit), n_steps, steps, generator
    )
    best = polishing.cut(merged(policy))
    best = polishing.imagine(best)
    best = polishing.vary(best)
    report = PolishReport(
        policy.n_leaves, best.n_leaves, polishing.tried, polishing.won, trials.steps
    )
    return best, report


class _Polishing:
    """One polishing.

    Attributes:
        tried: Rivals so far.
        won: How often one replaced the policy.
    """

    def __init__(
        self,
        trials: Trials,
        data: Transitions,
        improvement: Improvement,
        n_steps: int,
        steps: int,
        generator: np.random.Generator,
    ) -> None:
        self.tried = self.won = 0
        self._trials = trials
        self._data = data
        self._scale = data.typical_return
        self._improvement = improvement
        self._n_steps = n_steps
        self._steps = steps
        self._generator = generator

    def cut(self, policy: TreePolicy) -> TreePolicy:
        """Return the policy, or if it is too large the winner of a race of smaller ones."""
        limit = self._improvement.max_leaves
        if policy.n_leaves <= limit:
            return policy
        rivals = [rung for rung in self._pruned(policy) if rung.n_leaves <= limit]
        if policy.n_leaves <= MOST_LEAVES:
            rivals = [*self._imagined(policy), *rivals]
        return self._winner(policy, rivals, 2 * ROUND_SHARE) or policy

    def imagine(self, policy: TreePolicy) -> TreePolicy:
        """Return what models make of the policy, as long as that wins."""
        for number in range(ROUNDS):
            rivals = list(self._imagined(policy))
            if number == 0:
                rivals += self._pruned(policy)
            rival = self._winner(policy, rivals, ROUND_SHARE)
            self._trials.new_heat()
            self._trials.limit = self._steps
            if rival is None:
                break
            better = self._trials.better(policy, rival)
            if better is None:
                better = all(self._prefers(model, policy, rival) for model in self._models())
            if not better:
                break
            policy, self.won = rival, self.won + 1
        return policy

    def vary(self, policy: TreePolicy) -> TreePolicy:
        """Return the policy after all random changes that were for the better."""
        trials = self._trials
        trials.limit = self._steps
        most = self._improvement.max_leaves
        variation = Variation(policy.schema.n_actions, most, self._generator)
        known, fitted_at = self._advantages(), trials.steps
        trials.new_heat()
        idle = 0
        while idle < IDLE and (own := trials.episodes_of(policy, FIRST_BLOCK)) is not None:
            if trials.steps > fitted_at + NEWS * self._steps:
                known, fitted_at = self._advantages(), trials.steps
            steps, idle = trials.steps, idle + 1
            rival = self._promising(policy, variation, known, own)
            if rival is None:
                continue
            self.tried += 1
            if trials.better(policy, rival, of_many=True):
                policy, self.won = rival, self.won + 1
                trials.new_heat()
            if trials.steps > steps:
                idle = 0
        return policy

    def _promising(
        self, policy: TreePolicy, variation: Variation, known: Advantages, own: list[Episode]
    ) -> TreePolicy | None:
        """Return the one of several variants that recorded steps speak for most."""
        visited = np.concatenate([episode.observations[:-1] for episode in own])
        tree = from_decision_tree(policy.tree, policy.actions)
        decided = _decisions(policy, known)
        best, most = None, -np.inf
        for _ in range(VARIANTS):
            variant = variation.of(tree, visited)
            if variant is None:
                continue
            rival = _policy_of(policy, variant)
            if key(rival) == key(policy):
                continue
            score = known.speak_for(decided, _decisions(rival, known))
            if score > most:
                best, most = rival, score
        return best

    def _advantages(self) -> Advantages:
        """Return what the steps of the last episodes gained."""
        data = self._data.followed_by(self._trials.episodes[-RECENT:])
        numbers = np.unique(data.episodes)
        return Advantages.of(data.since(int(numbers[-RECENT:][0])), self._generator)

    def _winner(
        self, policy: TreePolicy, rivals: list[TreePolicy], share: float
    ) -> TreePolicy | None:
        """Return the winner of a race of the policy's rivals for a share of the steps."""
        trials = self._trials
        distinct = {key(rival): rival for rival in rivals}
        distinct.pop(key(policy), None)
        rivals = list(distinct.values())
        if not rivals:
            return None
        self.tried += len(rivals)
        trials.new_heat()
        trials.limit = min(self._steps, trials.steps + int(share * self._steps))
        return trials.race(rivals)

    def _pruned(self, policy: TreePolicy) -> list[TreePolicy]:
        """Return prunings of the policy by C4.5, of all sizes."""
        limit = self._improvement.max_leaves
        ladder = Ladder(policy, Costs.of(policy, self._data.observations, "visits")).rungs()
        rungs = [rung for rung in ladder if 2 <= rung.n_leaves <= limit]
        if not rungs:
            return []
        chosen = np.unique(np.linspace(0, len(rungs) - 1, MOST_RUNGS).round().astype(int))
        return [rungs[number] for number in chosen]

    def _imagined(self, policy: TreePolicy) -> Iterator[TreePolicy]:
        """Yield what each way of imagining makes of the policy, at several prices of a leaf."""
        start = from_decision_tree(policy.tree, policy.actions)
        for model in self._models():
            rollouts = self._rehearsal(model)
            if policy.n_leaves > self._improvement.max_leaves:
                yield _policy_of(policy, self._improvement.shrink(rollouts, start, self._scale))
                continue
            tree = start
            for factor in DEARER:
                dearer = replace(self._improvement, price=self._improvement.price * factor)
                tree = dearer.improve(rollouts, tree, self._scale)
                yield _policy_of(policy, tree)

    def _models(self) -> Iterator[WorldModel]:
        """Yield the world model of each way of imagining."""
        recent = self._data.followed_by(self._trials.episodes).recent(MOST_KNOWN)
        detail = max(MAX_LEAVES, recent.rewards.size // ROWS_PER_LEAF)
        for way in _WAYS:
            known = replace(recent, memory=way.memory)
            size = detail if way.detailed else MAX_LEAVES
            (model,) = fit_world_models(known, [way.gap], max_leaves=size)
            yield model if way.noise else model.without_noise()

    def _rehearsal(self, model: WorldModel) -> PairedRollouts:
        n_episodes = max(int(self._n_steps / self._data.mean_length), FEWEST_ROLLOUTS)
        return PairedRollouts(model, n_episodes, 1.0, self._generator)

    def _prefers(self, model: WorldModel, policy: TreePolicy, rival: TreePolicy) -> bool:
        """Return whether the rival earns more in a world model, by a standard error."""
        rollouts = self._rehearsal(model)
        rollouts.run(from_decision_tree(policy.tree, policy.actions))
        gain = rollouts.gain(from_decision_tree(rival.tree, rival.actions))
        return gain.mean > gain.error


def _decisions(policy: TreePolicy, known: Advantages) -> Integers:
    """Return what a policy does at each recorded step, shape [N]."""
    return policy.actions[policy.tree.leaf_index(known.observations)]


def _policy_of(policy: TreePolicy, tree: ActionTree) -> TreePolicy:
    state_tree, actions = to_decision_tree(tree, policy.tree.n_features)
    return replace(policy, tree=state_tree, actions=actions, leaves=None, locked=())
