"""Distil a teacher into a small tree.

*Cloning* fits a tree to what the teacher did. Where the tree errs it comes to observations that
the teacher never showed. *DAgger* (Ross, Gordon, Bagnell 2011) lets the tree act, asks the teacher
what it would have done there, adds that to the data and fits anew, round after round. *VIPER*
(Bastani, Pu, Solar-Lezama 2018) moreover weights each observation by what a wrong action costs
there. The best tree of all rounds is chosen on validation episodes, the same for all and used for
nothing else.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Integers
from eutree.contests import best
from eutree.data import Demonstrations, Episode
from eutree.data.episode import allowed_in
from eutree.distillation.rounds import (
    ActionValues,
    DistillationReport,
    DistillationSettings,
    Labelled,
    Round,
    Stakes,
    fit,
    stakes_of,
    weights,
)
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation, evaluate
from eutree.interaction import GuardedEnv, episode_seed, record, run_episode
from eutree.interaction.acting import Actor, Controller, as_policy, trained_steps
from eutree.interaction.decoding import warn_of_codes
from eutree.interaction.deriving import acting_as
from eutree.interaction.recipe import Environment, Recipe, made
from eutree.interaction.seeding import Stream
from eutree.parallel import Workers
from eutree.policies import Policy, TreePolicy
from eutree.schema import Schema
from eutree.validation import check_seed

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
    """Return a tree that decides as ``teacher`` does, and what that took.

    Args:
        teacher: As ``eutree.record`` takes it: anything with SB3's ``predict``, or a function.
        env: Where it acts: an environment, its id, or how to make it.
        settings: How; by default DAgger with C4.5, at most 32 leaves.
        demonstrations: What the teacher showed already; it takes the place of its first episodes.
        action_values: The teacher's Q, from observations [N, d] to [N, A], for VIPER's weights. By
            default a method of that name of the teacher, or the values of a ``TreePolicy``'s
            leaves; without any VIPER's weights are all equal, and it is DAgger.
        seed: The same seed gives the same tree, byte for byte.
        strict: Refuse observations outside the environment's own bounds.
        on_round: Called after each tree with its number and what became of it.
        n_jobs: Processes for the episodes of the trees, as ``evaluate`` takes them, with an id or a
            spec; the teacher stays in this one. The result is the same.

    Raises:
        InvalidArgumentError: An argument is not as described, or the demonstrations are of another
            environment or hold no transition.
        EnvironmentFault: The environment broke its contract.
        MissingExtraError: CART without scikit-learn.
    """
    settings = settings or DistillationSettings()
    check_seed(seed)
    env, spec = made(env, n_jobs)
    policy = as_policy(teacher, env)
    env = acting_as(acting_as(env, demonstrations), policy)
    guarded = GuardedEnv(env, strict=strict)
    warn_of_codes(env)
    stakes = None
    if settings.method == "viper":
        stakes = stakes_of(policy, action_values, guarded.schema.n_actions)
    shown = demonstrations
    if shown is None:
        shown = record(env, policy, episodes=settings.episodes, seed=seed, strict=strict)
    _check_shown(shown, guarded.schema)
    guarded.take_names(shown.schema)
    team = None if spec is None else _Team(Workers(n_jobs), Recipe.of(spec), strict)
    school = _School(guarded, policy, stakes, shown, seed, team=team)
    trees: list[TreePolicy] = []
    results: list[Evaluation] = []
    rounds: list[Round] = []
    for number in range(settings.rounds):
        if number:
            school.gather(trees[-1], number, settings.episodes)
        data = school.data()
        tree = fit(settings.learner, data, guarded.schema, guarded.spec, settings.max_leaves)
        trees.append(tree)
        validation = episode_seed(seed, 0, Stream.VALIDATION)
        where, n = (env, None) if spec is None else (spec, n_jobs)
        n_episodes = settings.validation_episodes
        results.append(evaluate(tree, where, episodes=n_episodes, seed=validation, n_jobs=n))
        rounds.append(_round(data, tree, results[-1]))
        if on_round is not None:
            on_round(number, rounds[-1])
    validated = np.stack([result.returns for result in results])
    chosen = best(validated, [made.n_leaves for made in rounds])
    validation_steps = sum(result.steps for result in results)
    policy = replace(trees[chosen], masked=allowed_in(shown) is not None)
    return policy, DistillationReport(
        method=settings.method,
        learner=settings.learner,
        rounds=tuple(rounds),
        best=chosen,
        return_interval=results[chosen].return_interval,
        labels=school.labels,
        environment_steps=school.steps + validation_steps,
        validation_steps=validation_steps,
        weighted=stakes is not None,
        teacher_steps=trained_steps(teacher),
    )


@dataclass(frozen=True)
class _Team:
    """Processes in which a tree acts, each in an environment of its own."""

    workers: Workers
    recipe: Recipe
    strict: bool

    def episodes(self, tree: TreePolicy, seeds: Sequence[int]) -> list[Episode]:
        """Return the episodes of these seeds."""
        blocks = self.workers.blocks(len(seeds), len(seeds))
        acting = _Acting(tree, self.recipe, self.strict, seeds)
        return [episode for part in self.workers.map(acting, blocks) for episode in part]


@dataclass(frozen=True)
class _Acting:
    """Some episodes of a tree, in whichever process."""

    tree: TreePolicy
    recipe: Recipe
    strict: bool
    seeds: Sequence[int]

    def __call__(self, numbers: range) -> list[Episode]:
        env = self.recipe.make()
        try:
            guarded = GuardedEnv(acting_as(env, self.tree), strict=self.strict)
            return [run_episode(guarded, self.tree, self.seeds[k]) for k in numbers]
        finally:
            env.close()


class _School:
    """All observations so far with the teacher's actions, and what they cost."""

    def __init__(
        self,
        env: GuardedEnv,
        teacher: Policy,
        stakes: Stakes | None,
        shown: Demonstrations,
        seed: int,
        *,
        team: _Team | None,
    ) -> None:
        self.steps = self.labels = shown.n_transitions
        self._env = env
        self._teacher = teacher
        self._stakes = stakes
        self._seed = seed
        self._team = team
        self._observations = [shown.observations]
        self._actions = [shown.actions]

    def gather(self, tree: TreePolicy, number: int, episodes: int) -> None:
        """Let the tree act, and add what it comes to with the teacher's actions."""
        numbers = range(number * episodes, (number + 1) * episodes)
        seeds = [episode_seed(self._seed, k, Stream.GATHERING) for k in numbers]
        run: Iterable[Episode] = (run_episode(self._env, tree, seed) for seed in seeds)
        if self._team is not None:
            run = self._team.episodes(tree, seeds)
        for episode in run:
            self.steps += len(episode)
            self.labels += len(episode)
            self._observations.append(episode.observations[:-1])
            self._actions.append(actions_on(self._teacher, episode, self._env))

    def data(self) -> Labelled:
        """Return all of it, weighted."""
        observations = np.concatenate(self._observations)
        stakes = np.ones(len(observations))
        if self._stakes is not None:
            stakes = weights(self._stakes(observations))
        return Labelled(observations, np.concatenate(self._actions), stakes)


def actions_on(teacher: Policy, episode: Episode, env: GuardedEnv) -> Integers:
    """Return what the teacher would have done at each step of an episode of another's, shape [T].

    It is asked step by step, so that a teacher with a memory has the one it would have.
    """
    actor = Actor(teacher, env)
    masks = [None] * len(episode) if episode.allowed is None else episode.allowed
    steps = zip(episode.observations[:-1], masks, strict=True)
    return np.array([actor.act(row, allowed) for row, allowed in steps], dtype=np.int64)


def _round(data: Labelled, tree: TreePolicy, result: Evaluation) -> Round:
    same = tree.predict(data.observations)[0] == data.actions
    return Round(data.actions.size, tree.n_leaves, float(same.mean()), result.mean_return)


def _check_shown(shown: Demonstrations, schema: Schema) -> None:
    """Raise InvalidArgumentError unless there is something to learn in this environment."""
    schema.check_same(shown.schema, "demonstrations", of="the environment env")
    if not shown.n_transitions:
        raise InvalidArgumentError(
            f"demonstrations must hold at least one transition, got {len(shown)} episodes "
            "without a step"
        )
