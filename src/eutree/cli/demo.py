"""``eutree demo``: the whole main job in about a minute."""

from pathlib import Path
from typing import Any

import click

from eutree.cli._options import count_option, env_arg_option, json_option, seed_option
from eutree.cli._output import Output
from eutree.schema import EnvironmentSpec


@click.command(epilog="Example: eutree demo CartPole-v1 --expert fall")
@click.argument("environment", default="eutree/Evasion2-v0")
@click.option("--expert", help="A scripted demonstrator of the environment; by default its first.")
@click.option("--out", type=click.Path(path_type=Path), default="demo-report", show_default=True,
              help="Folder to write.")  # fmt: skip
@count_option("--episodes", 200, "Episodes of each learning run.")
@count_option("--runs", 3, "Learning runs of each learner.", least=2)
@env_arg_option
@seed_option
@json_option
def demo(
    environment: str,
    expert: str | None,
    out: Path,
    episodes: int,
    runs: int,
    env_arguments: dict[str, Any],
    seed: int,
    as_json: bool,
) -> None:
    """Show, learn, evaluate, compress and export in ENVIRONMENT; write an HTML report."""
    from rich.table import Table

    from eutree.experiments.demo import DemoSettings, run_demo, table_rows
    from eutree.training import Run

    output = Output(as_json=as_json)
    settings = DemoSettings(
        environment=EnvironmentSpec(environment, env_arguments),
        expert=expert,
        episodes=episodes,
        runs=runs,
        seed=seed,
    )
    with output.progress("learning", 2 * runs * episodes) as progress:
        gathered: dict[str, int] = {}

        def follow(label: str, run: Run) -> None:
            gathered[label] = run.episode
            progress.update(sum(gathered.values()), f"{label}: {run.curve[-1].describe()}")

        result = run_demo(settings, out, say=output.say, follow=follow)
    header, rows = table_rows(result.policies, result.evaluations)
    table = Table(*header)
    for row in rows:
        table.add_row(*row)
    output.result(
        {
            "report": str(result.report),
            "policies": [dict(zip(header, row, strict=True)) for row in rows],
        },
        table,
    )
    output.say(f"report: {result.report}")
