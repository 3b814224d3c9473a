"""Trees of the decisions of others: ``eutree fit``, ``demos hurting`` and ``distill``.

Of demonstrations, played and compared with their demonstrator; or of another policy.
"""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from eutree.cli import _options as option
from eutree.cli._output import Result, figures_of, progress, said_what_is_played
from eutree.cli._policies import OWN, check_fits, controller, load_demonstrations, load_policy
from eutree.cli.parts import cluster, workers_options
from eutree.data import DemonstrationFolder
from eutree.data.episode import AGAIN, CUT
from eutree.display import counted, fixed
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.files import check_new_folder, check_writable
from eutree.fitting import FitReport
from eutree.interaction.acting import Controller
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from eutree.c45 import C45Settings
    from eutree.distillation import DistillationReport
    from eutree.fitting import Hurt

_EXAMPLE = "eutree distill eutree/Evasion2-v0 --expert gate --max-leaves 8 --out distilled.json"


@option.command("eutree fit demos/ --out expert.json")
@click.argument("demonstrations", type=click.Path(path_type=Path))
@option.output("--out", text="File to write.", required=True)
@option.count("--episodes", 200, "Fresh episodes that judge the tree; choosing takes three times "
              "as many and more. 0: play nothing.", least=0)  # fmt: skip
@option.count("--practise", 0, "Go on with so many episodes of learning; the better of both trees "
              "is kept.", least=0)  # fmt: skip
@option.count("--history", None, "Previous observations as features; by default 0, or 1 where that "
              "explains more.", least=0)  # fmt: skip
@click.option("--release-8", is_flag=True, help="C4.5 of release 8 as it is; choose nothing.")
@option.count("--min-objects", None, "C4.5's m, chosen by you: the fewest transitions on a side of "
              "a test.")  # fmt: skip
@click.option("--confidence", type=float,
              help="C4.5's CF, chosen by you: the smaller, the more is pruned.")  # fmt: skip
@click.option("--no-pruning", is_flag=True, help="Keep C4.5's unpruned tree.")
@option.monotone
@option.environment
@option.seed
def fit(
    demonstrations: Path,
    out: Path,
    release_8: bool,
    min_objects: int | None,
    confidence: float | None,
    no_pruning: bool,
    env_arguments: dict[str, Any],
    **options: Any,
) -> Result:
    """Fit a tree to DEMONSTRATIONS with C4.5, play it, and say how good it is beside them.

    Some trees are compared by episodes left out and by playing; --release-8, --min-objects,
    --confidence and --no-pruning fix how the one is made. Warnings name the faults of the result.
    """
    from eutree.fitting.fit import fit as fit_tree

    demos = load_demonstrations(demonstrations)
    check_writable(out)
    env = demos.environment.override(env_arguments) if demos.environment else None
    if env_arguments and env is None:
        named = ", ".join(env_arguments)
        raise InvalidArgumentError(f"{demonstrations} names no environment to give {named} to")
    less = "; --episodes 20 plays a tenth of the default, --episodes 0 nothing"
    plays = said_what_is_played(4 * options["episodes"], less=less)  # a race, then the verdict
    with progress("", 1) as line, plays:
        report = fit_tree(
            demos,
            env if env_arguments else None,
            settings=_settings(release_8, min_objects, confidence, no_pruning),
            derive=option.AUTO if option.AUTO in click.get_current_context().meta else (),
            on_progress=line.stage,
            **options,
        )
    if env_arguments:  # it is judged there
        report = replace(report, policy=replace(report.policy, environment=env))
    report.policy.save(out)
    hint = ""
    is_open = report.verdict and (report.verdict.is_worse or report.verdict.is_open)
    if is_open and not options["practise"]:
        hint = f"\n{option.line_with('--practise', '100')} goes on with learning"
    return Result(_values(report, out), f"{report.policy}\n{report}\nwritten to {out}{hint}")


@option.command("eutree demos hurting demos/ --out demos-cut/", helped=False)
@click.argument("folder", type=click.Path(path_type=Path))
@option.output("--out", text="A new folder, without the segments that were found.")
@option.count("--episodes", 3000, "Episodes of a search; confirming takes more.")
@click.option("--undo", is_flag=True, help="Take back all that was cut or flipped in FOLDER.")
@option.environment
@option.seed
def hurting(
    folder: Path,
    out: Path | None,
    episodes: int,
    undo: bool,
    env_arguments: dict[str, Any],
    seed: int,
) -> Result:
    """Find by playing which seconds of FOLDER cost the tree its success.

    Trees are made without a segment, or with the action before or after it in its place, and play
    the same episodes as the tree of all. The segments found are cut or flipped in --out alone;
    the actions taken stay there, each beside the action to be imitated.
    """
    from eutree.fitting import find_hurting

    opened = DemonstrationFolder(folder)
    if undo and out is not None:
        raise InvalidArgumentError(f"--undo changes {folder} itself, and takes no --out; got {out}")
    if undo:
        return _restore(opened)
    numbers, demos = list(opened.read_all()), load_demonstrations(folder)
    if out is not None:
        check_new_folder(out)
    if demos.environment is None:
        raise InvalidArgumentError(f"{folder} names no environment, so that no tree can play")
    plays = said_what_is_played(episodes, less="; --episodes 300 plays a tenth of the default")
    with progress("", 1) as line, plays:
        found = find_hurting(
            demos,
            demos.environment.override(env_arguments),
            episodes=episodes,
            seed=seed,
            on_progress=line.stage,
        )
    if out is not None:
        found.edited.save(out)
    values = {
        "hurts": [_hurt_as_values(one, numbers, demos.schema.actions) for one in found.hurts],
        "trees_tried": found.tried,
        "episodes_played": found.episodes_played,
        "path": None if out is None else str(out),
    }
    return Result(values, found.words(numbers) + ("" if out is None else f"\nwritten to {out}"))


def _restore(opened: DemonstrationFolder) -> Result:
    """Let every action of a folder be imitated as it was taken."""
    opened.recover()
    changed = []
    for number, episode in opened.read_all().items():
        taught = episode.actions.copy()
        if episode.extras.get(AGAIN):  # shown from a segment on: what led there is not taught
            taught[np.cumprod(episode.taught == CUT, dtype=bool)] = CUT
        whole = episode.teaching(taught)
        if not whole.equals(episode):
            opened.write(number, whole)
            changed.append(number)
    words = f"restored: {', '.join(map(str, changed))}" if changed else "nothing was cut or flipped"
    return Result({"restored": changed}, words)


def _hurt_as_values(one: "Hurt", numbers: list[int], actions: tuple[str, ...]) -> dict[str, Any]:
    """Return the segments found in JSON's types, steps from 0, ``to_step`` not included."""
    return {
        "what": one.what,
        "why": one.why,
        "segments": [
            {
                "episode": numbers[part.episode],
                "from_step": part.start,
                "to_step": part.stop,
                "seconds": part.seconds,
                "action": actions[part.action],
                "becomes": None if part.becomes is None else actions[part.becomes],
            }
            for part in one.segments
        ],
        "with": _reached(one.before),
        "without": one.after and _reached(one.after),
    }


def _reached(result: Evaluation) -> dict[str, Any]:
    return figures_of(result, "success_rate success_interval mean_return return_interval episodes")


def _settings(
    release_8: bool, min_objects: int | None, confidence: float | None, no_pruning: bool
) -> "C45Settings | None":
    """Return the choices of C4.5 that were made on the command line; None if none was."""
    from eutree.c45 import C45Settings

    given = {"min_objects": min_objects, "confidence": confidence}
    chosen: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if not (chosen or release_8 or no_pruning):
        return None
    if release_8 and (chosen or no_pruning):
        raise InvalidArgumentError("--release-8 leaves nothing to choose: leave out the rest")
    if no_pruning and confidence is not None:
        raise InvalidArgumentError("--confidence says how to prune; leave it out, or --no-pruning")
    return C45Settings(**chosen, prune=not no_pruning)


def _values(report: FitReport, out: Path) -> dict[str, Any]:
    person, played, found = report.person, report.played, report.verdict
    return {
        "n_leaves": report.policy.n_leaves,
        **figures_of(report, "n_transitions training_accuracy choice episodes_played"),
        "path": str(out),
        "person": {
            "interval": person.success_interval,
            **figures_of(person, "success_rate mean_return return_interval episodes"),
        },
        "played": played
        and {
            "interval": played.success_interval,
            **figures_of(played, "success_rate mean_return return_interval worst_return"),
            **figures_of(played, "return_quantile_05 episodes"),
        },
        "verdict": found and found.word,
        "difference": found
        and {"of": found.measure, "mean": found.difference, "interval": found.interval},
        "candidates": report.n_candidates,
        "proposals": [asdict(one) for one in report.proposals],
        "warnings": list(report.warnings),
    }


@option.command(_EXAMPLE)
@click.argument("environment")
@option.output("--out", text="File to write.", required=True)
@click.option("--expert", help="The teacher: a scripted expert, for example gate, or your own, "
              f"{OWN}.")  # fmt: skip
@option.path("--policy", text="The teacher: a policy file.")
@option.path("--demos", text="What the teacher showed already, in place of its first episodes.")
@click.option("--method", default="dagger", show_default=True, help="dagger, viper or cloning.")
@click.option("--learner", default="c4.5", show_default=True, help="c4.5 or cart.")
@option.count("--max-leaves", 32, "Most leaves of the tree.")
@option.count("--iterations", 10, "How many trees are fitted; the best is written.")
@option.count("--episodes", 10, "Episodes gathered before each tree.")
@option.count("--validation-episodes", 50, "Episodes that judge each tree.", least=2)
@workers_options("the episodes of the trees, where they take more than a few seconds")
@option.environment
@option.seed
def distill(
    environment: str,
    out: Path,
    expert: str | None,
    policy: Path | None,
    demos: Path | None,
    backend: str,
    address: str | None,
    env_arguments: dict[str, Any],
    seed: int,
    n_jobs: int | None,
    **settings: Any,
) -> Result:
    """Make a small tree that decides in ENVIRONMENT as the teacher does."""
    from eutree.distillation import DistillationSettings
    from eutree.distillation import distill as distill_teacher

    spec = EnvironmentSpec(environment, env_arguments)
    teacher = _teacher(spec, expert, policy)
    known = teacher if isinstance(teacher, TreePolicy) else None
    shown = None if demos is None else load_demonstrations(demos, known)
    check_writable(out)
    if settings["method"] == "cloning":
        option.refuse({"iterations"}, "cloning fits one tree")
    chosen = DistillationSettings(**settings)
    with cluster(backend, address), progress("distilling", chosen.rounds) as line:
        tree, report = distill_teacher(
            teacher,
            spec,
            chosen,
            demonstrations=shown,
            on_round=lambda number, made: line.update(
                number + 1,
                f"{counted(made.n_leaves, 'leaf')}, mean return "
                f"{made.mean_return:{fixed(2, [made.mean_return])}}",
            ),
            seed=seed,
            n_jobs=n_jobs,
        )
    tree.save(out)
    return Result(
        {
            **figures_of(report, "n_leaves mean_return return_interval labels best weighted"),
            "agreement": report.rounds[report.best].agreement,
            "environment_steps": report.environment_steps,
            "rounds": [vars(made) for made in report.rounds],
            "path": str(out),
        },
        f"{tree}\n{_distilled_in_words(report)}; written to {out}",
    )


def _teacher(spec: EnvironmentSpec, expert: str | None, policy: Path | None) -> Controller:
    if expert is not None and policy is None:
        return controller(expert, "--expert", spec)
    if policy is None or expert is not None:
        raise InvalidArgumentError("choose one of --expert and --policy: who is the teacher?")
    loaded = load_policy(policy)
    check_fits(loaded, policy, spec)
    return loaded


def _distilled_in_words(report: "DistillationReport") -> str:
    chosen, plain = report.rounds[report.best], report.method == "viper" and not report.weighted
    return (
        f"{counted(chosen.n_leaves, 'leaf')}, tree {report.best + 1} of "
        f"{len(report.rounds)}; the teacher's action on "
        f"{chosen.agreement:.2%} of {chosen.n_transitions} observations; mean return "
        f"{report.return_interval.around(chosen.mean_return, 2)}; {report.environment_steps} "
        f"environment steps in all{'; the teacher has no action values to weigh by' * plain}"
    )
