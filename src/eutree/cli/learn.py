"""``eutree learn``: grow a tree by reinforcement, from demonstrations or from nothing."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from signal import SIGINT
from typing import TYPE_CHECKING, Any, TypeVar

import click

from eutree.cli import _options as option
from eutree.cli._given import (
    KEPT,
    GoesOn,
    RunSettings,
    chosen_by_file,
    chosen_method,
    keep,
    line_to_go_on,
    listed,
)
from eutree.cli._learning import Following, as_values, in_words, many_results, run_many
from eutree.cli._output import Result, progress, say
from eutree.cli._policies import (
    OWN,
    against_option,
    controller,
    in_zoo,
    load_demonstrations,
    policy_file,
)
from eutree.cli.parts import cluster, workers_options
from eutree.data import Demonstrations
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.interaction.acting import trained_steps
from eutree.interaction.making import MANNER, make
from eutree.interaction.names import given_names
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.zoo import card

# What is not heard where nobody plays.
_PLAYED = ("steps", "minutes", "judge_episodes", "front_steps", "evaluate_every",
           "evaluation_episodes", "env_arguments", "decode", "action_grid", "n_jobs")  # fmt: skip

if TYPE_CHECKING:
    from eutree.training import LearningResult, Teacher
    from eutree.training.listeners import StopRequest
    from eutree.training.many import LearningRuns

    _Result = TypeVar("_Result", LearningResult, LearningRuns)


@option.command(
    "eutree learn eutree/Evasion2-v0 --demos demos/ --out runs/a",
    cls=GoesOn,
    groups={
        "To begin with": ("demos", "expert", "start", "teacher", "teacher_steps", "starts_from",
                            "offline"),
        "How": ("method", "preset", "changes", "settings", "discount", "list_settings",
                "max_leaves", "monotone", "history", "max_transitions"),
        "How long": ("episodes", "steps", "minutes", "race_steps", "runs"),
        "What is handed over": ("judge_episodes", "front_steps", "keep_success", "prefer_proven",
                                "evaluate_every",
                                "evaluation_episodes", "return_range", "against"),
        "The run folder": ("out", "resume", "checkpoint_seconds", "tensorboard"),
    },
    brief=("demos", "expert", "method", "episodes", "steps", "minutes", "max_leaves", "runs", "out",
           "resume", "env_arguments", "import", "seed", "as_json"),
)  # fmt: skip
@click.argument("environment", required=False)
@option.path("--demos", text="Demonstrations to start from.")
@option.path("--expert", text="Policy file to start from, instead of the expert tree of --demos.")
@click.option("--teacher", type=click.Path(), metavar="NAME",
              help="Who teaches instead of a network: a policy file, a scripted "
              f"expert, or your own, {OWN}; for distilled-dqn.")  # fmt: skip
@option.count("--teacher-steps", None, "Steps in which --teacher was trained.", least=0)
@option.starts("half of the episodes begin where it failed. May be repeated.", multiple=True)
@option.output("--out", text="Run folder to write.")
@click.option("--method", help="How to learn: planning, distilled-dqn, u-tree, ...; a preset; one "
              "of your own, MODULE:CLASS; by default auto, between the first two.")  # fmt: skip
@click.option("--preset", help="A method with all choices made: default, paper (literal), paper-d, "
              "corrected (the default of --offline).")  # fmt: skip
@click.option("--set", "changes", multiple=True, metavar="KEY=VALUE",
              help="A choice of the method, for example price=0.004. May be repeated.")  # fmt: skip
@option.path("--settings", text="TOML file of choices, the config.json of a run for those of "
             "its method, or zoo:TASK, which is known to work.")  # fmt: skip
@click.option("--discount", type=click.FloatRange(0, 1), help="Short for --set discount=G.")
@click.option("--list-settings", is_flag=True,
              help="Say what each choice of the method does, and which to turn first.")  # fmt: skip
@click.option("--start", help="nothing, tree, tree+demos, demos or random-tree; by default what is "
              "given.")  # fmt: skip
@option.count("--episodes", None, "Episodes of experience; 400 where no other budget is given.",
              least=0)  # fmt: skip
@option.count("--steps", None, "Most environment steps: learning and racing.")
@click.option("--minutes", type=click.FloatRange(min=0, min_open=True),
              help="Most minutes of the clock, evaluation included.")  # fmt: skip
@option.count("--evaluate-every", None, "Episodes between two frozen evaluations; by default 20, "
              "or all of a short run whose episodes run one by one.")  # fmt: skip
@option.count("--evaluation-episodes", None, "Episodes of each frozen evaluation; by default 100, "
              "or in proportion to a short run whose episodes run one by one.")  # fmt: skip
@option.count("--history", 0, "Previous observations that become features too.", least=0)
@option.count("--race-steps", 0, "Environment steps spent at the end on policy search: challengers "
              "race the policy.", least=0)  # fmt: skip
@option.count("--max-leaves", None, "Most leaves of the result.", least=2)
@click.option("--keep-success", is_flag=True,
              help="Replace the policy only by one that succeeds as often.")  # fmt: skip
@option.count("--judge-episodes", None, "Most fresh episodes of start and result at the end; the "
              "start is handed over where the result is not shown to be better. 0: none.",
              least=0)  # fmt: skip
@click.option("--return-range", type=float, nargs=2, metavar="LOW HIGH",
              help="Lowest and highest return of an episode, where the environment does not say "
              "it, and --offline.")  # fmt: skip
@option.count("--front-steps", None, "Most steps in which the best tree of each size plays at the "
              "end; by default 2 for each step of the run, 100 where episodes run side by side. "
              "0: none.", least=0)  # fmt: skip
@option.count("--max-transitions", None, "Most transitions to remember; by default all.")
@click.option("--offline", is_flag=True, help="Learn from the demonstrations alone.")
@click.option("--resume", is_flag=True,
              help="Go on with the run in the folder --out, which is enough.")  # fmt: skip
@click.option("--checkpoint-seconds", type=click.FloatRange(min=0),
              help="Time between two checkpoints; 0 for one after every episode. By default "
              "saving takes at most a twentieth of the time.")  # fmt: skip
@option.output("--tensorboard", text="Folder for a log that TensorBoard shows; one for each run.")
@option.monotone
@click.option("--strict", is_flag=True, help="Refuse observations outside the space's bounds.")
@against_option
@option.count("--runs", 1, "Runs, with seeds from --seed on; the best is chosen and judged.")
@click.option("--prefer-proven", metavar="[PROPERTY]", is_flag=False, flag_value="",
              help="Hand over a tree that is proven, as prove does, if any of the front or of "
              "--runs is; without PROPERTY that of the environment's plant.")  # fmt: skip
@workers_options("--runs")
@option.environment
@option.seed
def learn(
    environment: str | None,
    demos: Path | None,
    expert: Path | None,
    teacher: str | None,
    teacher_steps: int | None,
    out: Path | None,
    method: str | None,
    preset: str | None,
    changes: tuple[str, ...],
    settings: Path | None,
    discount: float | None,
    list_settings: bool,
    steps: int | None,
    race_steps: int,
    offline: bool,
    runs: int,
    n_jobs: int,
    against: str | None,
    starts_from: tuple[Path, ...],
    backend: str,
    address: str | None,
    env_arguments: dict[str, Any],
    **options: Any,
) -> Result:
    """Learn a policy in ENVIRONMENT and write it, with all that led to it, to a run folder.

    Without ENVIRONMENT it is that of the demonstrations, or else of settings of the zoo.
    """
    from eutree.learners import method as method_of
    from eutree.proof import load_certificate
    from eutree.training import learn as learn_policy
    from eutree.training.listeners import stop_on_signals

    if method is not None and preset is not None:
        raise InvalidArgumentError("--method and --preset both say how to learn; leave out one")
    chosen = chosen_method(
        method or preset, offline=offline, settings=settings, changes=changes, discount=discount
    )
    if list_settings:
        return Result(*listed(chosen, offline=offline))
    if out is None:
        raise click.MissingParameter(param_type="option", param_hint="'--out'")
    of_run = RunSettings.of(settings)
    of_run.declare_derived(click.get_current_context())
    demonstrations = None if demos is None else load_demonstrations(demos)
    if offline and demonstrations is None:
        raise InvalidArgumentError("--offline learns from demonstrations alone; name them: --demos")
    if offline and against is not None:
        raise InvalidArgumentError("--against needs an environment to act in; leave out --offline")
    if offline and demonstrations is not None:
        option.refuse(_PLAYED, "nothing is played with --offline")
        _check_shown(demonstrations, environment)
        if not hasattr(method_of(chosen) if isinstance(chosen, str) else chosen, "max_leaves"):
            cut = "eutree compress RUN --max-leaves N cuts the result of --offline"
            option.refuse({"max_leaves"}, cut)
    spec = None if offline else _spec(environment, demonstrations, env_arguments, of_run)
    rival = None if spec is None or against is None else controller(against, "--against", spec)
    if demonstrations is None and expert is None and spec is not None:
        demonstrations = of_run.shown(spec, options["seed"])
    options |= {
        "demonstrations": demonstrations,
        "expert": None if expert is None else TreePolicy.load(policy_file(expert)),
        "teacher": _teacher(teacher, teacher_steps, spec),
        "method": chosen,
        "against": rival,
        "steps": steps,
        "race_steps": race_steps or of_run.race_steps(steps),
        "starts": [load_certificate(path) for path in starts_from],
    }
    if runs > 1:
        if spec is None or options.pop("tensorboard") is not None:
            raise InvalidArgumentError("--runs takes no --offline and no --tensorboard")
        with cluster(backend, address), stop_on_signals() as stop, _saying_how_to_go_on(stop, out):
            learned = run_many(spec, runs, n_jobs, out, options)
        return Result(*many_results(_named(learned, against), out))
    env = None if spec is None else make(spec)
    with stop_on_signals() as stop, _saying_how_to_go_on(stop, out), progress("", 1) as line:
        result = learn_policy(env, out=out, stop=stop, on_progress=Following(line, out), **options)
        if stop():
            raise KeyboardInterrupt
    recorded = len(demonstrations) if offline and demonstrations is not None else None
    result = _named(result, against)
    return Result(as_values(result, out), in_words(result, out, recorded=recorded))


def _named(result: "_Result", rival: str | None) -> "_Result":
    """Return a result with its rival called as the user named it."""
    if result.against is None:
        return result
    return replace(result, against=replace(result.against, name=rival or ""))


def _teacher(name: str | None, steps: int | None, spec: EnvironmentSpec | None) -> "Teacher | None":
    from eutree.training import Teacher

    if name is None:
        if steps is not None:
            raise InvalidArgumentError("--teacher-steps says what --teacher cost; name the teacher")
        return None
    if spec is None:
        raise InvalidArgumentError("--teacher needs an environment to act in; leave out --offline")
    teaches = controller(name, "--teacher", spec)
    if steps is None:
        if in_zoo(name):
            steps = card(name).steps
        elif Path(name).exists():
            words = "--teacher-steps must say in how many steps the teacher was trained"
            raise InvalidArgumentError(words)
        elif trained_steps(teaches) is None:
            steps = 0  # written down, not trained
    return Teacher(teaches, steps)


@contextmanager
def _saying_how_to_go_on(stop: "StopRequest", out: Path) -> Iterator[None]:
    """End the command with the signal's exit code if one interrupts the code inside."""
    try:
        yield
    except EnvironmentFault:
        _say_how_to_go_on(out)
        raise
    except (Exception, KeyboardInterrupt) as error:
        if not (isinstance(error, KeyboardInterrupt) or stop()):  # it may end other processes first
            raise
        stop.no_more()
        if not _say_how_to_go_on(out):
            say("stopped before anything was learned")
        raise SystemExit(stop.exit_code if stop() else 128 + SIGINT) from None


def _say_how_to_go_on(out: Path) -> bool:
    """Say how a run goes on; return whether anything of it is there."""
    saved = (out / "checkpoint.npz").exists() or any((out / "runs").glob("*/config.json"))
    if saved:
        keep(out, begun=False)
    if known := saved or (out / KEPT).exists():
        done = "and saved; go on" if saved else "before anything was learned; begin again"
        say(f"stopped {done} with: {line_to_go_on(out)}")
    return known


def _check_shown(demonstrations: Demonstrations, environment: str | None) -> None:
    """Refuse an environment, and names, that are not those of the demonstrations alone."""
    shown, names = demonstrations.environment, given_names()
    if environment and not _is_same(shown, environment):
        option.refuse({"environment"}, f"the demonstrations are of {shown or 'no environment'}")
    schema = demonstrations.schema
    if names is not None and not schema.is_unnamed_form_of(names.of(schema)):
        option.refuse({"names"}, "the demonstrations have other names, or kinds, of their own")


def _is_same(spec: EnvironmentSpec | None, environment: str) -> bool:
    """Return whether an id, perhaps with its module, is that of an environment."""
    return spec is not None and spec.id.rpartition(":")[2] == environment.rpartition(":")[2]


def _spec(
    environment: str | None,
    demonstrations: Demonstrations | None,
    arguments: dict[str, Any],
    of_run: RunSettings,
) -> EnvironmentSpec:
    """Return the environment that is named, else that of the demonstrations, or of the settings.

    How the named one is observed and acted in is taken from the demonstrations of it, or else from
    the usual arguments of the settings.
    """
    usual = of_run.arguments
    chosen = chosen_by_file(arguments) | (usual.keys() - arguments.keys())
    shown = demonstrations.environment if demonstrations is not None else None
    if shown is None:
        environment = environment or of_run.task or None
    if environment is not None:
        manner = {}
        if shown is not None and _is_same(shown, environment):
            manner = {name: value for name, value in shown.arguments.items() if name in MANNER}
        return EnvironmentSpec(environment, {**usual, **manner, **arguments}, chosen)
    if shown is None:
        raise InvalidArgumentError(
            "name an environment, or with --demos demonstrations that name one; from a log alone "
            "learns --offline"
        )
    spec = shown.override(arguments)
    return replace(spec, arguments={**usual, **spec.arguments}, from_file=spec.from_file | chosen)
