"""Learn a tree policy: from demonstrations or from nothing, in an environment."""

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import gymnasium

from eutree.compression.playing import Ground
from eutree.data import Demonstrations, check_rewards, derive
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Against, against, evaluate
from eutree.evaluation.evaluate import evaluate_starts
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.acting import Controller, as_policy
from eutree.interaction.deriving import acting_as, acting_for
from eutree.interaction.episode import Stream
from eutree.interaction.first_look import look_at
from eutree.interaction.first_look import return_range as known_range
from eutree.interaction.making import Environment, opened
from eutree.learners import DEFAULT, Method, Problem, Start, start_of
from eutree.learners.learner import check_fits, own_code
from eutree.learners.registry import checked_document
from eutree.policies import TreePolicy
from eutree.training.evaluations import Arena, ProvenFirst
from eutree.training.handover import Handover
from eutree.training.listeners import Listener, following
from eutree.training.phases import Plan, Position, generator_of
from eutree.training.planned import (
    ChosenMethod,
    check_monotone,
    check_races,
    planned,
    shown_by_chance,
)
from eutree.training.result import LearningResult, picked_of, result_of
from eutree.training.run import Beginning, Run
from eutree.training.run_folder import ConfigDocument, RunFolder, SavingClock
from eutree.training.teaching import as_teacher
from eutree.training.values import Asked, Budget, Folder, Schedule, ShortForms
from eutree.validation import check_kind

if TYPE_CHECKING:
    from eutree.evaluation.off_policy import Log, OffPolicyComparison
    from eutree.proof import Certificate

RIVAL_EPISODES = 100  # that the policy and a rival both play


def learn(
    env: Environment | None,
    *,
    demonstrations: Demonstrations | None = None,
    expert: TreePolicy | None = None,
    method: str | Method | None = "auto",
    start: str | None = None,
    budget: Budget | None = None,
    evaluation: Schedule | None = None,
    handover: Handover | None = None,
    folder: Folder | str | Path | None = None,
    listeners: object = (),
    seed: int = 0,
    **short: Unpack[ShortForms],
) -> LearningResult:
    """Learn a tree policy in ``env``, with the paper's protocol, or from recorded episodes alone.

    Args:
        env: A Gymnasium environment with a flat observation and finitely many actions, its id, or
            how to make it. None learns offline, from ``demonstrations`` alone: the method makes its
            updates over two thirds of them until one splits nothing. The rest says whether the tree
            is believed to beat that of ``fit_expert_tree`` (or ``expert``); if not, that one is the
            result.
        demonstrations: Episodes of an expert, in the features of one observation.
        expert: The expert tree; fitted to the demonstrations if a start needs it.
        method: How to learn: a name of ``eutree.learners.METHODS`` or of a preset, such as
            ``"paper"`` to be faithful, or a method itself. By default, and for
            ``"auto"``, ``distilled-dqn`` where observations have many features and the steps are
            enough for them (docs/methods.md), else model-based planning or, offline,
            ``"corrected"``; which it is, and which the other would be, is said aloud.
        start: Where learning begins: ``"nothing"``, ``"tree"``, ``"tree+demos"``, ``"demos"`` or
            ``"random-tree"``; the paper's C. U-Tree, EU-Tree - DT and EU-Tree are the first
            three. By default all that is given.
        budget: How long it may take.
        evaluation: When frozen policies are evaluated, and in how many episodes.
        handover: How it is decided which tree is handed over.
        folder: Where the run is written, and whether it goes on from there.
        listeners: Who follows the run and may end it: one or a list of ``eutree.listeners``, of
            callbacks of Stable-Baselines3, or of functions of ``(locals, globals)``.
        seed: The same seed gives the same result, byte for byte.
        **short: Plain words for the parts of these values, such as ``episodes=400`` and
            ``out="runs/a"``; see ``eutree.ShortForms``.

    Raises:
        InvalidArgumentError: The start lacks the demonstrations it needs, they are of another
            environment, the method does not fit the task, or a word is not known.
        EnvironmentFault: The environment broke its contract; the folder can be resumed.
        RunFolderError: The folder is in use, or holds a run that is not to be resumed.
    """
    values = {"budget": budget, "evaluation": evaluation, "handover": handover, "folder": folder}
    asked = Asked.of(values, listeners, short).going_on()
    with nullcontext() if env is None else opened(env) as made:
        run, config, log, by_chance = _prepared(
            made, asked, demonstrations, expert, method, start, seed=seed
        )
        for one in asked.listeners:
            one.attached(run, None if run.arena is None else run.arena.env.env)
        with own_code(run.beginning.method):
            policy, against_fit = _carried_out(run, log, config, asked, by_chance)
        return replace(
            result_of(run, policy, asked.teacher),
            against_fit=against_fit,
            against=_against(run, policy, asked.handover),
            certificate=_certificate(run, policy, asked.handover),
        )


def check_possible(env: Environment, asked: Asked, given: Mapping[str, Any], *, seed: int) -> None:
    """Raise as ``learn`` does, whose names are in ``given``, before its first episode."""
    usual = {"demonstrations": None, "expert": None, "method": "auto", "start": None}
    with opened(env) as made:
        _prepared(made, asked, **(usual | dict(given)), seed=seed)


def rivalry(
    policy: TreePolicy,
    rival: Controller,
    env: Environment,
    *,
    seed: int,
    known: tuple[float, float] | None,
    n_jobs: int | None = None,
) -> Against:
    """Return fresh episodes of a policy and of a rival, which have chosen nothing.

    ``known`` are the lowest and the highest return of an episode, None where nobody knows them.
    """
    fresh = episode_seed(seed, 0, Stream.AGAINST)
    both = [
        evaluate(who, env, episodes=RIVAL_EPISODES, seed=fresh, n_jobs=n_jobs)
        for who in (policy, rival)
    ]
    return against(*both, known=known)


def _prepared(
    env: gymnasium.Env[Any, Any] | None,
    asked: Asked,
    demonstrations: Demonstrations | None,
    expert: TreePolicy | None,
    method: str | Method | None,
    start: str | None,
    *,
    seed: int,
) -> "tuple[Run, ConfigDocument, Log | None, Demonstrations | None]":
    """Return a run before its first episode, its configuration, and the log it learns from.

    And the random episodes that it shows itself, if nobody has shown anything and it needs that.
    """
    digests = ""
    if demonstrations is not None:
        check_kind("demonstrations", demonstrations, Demonstrations)
    if expert is not None:
        check_kind("expert", expert, TreePolicy)
    if expert is not None and demonstrations is not None:
        more = expert.schema.derived[len(demonstrations.schema.derived) :]
        demonstrations = derive(demonstrations, more) if more else demonstrations
    if env is not None:
        env = acting_as(env, expert or demonstrations)
        if asked.starts:
            from eutree.proof import BeginningThere
            from eutree.proof.replay import SHARE, digest_of

            env = BeginningThere(env, asked.starts, share=SHARE)
            digests = " ".join(map(digest_of, asked.starts))
    meant: str | Method | ChosenMethod | None = method
    by_chance = None
    if env is not None and demonstrations is None and expert is None:
        meant, by_chance = shown_by_chance(asked, method, start, env, seed=seed)
        demonstrations = by_chance
    elif env is not None and expert is not None and expert.locked and method in (None, "auto"):
        meant = ChosenMethod(DEFAULT, "planning learns: it keeps the locked leaves")
    choice, plan = planned(asked, meant, start, demonstrations, env, seed=seed)
    if demonstrations is not None and asked.history:
        demonstrations = demonstrations.with_history(asked.history)
    arena, log, shown = None, None, demonstrations
    if env is not None:
        arena = _arena(env, expert or demonstrations, asked, plan)
        if (rival := asked.handover.against) is not None:
            acting_for(arena.env.env, as_policy(rival, arena.env.env), "against")
        problem, name = _problem(arena.env, plan), str(arena.env.spec or arena.env.name)
    elif demonstrations is None:
        raise InvalidArgumentError("'offline learning' needs demonstrations, got none")
    else:
        from eutree.evaluation.off_policy import Log

        log = Log.of(demonstrations, expert, asked.handover.return_range, seed=seed)
        problem = Problem(demonstrations.schema, demonstrations.environment, asked.history)
        name, shown = f"offline: {demonstrations.environment}", log.known
    teacher = as_teacher(asked.teacher, None if arena is None else arena.env)
    begin = _start(start, problem, shown, expert, log, seed=seed)
    begin = replace(begin, teacher=teacher, by_chance=by_chance is not None)
    check_fits(choice.method, problem, begin, offline=env is None)
    document = checked_document(choice.method)
    check_races(plan, begin)
    check_monotone(plan, choice.method)
    beginning = Beginning(choice.method, problem, begin, choice.said())
    run = Run(beginning, plan, arena, listeners=asked.listeners)
    config = _config(run, name, document, asked, demonstrations, expert, starts=digests)
    return run, config, log, by_chance


def _config(
    run: Run,
    environment: str,
    method: dict[str, Any],
    asked: Asked,
    demonstrations: Demonstrations | None,
    expert: TreePolicy | None,
    *,
    starts: str,
) -> ConfigDocument:
    """Return how a run was started, as its folder keeps it."""
    plan, handover, schema = run.plan, asked.handover, run.beginning.problem.schema
    named = (" = ".join(filter(None, (one.name, one.formula))) for one in schema.features)
    return ConfigDocument(
        environment=environment,
        method=method,
        start=run.beginning.start.name,
        episodes=plan.episodes,
        steps=plan.steps,
        minutes=asked.budget.minutes,
        evaluate_every=asked.evaluation.every if plan.is_dear else plan.evaluate_every,
        evaluation_episodes=asked.evaluation.episodes if plan.is_dear else plan.evaluation_episodes,
        history=asked.history,
        seed=plan.seed,
        demonstrations="" if demonstrations is None else demonstrations.digest,
        expert="" if expert is None else hashlib.sha256(expert.to_bytes()).hexdigest(),
        teacher="" if asked.teacher is None else asked.teacher.name(),
        strict=asked.strict,
        race=None if plan.race is None else asdict(plan.race),
        keep_success=plan.keep_success,
        judge_episodes=handover.episodes,
        return_range=handover.return_range,
        front_steps=handover.front_steps,
        starts=starts,
        monotone=plan.monotone,
        names=(*named, *schema.actions),
    )


def _arena(
    env: gymnasium.Env[Any, Any],
    named: TreePolicy | Demonstrations | None,
    asked: Asked,
    plan: Plan,
) -> Arena:
    """Return an environment to act in, with the names in the learner's start."""
    guarded = GuardedEnv(env, strict=asked.strict, history=asked.history)
    if named is not None:
        guarded.take_names(named.schema)
    resumes = asked.folder is not None and asked.folder.resume
    look_at(env, None if resumes else episode_seed(plan.seed, 0, Stream.TRAINING))
    return Arena(
        guarded,
        lambda policy, starts, seed: evaluate_starts(policy, env, starts, seed=seed),
        lambda seed: Ground(env, seed, stream=Stream.FRONT),
        asked.handover.return_range or known_range(env),
    )


def _problem(env: GuardedEnv, plan: Plan) -> Problem:
    """Return the problem as it is known before the first step."""
    spec = env.env.spec
    own_model = getattr(env.env.unwrapped, "model", None)
    whole_state = env.history == 0 and env.features.actions == 0
    limit, steps = None if spec is None else spec.max_episode_steps, plan.room(Position())
    if steps is not None:
        longest, steps = limit or 1, max(steps, 0)
        if steps < longest and not (plan.race_steps and steps == 0):
            beside = f" beside the {plan.race_steps:,} of race_steps" if plan.race_steps else ""
            raise InvalidArgumentError(
                f"steps must have room for an episode, which may take {longest:,}{beside}, "
                f"got {plan.steps:,}"
            )
    return Problem(
        env.schema,
        env.spec,
        env.history,
        env.features.actions,
        max_episode_steps=limit,
        steps=steps,
        model=own_model if callable(own_model) and whole_state else None,
    )


def _start(
    name: str | None,
    problem: Problem,
    shown: Demonstrations | None,
    expert: TreePolicy | None,
    log: "Log | None",
    *,
    seed: int,
) -> Start:
    """Return where learning begins; offline the known part of the log is always its history."""
    for what, given in (("demonstrations", shown), ("expert", expert)):
        if given is not None:
            problem.schema.check_same(given.schema, what, of="the environment")
    chance = generator_of(seed, Stream.START, 0)
    start = start_of(name, problem, demonstrations=shown, expert=expert, generator=chance)
    if log is not None:
        start = replace(start, episodes=log.known.kept)
    if start.episodes and shown is not None:
        check_rewards(shown, alone=log is not None)
    return start


def _carried_out(
    run: Run,
    log: "Log | None",
    config: ConfigDocument,
    asked: Asked,
    by_chance: Demonstrations | None,
) -> "tuple[TreePolicy, OffPolicyComparison | None]":
    """Let a run go to its end, in its folder if it has one, and return its policy."""
    where = asked.folder
    if where is None:
        with following(run, asked.listeners):
            _go_on(run, None, SavingClock(), asked.listeners)
        return _result(run, log)
    with RunFolder(where.path, config, type(run.beginning.method), resume=where.resume) as folder:
        folder.load_checkpoint(run)
        folder.save_start(run.beginning.start.expert)
        if by_chance is not None:
            folder.save_shown(by_chance)
        with following(run, asked.listeners):
            _go_on(run, folder, SavingClock(where.checkpoint_seconds), asked.listeners)
        policy, against_fit = _result(run, log)
        judgement, front = run.evaluations.judgement, run.evaluations.front
        lost = judgement is not None and judgement.lost
        folder.save_result(policy, run.learned(), front, picked_of(run), lost=lost)
    return policy, against_fit


def _certificate(run: Run, policy: TreePolicy, asked: Handover) -> "Certificate | None":
    """Return the proof of the tree handed over, where proven trees are preferred and it is one."""
    if asked.prefer_proven is None:
        return None
    return ProvenFirst(run.beginning.problem.environment, asked.prefer_proven).certificate(policy)


def _against(run: Run, policy: TreePolicy, asked: Handover) -> Against | None:
    """Return fresh episodes of the policy and of the rival, if one is named."""
    if asked.against is None or run.arena is None or run.state.stopped:
        return None
    where, known = run.arena.env.env, run.arena.return_range
    return rivalry(policy, asked.against, where, seed=run.plan.seed, known=known)


def _result(run: Run, log: "Log | None") -> "tuple[TreePolicy, OffPolicyComparison | None]":
    """Return the policy; offline the learned tree only where it is believed to be the better."""
    if log is None or run.state.stopped:
        return run.policy(), None
    method = run.beginning.method
    policy, found = log.chosen(run.policy(), discount=getattr(method, "discount", None))
    return run.keeping(policy), found


def _go_on(
    run: Run, folder: RunFolder | None, clock: SavingClock, listeners: Sequence[Listener]
) -> None:
    """Advance the run to its end; save a checkpoint often enough, and at an interruption."""
    try:
        while not run.finished:
            run.advance()
            for one in listeners:
                one.advanced(run)
            if folder is not None and clock.due():
                with clock.saving():
                    folder.save_checkpoint(run)
    except Exception:
        if not (run.curve or run.episode):
            folder = None  # there is nothing to go on with
        raise
    finally:
        # What an interruption left half done is not saved: the last checkpoint is good.
        if folder is not None and run.state.whole:
            folder.save_checkpoint(run)
