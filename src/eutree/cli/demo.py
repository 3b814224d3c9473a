"""``eutree demo``: the whole main job in about a minute."""

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli._options import (
    count_option,
    env_arg_option,
    json_option,
    output_option,
    seed_option,
)
from eutree.cli._output import Output
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from rich.console import Group

    from eutree.demo.page import DemoResult


@click.command(epilog="Example: eutree demo CartPole-v1 --expert fall")
@click.argument("environment", default="eutree/Evasion2-v0")
@click.option("--expert", help="A scripted demonstrator of the environment; by default its first.")
@output_option("--out", text="Folder to write.", default="demo-report")
@count_option(
    "--episodes", None, "Episodes of each learning run, instead of the demo's own budget."
)
@count_option("--runs", 3, "Learning runs; the best is chosen.")
@click.option("--n-jobs", type=int, default=-1, show_default=True,
              help="Processes for the runs; -1 for all cores.")  # fmt: skip
@env_arg_option
@seed_option
@json_option
def demo(
    environment: str,
    expert: str | None,
    out: Path,
    episodes: int | None,
    runs: int,
    n_jobs: int,
    env_arguments: dict[str, Any],
    seed: int,
    as_json: bool,
) -> None:
    """Show, fit, learn, judge, compress and export in ENVIRONMENT; write an HTML report.

    ENVIRONMENT is one that has a scripted demonstrator; your own is shown with eutree record.
    In Evasion the opponents run faster once the demonstrations are over, and learning has to mend
    the tree; elsewhere the demonstrator is a mediocre script.
    """
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    from eutree.demo import run_demo, settings_for, table_rows
    from eutree.training.many import FinishedRun

    output = Output(as_json=as_json)
    settings = settings_for(
        EnvironmentSpec(environment, env_arguments),
        expert=expert,
        runs=runs,
        n_jobs=n_jobs,
        seed=seed,
    )
    if episodes is not None:
        story = settings.story
        learning = dict(story.learning) | {"episodes": episodes}
        settings = replace(settings, story=replace(story, learning=learning))
    with output.progress("runs", runs) as progress:

        def follow(count: int, run: FinishedRun) -> None:
            progress.update(count, f"run {run.seed}: {run.selection}")

        result = run_demo(settings, out, say=output.say, follow=follow)
    header, rows = table_rows(result)
    output.result(
        {
            "report": str(result.report),
            "verdict": result.verdict,
            "policies": [dict(zip(header, row, strict=True)) for row in rows],
            "against_start": result.judgement.facts(),
            "changed_steps": result.changes.visited,
            "runs": [
                {
                    "seed": run.seed,
                    "path": str(run.path),
                    "n_leaves": run.n_leaves,
                    "environment_steps": run.environment_steps,
                    "mean_return": run.selection.mean_return,
                    "success_rate": run.selection.success_rate,
                    "winner": number == result.runs.winner,
                }
                for number, run in enumerate(result.runs.runs)
            ],
        },
        _story(result),
    )


def _story(result: "DemoResult") -> "Group":
    """Return the whole story on one screen."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    from eutree.demo import table_rows

    header, rows = table_rows(result)
    table = Table(*header)
    for row in rows:
        table.add_row(*row)
    changes = [
        f"  {box.visited:.0%} of the steps: {box.words}"
        for box in result.changes.boxes[:3]
        if box.visited
    ]
    lines = [
        "",
        *(["What learning changed:", *changes] if changes else []),
        f"{result.report.parent / 'small.c'}: the {result.small.n_leaves} leaves as a C function",
        f"open {result.report} in a browser: watch it decide, see what changed",
    ]
    return Group(Text(result.verdict, style="bold"), table, Text("\n".join(lines)))
