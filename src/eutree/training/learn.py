"""Learn a tree policy: from demonstrations or from nothing, in an environment."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import gymnasium

from eutree.compression.playing import Ground
from eutree.data import Demonstrations, check_rewards
from eutree.errors import InvalidArgumentError
from eutree.evaluation import evaluate
from eutree.evaluation.evaluate import evaluate_starts
from eutree.evaluation.off_policy import OffPolicyComparison
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.action_grid import acting_as
from eutree.interaction.first_look import look_at
from eutree.interaction.recipe import Environment, opened
from eutree.interaction.return_range import return_range as known_range
from eutree.interaction.seeding import Stream
from eutree.learners import Method, Problem, Start, start_of
from eutree.learners.default_choice import Evidence
from eutree.learners.learner import HasTeacher, check_fits
from eutree.learners.registry import checked_document
from eutree.policies import TreePolicy
from eutree.training.beginning import Arena, Beginning, generator_of
from eutree.training.callback import CallbackLike, CallbackListener
from eutree.training.chosen_method import choice_of, remembering, with_limit
from eutree.training.handover import handover_for
from eutree.training.log import DISCOUNT, Log
from eutree.training.phases import MANY, Plan
from eutree.training.proposals import SearchSettings
from eutree.training.result import LearningResult, StepCounts
from eutree.training.run import Run
from eutree.training.run_folder import ConfigDocument, RunFolder, SavingClock, length_of_run
from eutree.training.teaching import AskedTeacher, Teacher, as_teacher
from eutree.training.tensorboard import TensorBoardLog
from eutree.validation import check_integer, check_number, check_range

Progress = Callable[[Run], None]

EPISODES = 400  # where no budget is named


def learn(
    env: Environment | None,
    *,
    demonstrations: Demonstrations | None = None,
    expert: TreePolicy | None = None,
    teacher: Teacher | None = None,
    method: str | Method | None = None,
    start: str | None = None,
    episodes: int | None = None,
    steps: int | None = None,
    minutes: float | None = None,
    race_steps: int = 0,
    max_leaves: int | None = None,
    keep_success: bool = False,
    judge_episodes: int | None = None,
    return_range: tuple[float, float] | None = None,
    front_steps: int | None = None,
    seed: int = 0,
    evaluate_every: int = 20,
    evaluation_episodes: int = 100,
    history: int = 0,
    max_transitions: int | None = None,
    strict: bool = False,
    out: str | Path | None = None,
    resume: bool = False,
    checkpoint_seconds: float | None = None,
    tensorboard: str | Path | None = None,
    callback: CallbackLike | None = None,
    stop: Callable[[], bool] = lambda: False,
    on_progress: Progress | None = None,
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
        teacher: Who says what to do at observations that are met later, in place of the network
            that ``distilled-dqn`` would train; its training is not counted but declared.
        method: How to learn: a name of ``eutree.learners.METHODS`` or of a preset, such as
            ``"paper"`` to be faithful, or a method itself. By default, and for
            ``"auto"``, ``distilled-dqn`` where demonstrations have many features and the steps are
            enough for them (docs/methods.md), else model-based planning or, offline,
            ``"corrected"``; which it is, and which the other would be, is said aloud.
        start: Where learning begins: ``"nothing"``, ``"tree"``, ``"tree+demos"``, ``"demos"`` or
            ``"random-tree"``; the paper's C. U-Tree, EU-Tree - DT and EU-Tree are the first
            three. By default what is given.
        episodes: Most episodes of experience; offline, the most updates. 400 where no other budget
            is given, else as many as that allows.
        steps: Most environment steps of the run: those of learning and of racing, without
            demonstrations and evaluations. An episode begins only if the longest possible one
            still fits; where none is known, one is cut short at the budget.
        minutes: Most minutes of the clock for learning and racing. What is learned then depends
            on the machine; everything else repeats byte for byte.
        race_steps: Environment steps spent at the end on policy search with racing: trees proposed
            by several world models, prunings and random changes prove themselves against the
            policy in episodes with common starts. They are part of ``steps``.
        max_leaves: Most leaves of the result; for methods that plan, or with ``race_steps``. Where
            a race ends the run it keeps the limit, and what is planned before may be larger.
        keep_success: Replace the policy only by one that succeeds as often, in the same episodes;
            and the start only by one that succeeds as often on fresh ones.
        judge_episodes: Most fresh episodes that the start and the learned tree both play at the
            end: the start is handed over unless the other is shown to earn more, or to be smaller
            and earn no less, and succeeds less often by a point at most. None takes five for each
            episode of the run, 300 to 5,000; 0 plays none and hands over what was learned, as the
            presets that read the paper literally do.
        return_range: Lowest and highest return that an episode can have, where ``env`` does not
            say so itself (``eutree.interaction.return_range``); what is said of the learned tree
            then holds without a condition, also offline.
        front_steps: Most environment steps of the front: of what was learned the best tree of each
            size is made, imagined where the method has a world model, and the smallest that plays
            within one standard error of the best, and succeeds as often as the start, meets the
            start. None takes two for each step of the run, a hundred where episodes run side by
            side; 0 makes none.
        seed: The same seed gives the same result, byte for byte.
        evaluate_every: Episodes between two frozen evaluations.
        evaluation_episodes: Episodes of each frozen evaluation.
        history: Number of previous observations that become features too, for what one
            observation does not show, such as a direction of movement.
        max_transitions: Most transitions that the learner remembers between two episodes, so that
            a run of any length takes bounded memory: a uniform sample of those of each leaf and
            action or, with planning, whole episodes. None leaves it to ``method``.
        strict: Refuse observations outside the environment's own bounds.
        out: Folder for the policy, the expert tree, the curve, the events and the checkpoints.
        resume: Go on from the last checkpoint in ``out``, to the same bytes as if nothing had
            happened in between; as far as it was to go, if no budget is given.
        checkpoint_seconds: Time between two checkpoints; 0 saves one after every episode. None
            lets saving take at most a twentieth of the time. The result does not depend on it.
        tensorboard: Folder for the log that TensorBoard shows; one for each run. Needs the extra
            ``tensorboard``.
        callback: Follows the run and may end it, as in SB3: a function of ``(locals, globals)``
            called after each step, a callback of SB3's kind, or a list of them. Not
            for offline learning, which takes no steps.
        stop: Asked before every step; True ends the run at its last finished episode.
        on_progress: Called after each episode and each evaluation, or each expansion offline.

    Raises:
        InvalidArgumentError: The start lacks the demonstrations it needs, they are of another
            environment, or the method does not fit the task.
        EnvironmentFault: The environment broke its contract; ``out`` can be resumed.
        RunFolderError: ``out`` is in use, or holds a run and ``resume`` is False.
    """
    if env is not None and not isinstance(env, gymnasium.Env):
        return _learn_in(env, locals())
    check_integer("evaluation_episodes", evaluation_episodes, low=1)
    return_range = None if return_range is None else check_range("return_range", return_range)
    if env is None:
        _check_acts_nowhere(race_steps, keep_success=keep_success)
    env = None if env is None else acting_as(env, expert or demonstrations)
    if resume and out is not None and episodes is steps is minutes is None:
        episodes, steps, minutes = length_of_run(out)
    clock = SavingClock(checkpoint_seconds)
    choice = choice_of(
        None if method == "auto" else method,
        start,
        Evidence(demonstrations, steps, teacher is not None),
        offline=env is None,
        plans=bool(race_steps or keep_success or history or max_transitions),
    )
    chosen = with_limit(
        remembering(choice.method, max_transitions), max_leaves, races=race_steps > 0
    )
    plan = Plan(
        episodes=_episodes(episodes, steps, minutes),
        steps=steps,
        seconds=None if minutes is None else 60.0 * check_number("minutes", minutes, low=0.0),
        evaluate_every=evaluate_every,
        gathers=env is not None,
        race=SearchSettings(steps=race_steps, max_leaves=max_leaves, keep_success=keep_success)
        if race_steps
        else None,
        keep_success=keep_success,
        handover=handover_for(
            chosen, judge_episodes, max_leaves, keep_success=keep_success, front_steps=front_steps
        ),
        seed=seed,
    )
    if demonstrations is not None and history:
        demonstrations = demonstrations.with_history(history)
    log = None
    if env is None:
        recorded = _needed(demonstrations, "offline learning")
        log = Log.of(recorded, expert, return_range, seed=seed)
        problem = Problem(recorded.schema, recorded.environment, history)
        environment = f"offline: {recorded.environment}"
    else:
        guarded = _named_as(
            expert or demonstrations, GuardedEnv(env, strict=strict, history=history)
        )
        look_at(env, None if resume else episode_seed(seed, 0, Stream.TRAINING))
        problem = _problem(guarded)
        if steps is not None:
            problem = replace(problem, steps=_gathered(steps, race_steps, problem))
        environment = str(guarded.spec or guarded.name)
    learned_from = demonstrations if log is None else log.known
    begin = _start(
        start,
        problem,
        learned_from,
        expert,
        as_teacher(teacher, None if env is None else guarded),
        seed=seed,
        offline=env is None,
    )
    document = _as_document(chosen, problem, begin, offline=env is None)
    beginning = Beginning(chosen, problem, begin, choice.said())
    _check_races(plan, begin)
    run = Run(
        beginning,
        plan,
        None if env is None else _arena(guarded, env, evaluation_episodes, return_range),
        stop=stop,
    )
    config = ConfigDocument(
        environment=environment,
        method=document,
        start=begin.name,
        episodes=plan.episodes,
        steps=steps,
        minutes=minutes,
        evaluate_every=evaluate_every,
        evaluation_episodes=evaluation_episodes,
        history=history,
        seed=seed,
        demonstrations="" if demonstrations is None else demonstrations.digest,
        expert="" if expert is None else hashlib.sha256(expert.to_bytes()).hexdigest(),
        teacher="" if teacher is None else teacher.name(),
        strict=strict,
        race=None if plan.race is None else asdict(plan.race),
        keep_success=keep_success,
        judge_episodes=judge_episodes,
        return_range=return_range,
        front_steps=front_steps,
    )
    listener = None if callback is None else _listener(callback, run, env)
    if out is None:
        with _followed(run, listener, tensorboard) as follow:
            _go_on(run, None, clock, (follow, on_progress))
        policy, against_fit = _result(run, log)
    else:
        with RunFolder(out, config, type(chosen), resume=resume) as folder:
            folder.load_checkpoint(run)
            folder.save_start(begin.expert)
            with _followed(run, listener, tensorboard) as follow:
                _go_on(run, folder, clock, (follow, on_progress))
            policy, against_fit = _result(run, log)
            folder.save_result(policy, run.learned(), run.evaluations.front, run.evaluations.picked)
    recorded_steps = 0 if demonstrations is None else sum(map(len, begin.episodes))
    return LearningResult(
        policy=policy,
        learned=run.learned(),
        first=run.first,
        expert=begin.expert,
        curve=tuple(run.curve),
        history=run.learner.history,
        method=chosen,
        start=begin.name,
        episodes=run.episode,
        steps=run.at.steps,
        environment_steps=StepCounts(
            demonstrations=recorded_steps,
            teacher=run.at.teacher_steps,
            learning=run.at.steps - run.at.teacher_steps,
            racing=run.at.racing_steps,
            front=run.at.front_steps,
            judging=0 if run.evaluations.judgement is None else run.evaluations.judgement.steps,
            declared=0 if teacher is None else teacher.cost,
        ),
        challengers=run.challengers,
        against_start=run.evaluations.judgement,
        against_fit=against_fit,
        teacher=run.learner.teacher if isinstance(run.learner, HasTeacher) else None,
        front=run.evaluations.front,
        picked=run.evaluations.picked,
        model_trust=run.model_trust(),
        reason=choice.said(),
    )


def _result(run: Run, log: Log | None) -> tuple[TreePolicy, OffPolicyComparison | None]:
    """Return the policy; offline the learned tree only where it is believed to be the better."""
    if log is None or run.state.stopped:
        return run.policy(), None
    method = run.beginning.method
    return log.chosen(run.policy(), discount=getattr(method, "discount", DISCOUNT))


def _as_document(
    method: Method, problem: Problem, start: Start, *, offline: bool
) -> dict[str, Any]:
    """Return what is stored of a method; raise InvalidArgumentError unless it fits the task."""
    check_fits(method, problem, start, offline=offline)
    return checked_document(method)


def _episodes(episodes: int | None, steps: int | None, minutes: float | None) -> int:
    """Return the most episodes: the usual number only where nothing else ends the run."""
    if episodes is not None:
        return episodes
    return EPISODES if steps is None and minutes is None else MANY


def _learn_in(env: Environment, arguments: dict[str, Any]) -> LearningResult:
    """Return what ``learn`` returns for an environment that is made for it, and closed then."""
    with opened(env) as made:
        return learn(**{**arguments, "env": made})


def _check_races(plan: Plan, start: Start) -> None:
    """Raise InvalidArgumentError for a race that would have nothing to go by."""
    if plan.race_steps and not (plan.episodes or start.episodes):
        raise InvalidArgumentError(
            "race_steps needs stored transitions: give demonstrations or at least one episode"
        )
    if plan.steps is not None and plan.race_steps > plan.steps:
        raise InvalidArgumentError(
            f"race_steps must be at most steps, {plan.steps}, got {plan.race_steps}"
        )


def _gathered(steps: int, race_steps: int, problem: Problem) -> int:
    """Return the steps of a budget that are for learning; all may be for racing.

    Raises:
        InvalidArgumentError: They are not enough for one episode.
    """
    left = max(steps - race_steps, 0)
    longest = problem.max_episode_steps or 1
    if left < longest and not (race_steps and left == 0):
        beside = f" beside the {race_steps:,} of race_steps" if race_steps else ""
        raise InvalidArgumentError(
            f"steps must have room for an episode, which may take {longest:,}{beside}, "
            f"got {steps:,}"
        )
    return left


def _check_acts_nowhere(race_steps: int, *, keep_success: bool) -> None:
    """Raise InvalidArgumentError for what needs an environment to act in."""
    if race_steps:
        raise InvalidArgumentError(
            f"race_steps must be 0 without an environment to run them in, got {race_steps}"
        )
    if keep_success:
        raise InvalidArgumentError("keep_success must be False without an environment, got True")


def _arena(
    guarded: GuardedEnv,
    env: gymnasium.Env[Any, Any],
    episodes: int,
    returns: tuple[float, float] | None,
) -> Arena:
    """Return where a run acts, and frozen policies are evaluated in so many episodes."""
    return Arena(
        guarded,
        lambda policy, seed: evaluate(policy, env, episodes=episodes, seed=seed),
        lambda policy, starts, seed: evaluate_starts(policy, env, starts, seed=seed),
        lambda seed: Ground(env, seed, stream=Stream.FRONT),
        returns or known_range(env),
    )


def _listener(
    callback: CallbackLike, run: Run, env: gymnasium.Env[Any, Any] | None
) -> CallbackListener:
    if env is None:
        raise InvalidArgumentError(
            "callback must be None for offline learning, which takes no steps"
        )
    run.state.listener = listener = CallbackListener(callback, run, env)
    return listener


@contextmanager
def _followed(
    run: Run, listener: CallbackListener | None, tensorboard: str | Path | None
) -> Iterator[Progress | None]:
    """Let callbacks and TensorBoard follow the run; yield what to call when something happened."""
    log = None if tensorboard is None else TensorBoardLog(tensorboard, run)
    try:
        if listener is not None:
            listener.training_begins()
        yield None if log is None else lambda _: log.write()
        if listener is not None:
            listener.training_ends()
    finally:
        if log is not None:
            log.close()


def _go_on(
    run: Run,
    folder: RunFolder | None,
    clock: SavingClock,
    followers: Sequence[Progress | None],
) -> None:
    """Advance the run to its end; save a checkpoint often enough, and at an interruption."""
    try:
        while not run.finished:
            run.advance()
            for follow in followers:
                if follow is not None:
                    follow(run)
            if folder is not None and clock.due():
                with clock.saving():
                    folder.save_checkpoint(run)
    finally:
        # What an interruption left half done is not saved: the last checkpoint is good.
        if folder is not None and run.state.whole:
            folder.save_checkpoint(run)


def _problem(env: GuardedEnv) -> Problem:
    """Return what can be known of an environment before the first step."""
    spec = env.env.spec
    own_model = getattr(env.env.unwrapped, "model", None)
    whole_state = env.history == 0 and env.features.actions == 0
    return Problem(
        env.schema,
        env.spec,
        env.history,
        env.features.actions,
        max_episode_steps=None if spec is None else spec.max_episode_steps,
        model=own_model if callable(own_model) and whole_state else None,
    )


def _named_as(given: TreePolicy | Demonstrations | None, guarded: GuardedEnv) -> GuardedEnv:
    """Let an environment without names have those of what the learner starts from."""
    if given is not None:
        guarded.take_names(given.schema)
    return guarded


def _needed(demonstrations: Demonstrations | None, what: str) -> Demonstrations:
    if demonstrations is None:
        raise InvalidArgumentError(f"{what!r} needs demonstrations, got none")
    return demonstrations


def _start(
    name: str | None,
    problem: Problem,
    demonstrations: Demonstrations | None,
    expert: TreePolicy | None,
    teacher: AskedTeacher | None,
    *,
    seed: int,
    offline: bool,
) -> Start:
    """Return where learning begins; offline the demonstrations are always its history."""
    for what, given in (("demonstrations", demonstrations), ("expert", expert)):
        if given is not None:
            problem.schema.check_same(given.schema, what, of="the environment")
    chance = generator_of(seed, Stream.START, 0)
    start = start_of(name, problem, demonstrations=demonstrations, expert=expert, generator=chance)
    if offline:
        start = replace(start, episodes=_needed(demonstrations, "offline learning").kept)
    if start.episodes:
        check_rewards(_needed(demonstrations, start.name), alone=offline)
    return replace(start, teacher=teacher)
