"""``eutree distill``: a small tree from another policy."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli import _options as option
from eutree.cli._commands import Helped
from eutree.cli._output import Output
from eutree.cli._policies import OWN, controller, load_demonstrations, load_policy
from eutree.cli.parts import cluster, workers_options
from eutree.errors import InvalidArgumentError
from eutree.schema import EnvironmentSpec
from eutree.wording import counted

if TYPE_CHECKING:
    from eutree.distillation import DistillationReport
    from eutree.interaction.acting import Controller

EXAMPLE = "eutree distill eutree/Evasion2-v0 --expert gate --max-leaves 8 --out distilled.json"


@click.command(cls=Helped, epilog=f"Example: {EXAMPLE}")
@click.argument("environment")
@option.output("--out", text="File to write.", required=True)
@click.option(
    "--expert", help=f"The teacher: a scripted expert, for example gate, or your own, {OWN}."
)
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
@option.as_json
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
    as_json: bool,
    **settings: Any,
) -> None:
    """Make a small tree that decides in ENVIRONMENT as the teacher does."""
    from eutree.distillation import DistillationSettings
    from eutree.distillation.distill import distill as distill_teacher
    from eutree.files import check_writable

    output = Output(as_json=as_json)
    spec = EnvironmentSpec(environment, env_arguments)
    teacher = _teacher(spec, expert, policy)
    shown = None if demos is None else load_demonstrations(demos)
    check_writable(out)
    with (
        cluster(backend, address),
        output.progress("distilling", settings["iterations"]) as progress,
    ):
        tree, report = distill_teacher(
            teacher,
            spec,
            DistillationSettings(**settings),
            demonstrations=shown,
            on_round=lambda number, made: progress.update(
                number + 1, f"{counted(made.n_leaves, 'leaf')}, mean return {made.mean_return:.2f}"
            ),
            seed=seed,
            n_jobs=n_jobs,
        )
    tree.save(out)
    low, high = report.return_interval
    chosen = report.rounds[report.best]
    output.result(
        {
            "n_leaves": report.n_leaves,
            "mean_return": report.mean_return,
            "return_interval": [low, high],
            "agreement": chosen.agreement,
            "labels": report.labels,
            "environment_steps": report.environment_steps,
            "rounds": [vars(made) for made in report.rounds],
            "best": report.best,
            "path": str(out),
        },
        f"{tree}\n{_in_words(report)}; written to {out}",
    )


def _teacher(spec: EnvironmentSpec, expert: str | None, policy: Path | None) -> "Controller":
    """Return the scripted expert or the policy that was named."""
    from eutree.cli._policies import check_fits

    if expert is not None and policy is None:
        return controller(expert, "--expert", spec)
    if policy is None or expert is not None:
        raise InvalidArgumentError("choose one of --expert and --policy: who is the teacher?")
    loaded = load_policy(policy)
    check_fits(loaded, policy, spec)
    return loaded


def _in_words(report: "DistillationReport") -> str:
    chosen = report.rounds[report.best]
    low, high = report.return_interval
    return (
        f"{counted(chosen.n_leaves, 'leaf')}, tree {report.best + 1} of "
        f"{len(report.rounds)}; the teacher's action on "
        f"{chosen.agreement:.2%} of {chosen.n_transitions} observations; mean return "
        f"{chosen.mean_return:.2f} [{low:.2f}, {high:.2f}]; {report.environment_steps} "
        "environment steps in all"
    )
