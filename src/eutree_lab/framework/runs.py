"""The framework that the paper announces: its runs, as data, and their records.

The paper teaches one discretizer by demonstration and says that others could be taught alike. Here
every method meets every start, on three tasks, with a good and with a poor demonstrator. Runs of
one seed have in common the demonstrations, the evaluation episodes and the budget, for every method
and start; so arms are compared in pairs.

A start that a method cannot take is a record too: its reason stands where the figures would be.
"""

import hashlib
import time
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib import resources
from typing import Any, ClassVar, cast

import gymnasium
import msgspec
import numpy as np

from eutree.data import Demonstrations
from eutree.distillation import Labelled, actions_on, fit
from eutree.envs.experts import Expert, experts_for, late
from eutree.errors import InvalidArgumentError
from eutree.evaluation import evaluate
from eutree.files import Document
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.acting import as_policy
from eutree.interaction.episode import Stream
from eutree.interaction.making import make
from eutree.learners import METHODS, Method, PlanningMethod, fit_expert_tree
from eutree.learners.learner import HasPolicy
from eutree.learners.registry import to_document
from eutree.policies import Policy, TreePolicy
from eutree.policy_search.planner import Planner
from eutree.recording import record
from eutree.schema import EnvironmentSpec
from eutree.training import LearningResult, Run, learn
from eutree.validation import check_choice
from eutree_lab.parti_game import PartiGameMethod

GOOD, POOR = "good", "poor"
FROZEN = "frozen"  # the expert tree, which learns nothing
DAGGER = "dagger"  # the expert tree, refitted to the demonstrator's answers
LEFT_OUT = {
    "distilled-dqn": "its network takes minutes a run, two hundred times what the others do"
}
FEW_IMAGINED = Planner(n_episodes=200, n_explorer_episodes=100, n_steps=10_000)
TAUGHT = (
    "planning",
    "u-tree",
    "vqql",
    "adaptive-q",
    "density-tree",
    "history-u-tree",
    "vrd",
    "parti-game",
)

Goal = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A task of the experiment, and how much of it is run.

    Attributes:
        title: Its name, for people.
        environment: Id of the environment.
        demonstrator: The good scripted demonstrator.
        delay: Steps by which the poor one acts late; else it is the good one.
        chance: Mean return of uniformly random actions, 1,000 episodes.
        goal: Both corners of the goal for methods that must know it; None if there is none.
        demonstrations: Episodes that are demonstrated.
        episodes: Episodes of each run.
        gathering_episodes: Episodes between two updates, of every method.
        evaluate_every: Episodes between two frozen evaluations.
        evaluation_episodes: Episodes of each frozen evaluation.
        final_episodes: Episodes of the evaluation of the final tree.
    """

    title: str
    environment: str
    demonstrator: str
    delay: int
    chance: float
    goal: Goal | None = None
    demonstrations: int
    episodes: int
    gathering_episodes: int
    evaluate_every: int
    evaluation_episodes: int
    final_episodes: int

    def small(self) -> "Task":
        """Return the task with a few tiny runs, to see that everything works."""
        return replace(
            self,
            demonstrations=3,
            episodes=4,
            gathering_episodes=2,
            evaluate_every=2,
            evaluation_episodes=2,
            final_episodes=2,
        )


TASKS = msgspec.convert(
    tomllib.loads((resources.files(__package__) / "tasks.toml").read_text(encoding="utf-8")),
    dict[str, Task],
)


@dataclass(frozen=True)
class Arm:
    """Where a method begins, and who demonstrated.

    Attributes:
        start: A start of ``eutree.learners.starts``; ``"frozen"``, the expert tree as it is; or
            ``"dagger"``, C4.5 with the demonstrator's answers on the tree's own episodes.
        demonstrator: ``"good"`` or ``"poor"``; without demonstrations it is the good one's seed.
    """

    start: str
    demonstrator: str = GOOD

    @property
    def name(self) -> str:
        """The start, and the demonstrator where it is the poor one."""
        return self.start if self.demonstrator == GOOD else f"{self.start}, {self.demonstrator}"


NOTHING, TREE, TREE_AND_DEMOS = Arm("nothing"), Arm("tree"), Arm("tree+demos")
DEMOS, RANDOM_TREE = Arm("demos"), Arm("random-tree")
POOR_TREE_AND_DEMOS = Arm("tree+demos", POOR)
ARMS = (NOTHING, TREE, TREE_AND_DEMOS, DEMOS, RANDOM_TREE, POOR_TREE_AND_DEMOS)
MAIN_ARMS = (Arm(FROZEN), NOTHING, TREE_AND_DEMOS)
EXPERT_ARMS = tuple(Arm(start, who) for start in (FROZEN, DAGGER) for who in (GOOD, POOR))
SMOKE_RUNS = 2


@dataclass(frozen=True, kw_only=True)
class FrameworkSpec:
    """Everything that decides the result of one run.

    Attributes:
        task: Name of the task, a key of ``TASKS``.
        settings: The task itself: its environment, and how much of it is run.
        method: Name of the method; empty where C4.5 alone makes the tree.
        arm: Where it begins, and who demonstrated.
        seed: Seed of demonstrations, learning and evaluations.
        choices: Settings of the method, as JSON: a run made when its defaults were others is not
            taken for this one.
    """

    task: str
    settings: Task
    method: str
    arm: Arm
    seed: int = 0
    choices: str = ""

    @property
    def name(self) -> str:
        """A file name that tells the run apart from every other."""
        digest = hashlib.sha256(repr(sorted(asdict(self).items())).encode()).hexdigest()[:12]
        start = self.arm.name.replace(", ", "-")
        return f"{self.seed:02d}-{self.task}-{self.method or 'c45'}-{start}-{digest}"


class Evaluated(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A frozen evaluation of the tree: when, and how it did."""

    episode: int
    mean_return: float
    success: float | None
    n_leaves: int


class FrameworkRecord(Document, frozen=True, kw_only=True):
    """The record of a run.

    Attributes:
        spec: Task, method, arm and seed of the run.
        refused: Why the method does not take the start or the task; then the rest is empty.
        curve: Frozen evaluations of the tree along the way, the first before any learning.
        tree_return: Mean return of the last tree on fresh episodes.
        own_return: That of the method's own policy on the same episodes; the tree's where the
            leaves decide.
        fidelity: Share of stored observations at which both decide alike.
        n_leaves: Leaves of the last tree.
        demonstrated_steps: Environment steps of the demonstrations that the start made use of.
        learning_steps: Environment steps taken while learning.
        model_steps: Steps taken in world models by the updates.
    """

    FORMAT: ClassVar[str] = "eutree/framework-run"
    VERSION: ClassVar[int] = 1

    spec: FrameworkSpec
    refused: str = ""
    curve: tuple[Evaluated, ...] = ()
    tree_return: float = 0.0
    own_return: float = 0.0
    fidelity: float = 1.0
    n_leaves: int = 0
    demonstrated_steps: int = 0
    learning_steps: int = 0
    model_steps: int = 0


def specs(
    *, runs: int, methods: tuple[str, ...] = TAUGHT, first_seed: int = 0, smoke: bool = False
) -> list[FrameworkSpec]:
    """Return all runs: of every seed those of the main question first, then the other arms.

    The main question is the worth of teaching: the frozen tree, and every method from nothing and
    from the tree and the demonstrations. Both parts go seed by seed, so an interruption leaves a
    smaller experiment that is whole.

    Args:
        runs: Number of seeds.
        methods: Methods to run.
        first_seed: Seed of the first; the others follow it.
        smoke: Whether each run is a tiny one.

    Raises:
        UnknownNameError: A method is not one of those that are taught.
    """
    for method in methods:
        check_choice("--method", method, TAUGHT)
    tasks = {name: task.small() if smoke else task for name, task in TASKS.items()}
    cells = [("", arm) for arm in EXPERT_ARMS]
    cells += [(method, arm) for method in methods for arm in ARMS]
    choices = {
        (method, name): _choices_of(method, task)
        for method in methods
        for name, task in tasks.items()
    }
    return [
        FrameworkSpec(
            task=name,
            settings=task,
            method=method,
            arm=arm,
            seed=first_seed + run,
            choices=choices.get((method, name), ""),
        )
        for is_main in (True, False)
        for run in range(runs)
        for name, task in tasks.items()
        for method, arm in cells
        if (arm in MAIN_ARMS) == is_main
    ]


def is_smoke(specs: Sequence[FrameworkSpec]) -> bool:
    """Return whether some of the runs are tiny ones."""
    return any(spec.settings == TASKS[spec.task].small() for spec in specs)


def run(spec: FrameworkSpec) -> tuple[FrameworkRecord, float]:
    """Do one run; return its record and its CPU seconds.

    The same spec gives the same record, whichever process does it. Demonstrations are recorded
    once in a process, before the clock starts.
    """
    env = make(EnvironmentSpec(spec.settings.environment))
    shown = None if spec.arm == NOTHING else _shown(spec.settings, spec.arm.demonstrator, spec.seed)
    begin = time.process_time()
    if spec.method or shown is None:
        made = _learned(spec, env, shown)
    else:
        made = (_frozen if spec.arm.start == FROZEN else _corrected)(spec, env, shown)
    return made, time.process_time() - begin


def method_for(name: str, task: Task) -> Method:
    """Return the method with its default choices but few: those that the page names."""
    kind: Any = METHODS[name]
    chosen = kind(gathering_episodes=task.gathering_episodes)
    if isinstance(chosen, PartiGameMethod) and task.goal is not None:
        return replace(chosen, goal=task.goal)
    if isinstance(chosen, PlanningMethod):
        return replace(chosen, planner=FEW_IMAGINED)
    return cast(Method, chosen)


def _choices_of(name: str, task: Task) -> str:
    """Return all that a method chooses on a task, as JSON."""
    return msgspec.json.encode(to_document(method_for(name, task)), order="sorted").decode()


@cache
def _shown(task: Task, demonstrator: str, seed: int) -> Demonstrations:
    """Record the task's demonstrator, or the one that is late."""
    env = make(EnvironmentSpec(task.environment))
    expert = _demonstrator(task, demonstrator)
    return record(env, expert, episodes=task.demonstrations, seed=seed)


def _demonstrator(task: Task, demonstrator: str) -> Expert:
    """Return the task's demonstrator, or the one that is late."""
    expert = experts_for(task.environment)[task.demonstrator]
    return late(expert, task.delay) if demonstrator == POOR else expert


def _frozen(
    spec: FrameworkSpec, env: gymnasium.Env[Any, Any], shown: Demonstrations
) -> FrameworkRecord:
    """Evaluate the expert tree as it is."""
    tree, task = fit_expert_tree(shown), spec.settings
    final = evaluate(tree, env, episodes=task.final_episodes, seed=spec.seed).mean_return
    return FrameworkRecord(
        spec=spec,
        curve=(_evaluated(tree, env, spec, 0),),
        tree_return=final,
        own_return=final,
        n_leaves=tree.n_leaves,
        demonstrated_steps=shown.n_transitions,
    )


def _corrected(
    spec: FrameworkSpec, env: gymnasium.Env[Any, Any], shown: Demonstrations
) -> FrameworkRecord:
    """Let the tree act, ask its demonstrator for the right actions, fit C4.5 again: DAgger.

    It has the episodes of the methods and is updated when they are.
    """
    task, guarded = spec.settings, GuardedEnv(env)
    guarded.take_names(shown.schema)
    teacher = as_policy(_demonstrator(task, spec.arm.demonstrator), env)
    tree, steps = fit_expert_tree(shown), 0
    observations, actions = [shown.observations], [shown.actions]
    curve = [_evaluated(tree, env, spec, 0)]
    for number in range(1, task.episodes + 1):
        seed = episode_seed(spec.seed, number, Stream.GATHERING)
        episode = run_episode(guarded, tree, seed)
        steps += len(episode)
        observations.append(episode.observations[:-1])
        actions.append(actions_on(teacher, episode, guarded))
        if number % task.gathering_episodes == 0:
            seen, right = np.concatenate(observations), np.concatenate(actions)
            data = Labelled(seen, right, np.ones(len(right)))
            tree = fit("c4.5", data, shown.schema, shown.environment, None)
        if number % task.evaluate_every == 0:
            curve.append(_evaluated(tree, env, spec, number))
    final = evaluate(tree, env, episodes=task.final_episodes, seed=spec.seed).mean_return
    return FrameworkRecord(
        spec=spec,
        curve=tuple(curve),
        tree_return=final,
        own_return=final,
        n_leaves=tree.n_leaves,
        demonstrated_steps=shown.n_transitions,
        learning_steps=steps,
    )


def _evaluated(
    tree: TreePolicy, env: gymnasium.Env[Any, Any], spec: FrameworkSpec, number: int
) -> Evaluated:
    """Evaluate a tree on the episodes on which all arms are evaluated."""
    seed = episode_seed(spec.seed, 0, Stream.EVALUATION)
    found = evaluate(tree, env, episodes=spec.settings.evaluation_episodes, seed=seed)
    return Evaluated(number, found.mean_return, found.success_rate, tree.n_leaves)


def _learned(
    spec: FrameworkSpec, env: gymnasium.Env[Any, Any], shown: Demonstrations | None
) -> FrameworkRecord:
    """Learn, or say why the method refuses."""
    task = spec.settings
    kept: list[Run] = []

    def keep(run: Run) -> None:
        kept[:] = [run]

    try:
        result = learn(
            env,
            demonstrations=shown,
            method=method_for(spec.method, task),
            start=spec.arm.start,
            episodes=task.episodes,
            evaluate_every=task.evaluate_every,
            evaluation_episodes=task.evaluation_episodes,
            judge_episodes=0,
            seed=spec.seed,
            on_progress=keep,
        )
    except InvalidArgumentError as error:
        _, _, reason = str(error).partition("does not fit this task: ")
        if not reason:
            raise
        return FrameworkRecord(spec=spec, refused=reason)
    return _record(spec, env, shown, result, kept[0])


def _record(
    spec: FrameworkSpec,
    env: gymnasium.Env[Any, Any],
    shown: Demonstrations | None,
    result: LearningResult,
    run: Run,
) -> FrameworkRecord:
    """Evaluate the results on fresh episodes and put everything in a record."""

    def mean_return(policy: Policy) -> float:
        episodes = spec.settings.final_episodes
        return evaluate(policy, env, episodes=episodes, seed=spec.seed).mean_return

    learner, of_tree = run.learner, mean_return(result.policy)
    uses_demonstrations = spec.arm.start not in ("nothing", "random-tree")
    return FrameworkRecord(
        spec=spec,
        curve=tuple(
            Evaluated(p.episode, p.mean_return, p.success_rate, p.n_leaves) for p in result.curve
        ),
        tree_return=of_tree,
        own_return=mean_return(learner.own_policy()) if isinstance(learner, HasPolicy) else of_tree,
        fidelity=learner.decisions().fidelity,
        n_leaves=result.policy.n_leaves,
        demonstrated_steps=shown.n_transitions if shown and uses_demonstrations else 0,
        learning_steps=result.steps,
        model_steps=sum(int(event.get("model_steps", 0)) for event in run.state.events),
    )
