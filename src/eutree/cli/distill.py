"""``eutree distill``: a small tree from another policy."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli._options import env_arg_option, json_option, seed_option
from eutree.cli._output import Output
from eutree.errors import InvalidArgumentError
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from eutree.distillation import DistillationReport
    from eutree.interaction.record import Controller

EXAMPLE = "eutree distill eutree/Evasion2-v0 --expert gate --max-leaves 8 --out distilled.json"


@click.command(epilog=f"Example: {EXAMPLE}")
@click.argument("environment")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="File to write.")
@click.option("--expert", help="The teacher: a scripted expert, for example gate.")
@click.option("--policy", type=click.Path(path_type=Path), help="The teacher: a policy file.")
@click.option("--demos", type=click.Path(path_type=Path),
              help="What the teacher showed already, in place of its first episodes.")  # fmt: skip
@click.option("--method", default="dagger", show_default=True, help="dagger, viper or cloning.")
@click.option("--learner", default="c4.5", show_default=True, help="c4.5 or cart.")
@click.option("--max-leaves", type=click.IntRange(min=1), default=32, show_default=True,
              help="Most leaves of the tree.")  # fmt: skip
@click.option("--iterations", type=click.IntRange(min=1), default=10, show_default=True,
              help="How many trees are fitted; the best is written.")  # fmt: skip
@click.option("--episodes", type=click.IntRange(min=1), default=10, show_default=True,
              help="Episodes gathered before each tree.")  # fmt: skip
@click.option("--validation-episodes", type=click.IntRange(min=2), default=50, show_default=True,
              help="Episodes that judge each tree.")  # fmt: skip
@env_arg_option
@seed_option
@json_option
def distill(
    environment: str,
    out: Path,
    expert: str | None,
    policy: Path | None,
    demos: Path | None,
    env_arguments: dict[str, Any],
    as_json: bool,
    **options: Any,
) -> None:
    """Make a small tree that decides in ENVIRONMENT as the teacher does."""
    from eutree.data import Demonstrations
    from eutree.distillation.distill import distill as distill_teacher
    from eutree.interaction.making import make

    output = Output(as_json=as_json)
    spec = EnvironmentSpec(environment, env_arguments)
    teacher = _teacher(spec, expert, policy)
    shown = None if demos is None else Demonstrations.load(demos)
    with output.progress("distilling", options["iterations"]) as progress:
        tree, report = distill_teacher(
            teacher,
            make(spec),
            demonstrations=shown,
            on_round=lambda number, made: progress.update(
                number + 1, f"{made.n_leaves} leaves, mean return {made.mean_return:.2f}"
            ),
            **options,
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
    from eutree.cli.evaluate import check_fits
    from eutree.envs.experts import experts_for
    from eutree.policies import TreePolicy
    from eutree.validation import check_choice

    if expert is not None and policy is None:
        known = experts_for(spec.id)
        return known[check_choice("--expert", expert, known)]
    if policy is None or expert is not None:
        raise InvalidArgumentError("choose one of --expert and --policy: who is the teacher?")
    loaded = TreePolicy.load(policy)
    check_fits(loaded, policy, spec)
    return loaded


def _in_words(report: "DistillationReport") -> str:
    chosen = report.rounds[report.best]
    low, high = report.return_interval
    return (
        f"{chosen.n_leaves} leaves, tree {report.best + 1} of {len(report.rounds)}; the teacher's "
        f"action on {chosen.agreement:.2%} of {chosen.n_transitions} observations; mean return "
        f"{chosen.mean_return:.2f} [{low:.2f}, {high:.2f}]; {report.environment_steps} "
        "environment steps in all"
    )
