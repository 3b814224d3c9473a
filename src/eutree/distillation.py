"""Distil a teacher into a small tree.

*Cloning* fits a tree to the teacher's decisions. Where the tree errs it comes to observations that
the teacher never showed. *DAgger* (Ross, Gordon, Bagnell 2011) lets the tree act, asks the teacher
for its own action there, adds that to the data and fits again, round after round. *VIPER*
(Bastani, Pu, Solar-Lezama 2018) moreover weights each observation by the cost of a wrong action
there. The best tree of all rounds is chosen on validation episodes, the same for all and used for
nothing else.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import grow
from eutree.compression.smaller_trees import Costs, Prunings, merged
from eutree.contests import best
from eutree.data import Demonstrations, Episode
from eutree.data.demonstrations import check_shown, lesson_masks, lessons, taught_in, weights_in
from eutree.data.episode import CUT, stacked_masks
from eutree.errors import needed
from eutree.evaluation import Evaluation, Interval, evaluate
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.acting import Actor, Controller, as_policy, trained_steps, values_of
from eutree.interaction.decoding import warn_of_codes
from eutree.interaction.deriving import acting_as, acting_for
from eutree.interaction.episode import RunPairs, Stream
from eutree.interaction.making import Environment, Recipe, made
from eutree.parallel import Workers
from eutree.policies import Policy, TreePolicy
from eutree.policies.sklearn_tree import exact_tree
from eutree.recording import record
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from eutree.validation import (
    check_amounts,
    check_choice,
    check_integer,
    check_kind,
    check_seed,
)

__all__ = ["DistillationReport", "DistillationSettings", "Round"]


# CART (Breiman et al. 1984) is scikit-learn's: it grows best first up to the limit. C4.5 has no
# limit: its tree is cut back to the best pruning of that size, by the weight of wrong decisions.


METHODS = ("dagger", "viper", "cloning")


@dataclass(frozen=True, kw_only=True)
class DistillationSettings:
    """How a teacher is distilled.

    Attributes:
        method: ``"cloning"`` fits one tree to the teacher's own episodes; ``"dagger"`` and
            ``"viper"`` go on to fit trees to the observations that the trees themselves come to.
        learner: ``"c4.5"``, or ``"cart"`` (extra ``sklearn``).
        max_leaves: Most leaves of the tree; None for the learner's own size.
        iterations: Trees that are fitted, the first to the teacher's episodes alone.
        episodes: Episodes gathered before each tree.
        validation_episodes: Episodes of the validation of each tree.

    Raises:
        InvalidArgumentError: One of them is not as described.
    """

    method: str = "dagger"
    learner: str = "c4.5"
    max_leaves: int | None = 32
    iterations: int = 10
    episodes: int = 10
    validation_episodes: int = 50

    def __post_init__(self) -> None:
        check_choice("method", self.method, METHODS)
        check_choice("learner", self.learner, LEARNERS)
        check_amounts(self, iterations=1, episodes=1, validation_episodes=2)
        if self.max_leaves is not None:
            check_integer("max_leaves", self.max_leaves, low=1)

    @property
    def rounds(self) -> int:
        """Trees that are fitted."""
        return 1 if self.method == "cloning" else self.iterations


# Bastani et al. (2018): a wrong decision costs V(o) - Q(o, a) under the teacher's values, at most
# V(o) - min_a Q(o, a). Observations at which every action is as good as another do not matter.
# Nothing is at stake with an action that is not allowed there.


ActionValues = Callable[[Floats], ArrayLike]  # observations [N, d] -> Q [N, A]
Stakes = Callable[..., Floats]  # observations [N, d], and what is allowed there, [N, A] -> [N]


def stakes_of(teacher: Any, action_values: ActionValues | None, n_actions: int) -> Stakes | None:
    """Return the stakes by the teacher's values; None if it has none.

    Looked for, in this order: ``action_values``, a method ``action_values`` of the teacher, the
    values of the leaves of a ``TreePolicy``.
    """
    values = values_of(teacher, n_actions, action_values)
    if values is None:
        of_rows = isinstance(teacher, TreePolicy) and teacher.features.is_identity
        tree = teacher if of_rows else None
        if tree is None or tree.leaves is None or not tree.leaves.compares_actions:
            return None
        return lambda rows, allowed=None: _at_stake(
            -Costs.of(tree, rows, "q-gap").of_action, allowed
        )
    return lambda rows, allowed=None: _at_stake(values(rows, allowed), allowed)


def _at_stake(values: Floats, allowed: Booleans | None) -> Floats:
    """Return the highest less the lowest value, [N], of actions that are allowed, both [N, A]."""
    where = True if allowed is None else allowed
    highest: Floats = values.max(axis=1, where=where, initial=-np.inf)
    lowest: Floats = values.min(axis=1, where=where, initial=np.inf)
    return highest - lowest


def weights(stakes: Floats) -> Floats:
    """Return the stakes as weights of mean 1; all 1 if nothing is at stake anywhere."""
    total = float(stakes.sum())
    return stakes * (stakes.size / total) if total > 0.0 else np.ones_like(stakes)


LEARNERS = ("c4.5", "cart")


@dataclass(frozen=True, eq=False)
class Labelled:
    """Observations with the teacher's action on each."""

    observations: Floats  # [N, d] the values sensed
    actions: Integers  # [N] the teacher's action on each
    weights: Floats  # [N] how much a wrong decision counts


def fit(
    learner: str,
    data: Labelled,
    schema: Schema,
    environment: EnvironmentSpec | None,
    max_leaves: int | None,
) -> TreePolicy:
    """Return the tree that a learner makes of labelled observations; equal siblings are joined."""
    if learner == "c4.5":
        grown = grow(data.observations, data.actions, n_classes=schema.n_actions,
                     weights=data.weights)  # fmt: skip
        tree, actions = grown.to_decision_tree()
    else:
        tree, actions = _cart(data, max_leaves)
    policy = merged(TreePolicy(tree, actions, schema, environment))
    if max_leaves is None or policy.n_leaves <= max_leaves:
        return policy
    of_action = np.repeat(data.weights[:, np.newaxis], schema.n_actions, axis=1)  # [N, A]
    of_action[np.arange(data.actions.size), data.actions] = 0.0
    costs = Costs(data.observations, of_action, float(data.weights.sum()))
    return merged(Prunings(policy, costs).of_size(max_leaves))


def _cart(data: Labelled, max_leaves: int | None) -> tuple[DecisionTree, Integers]:
    """Return CART's tree, which decides as scikit-learn's does on every finite observation."""
    with needed("scikit-learn", "sklearn"):
        from sklearn.tree import DecisionTreeClassifier
    limit = max_leaves if max_leaves != 1 else 2  # it knows no tree of one leaf
    model = DecisionTreeClassifier(max_leaf_nodes=limit, random_state=0)
    model.fit(data.observations, data.actions, sample_weight=data.weights)
    tree, leaves = exact_tree(model)
    return tree, model.classes_[model.tree_.value[leaves, 0, :].argmax(axis=1)].astype(np.int64)


@dataclass(frozen=True)
class Round:
    """One tree of a distillation.

    Attributes:
        n_transitions: Labelled observations that the tree was fitted to.
        n_leaves: Leaves of the tree.
        agreement: Share of them on which the tree decides as the teacher does.
        mean_return: Mean return of the validation episodes.
    """

    n_transitions: int
    n_leaves: int
    agreement: float
    mean_return: float


@dataclass(frozen=True)
class DistillationReport:
    """The figures of a distillation.

    Attributes:
        method: ``"cloning"``, ``"dagger"`` or ``"viper"``.
        learner: ``"cart"`` or ``"c4.5"``.
        rounds: Every tree, in the order in which they were fitted.
        best: Number of the round whose tree was returned.
        return_interval: 95 % interval of its mean return. The mean of the best of many is a
            little too high: evaluate the tree on episodes of its own.
        labels: Observations with an action of the teacher.
        environment_steps: All steps: the demonstrations', the trees' and those of validation.
        validation_steps: Those of validation.
        teacher_steps: Those in which the teacher was trained before, none of the above; None where
            it does not say so itself (``num_timesteps``, as models of SB3 do).
        weighted: Whether observations were weighted by the teacher's action values.
    """

    method: str
    learner: str
    rounds: tuple[Round, ...]
    best: int
    return_interval: Interval
    labels: int
    environment_steps: int
    validation_steps: int
    weighted: bool
    teacher_steps: int | None = None

    @property
    def n_leaves(self) -> int:
        """Leaves of the returned tree."""
        return self.rounds[self.best].n_leaves

    @property
    def mean_return(self) -> float:
        """Mean return of the returned tree's validation episodes."""
        return self.rounds[self.best].mean_return


Progress = Callable[[int, Round], None]


def distill(
    teacher: Controller,
    env: Environment,
    settings: DistillationSettings | None = None,
    *,
    demonstrations: Demonstrations | None = None,
    action_values: ActionValues | None = None,
    seed: int = 0,
    strict: bool = False,
    on_round: Progress | None = None,
    n_jobs: int | None = None,
) -> tuple[TreePolicy, DistillationReport]:
    """Return a tree that decides as ``teacher`` does, and the cost of it.

    Args:
        teacher: As ``eutree.record`` takes it: anything with SB3's ``predict``, or a function.
        env: Where it acts: an environment, its id, or how to make it.
        settings: How; by default DAgger with C4.5, at most 32 leaves.
        demonstrations: The teacher's earlier episodes; they take the place of its first ones.
        action_values: The teacher's Q, from observations [N, d] to [N, A], for VIPER's weights. By
            default a method of that name of the teacher, or the values of a ``TreePolicy``'s
            leaves; without any VIPER's weights are all equal, and it is DAgger.
        seed: The same seed gives the same tree, byte for byte.
        strict: Refuse observations outside the environment's own bounds.
        on_round: Called after each tree with its number and its result.
        n_jobs: Processes for the episodes of the trees, as ``evaluate`` takes them, with an id or a
            spec; the teacher stays in this one. The result is the same.

    Raises:
        InvalidArgumentError: An argument is not as described, or the demonstrations are of another
            environment or hold no transition.
        EnvironmentFault: The environment broke its contract.
        MissingExtraError: CART without scikit-learn.
    """
    settings = check_kind("settings", settings or DistillationSettings(), DistillationSettings)
    check_seed(seed)
    env, spec = made(env, n_jobs)
    policy = as_policy(teacher, env)
    env = acting_for(acting_as(env, demonstrations), policy, "teacher")
    guarded = GuardedEnv(env, strict=strict)
    warn_of_codes(env)
    stakes = None
    if settings.method == "viper":
        stakes = stakes_of(policy, action_values, guarded.schema.n_actions)
    shown = demonstrations
    if shown is None:
        shown = record(env, policy, episodes=settings.episodes, seed=seed, strict=strict)
    check_shown(shown)
    guarded.schema.check_same(shown.schema, "demonstrations", of="the environment env")
    guarded.take_names(shown.schema)
    run = None if spec is None else RunPairs(Recipe.of(spec), strict)
    observations, actions = lessons(shown)
    worth = weights_in(shown)[taught_in(shown) != CUT]
    seen, right, steps = [observations], [actions], shown.n_transitions
    masks = [lesson_masks(shown)]
    trees: list[TreePolicy] = []
    results: list[Evaluation] = []
    rounds: list[Round] = []
    for number in range(settings.rounds):
        gathered = range(number * settings.episodes, (number + 1) * settings.episodes)
        seeds = [episode_seed(seed, k, Stream.GATHERING) for k in gathered]
        for episode in _episodes(guarded, trees[-1], seeds, run, n_jobs) if number else ():
            steps += len(episode)
            seen.append(episode.observations[:-1])
            right.append(actions_on(policy, episode, guarded))
            masks.append(episode.allowed)
        observations = np.concatenate(seen)
        allowed = stacked_masks(zip(masks, map(len, seen), strict=True))
        weight = weights(
            np.ones(len(observations)) if stakes is None else stakes(observations, allowed)
        )
        weight[: worth.size] *= worth  # of what a tree did before a person took over: nothing
        data = Labelled(observations, np.concatenate(right), weight)
        tree = fit(settings.learner, data, guarded.schema, guarded.spec, settings.max_leaves)
        trees.append(tree)
        validation = episode_seed(seed, 0, Stream.VALIDATION)
        where, n = (env, None) if spec is None else (spec, n_jobs)
        n_episodes = settings.validation_episodes
        results.append(evaluate(tree, where, episodes=n_episodes, seed=validation, n_jobs=n))
        same = float((tree.decide(observations, allowed) == data.actions).mean())
        rounds.append(Round(data.actions.size, tree.n_leaves, same, results[-1].mean_return))
        if on_round is not None:
            on_round(number, rounds[-1])
    validated = np.stack([result.returns for result in results])
    chosen = best(validated, [made.n_leaves for made in rounds])
    validation_steps = sum(result.steps for result in results)
    policy = replace(trees[chosen], masked=allowed is not None)
    return policy, DistillationReport(
        method=settings.method,
        learner=settings.learner,
        rounds=tuple(rounds),
        best=chosen,
        return_interval=results[chosen].return_interval,
        labels=data.actions.size,
        environment_steps=steps + validation_steps,
        validation_steps=validation_steps,
        weighted=stakes is not None,
        teacher_steps=trained_steps(teacher),
    )


def _episodes(
    env: GuardedEnv,
    tree: TreePolicy,
    seeds: Sequence[int],
    elsewhere: RunPairs | None,
    n_jobs: int | None,
) -> Iterable[Episode]:
    """Return a tree's episodes of some seeds: here, or in processes that make the environment."""
    if elsewhere is None:
        return (run_episode(env, tree, seed) for seed in seeds)
    return elsewhere.over(Workers(n_jobs), [(tree, seed) for seed in seeds], len(seeds))


def actions_on(teacher: Policy, episode: Episode, env: GuardedEnv) -> Integers:
    """Return the teacher's own actions at each step of an episode of another actor, shape [T].

    It is asked step by step, so that a teacher with a memory has the one it would have.
    """
    actor = Actor(teacher, env)
    masks = [None] * len(episode) if episode.allowed is None else episode.allowed
    steps = zip(episode.observations[:-1], masks, strict=True)
    return np.array([actor.act(row, allowed) for row, allowed in steps], dtype=np.int64)
