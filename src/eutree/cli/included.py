"""The commands on things in the package: ``eutree demo``, ``zoo`` and ``warm-up``."""

import io
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli import _options as option
from eutree.cli._output import Result, progress, runs_as_values, say
from eutree.errors import EutreeError
from eutree.evaluation import Interval
from eutree.parallel import Workers
from eutree.schema import EnvironmentSpec
from eutree.zoo import PREFIX, Card, card, cards

if TYPE_CHECKING:
    from rich.console import Group

    from eutree.demo.page import DemoResult

HEAD = "name                    leaves  return [95 %]              worst    steps  proven"


@option.command("eutree demo CartPole-v1 --expert fall")
@click.argument("environment", default="eutree/Evasion2-v0")
@click.option("--expert", help="A scripted demonstrator of the environment; by default its first.")
@option.output("--out", text="Folder to write.", default="demo-report")
@option.count("--episodes", None, "Episodes of each learning run, instead of the demo's own "
              "budget.")  # fmt: skip
@option.count("--runs", 3, "Learning runs; the best is chosen.")
@click.option("--n-jobs", type=int, default=-1, show_default=True,
              help="Processes for the runs; -1 for all cores.")  # fmt: skip
@option.environment
@option.seed
def demo(
    environment: str, out: Path, episodes: int | None, env_arguments: dict[str, Any], **choices: Any
) -> Result:
    """Show, fit, learn, judge, compress and export in ENVIRONMENT; write an HTML report.

    ENVIRONMENT is one that has a scripted demonstrator; your own is shown with eutree record.
    In Evasion the opponents run faster once the demonstrations are over, and learning has to mend
    the tree; elsewhere the demonstrator is a mediocre script.
    """
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    from eutree.demo import run_demo, settings_for, table_rows
    from eutree.training.many import FinishedRun

    settings = settings_for(EnvironmentSpec(environment, env_arguments), **choices)
    if episodes is not None:
        story = settings.story
        learning = dict(story.learning) | {"episodes": episodes}
        settings = replace(settings, story=replace(story, learning=learning))
    with progress("runs", settings.runs) as line:

        def follow(count: int, run: FinishedRun) -> None:
            line.update(count, f"run {run.seed}: {run.selection}")

        result = run_demo(settings, out, say=say, follow=follow)
    header, rows = table_rows(result)
    return Result(
        {
            "report": str(result.report),
            "verdict": result.verdict,
            "policies": [dict(zip(header, row, strict=True)) for row in rows],
            "against_start": result.judgement.facts(),
            "changed_steps": result.changes.visited,
            "runs": runs_as_values(result.runs, "mean_return success_rate"),
        },
        _story(result),
    )


def _story(result: "DemoResult") -> "Group":
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


@option.command("eutree zoo MountainCar-v0", helped=False)
@click.argument("task", required=False)
def zoo(task: str | None) -> Result:
    """List the learned trees that come with the package, or those of TASK, or the one of TASK:N.

    Each NAME can stand, as zoo:NAME, wherever a command takes a policy file; zoo:TASK is the
    smallest tree as good as the best.
    """
    name = (task or "").removeprefix(PREFIX)
    named = card(name) if task is not None else None
    shown = [one for one in cards() if named is None or one == named or one.task == name]
    return Result(
        {"trees": [{"name": one.name} | asdict(one) for one in shown]},
        "\n".join([HEAD, *(line for one in shown for line in _lines(one, full=task is not None))]),
    )


def _lines(one: Card, *, full: bool) -> Iterator[str]:
    """Yield a tree's row and, in full, its proven properties and the sources that learned it."""
    returns = Interval(*one.interval).around(one.mean_return, 1)
    proven = "yes" if one.proven else ""
    yield (
        f"{one.name:<22}  {one.leaves:>6}  {returns:<24}  {one.worst:>6.1f}  {one.steps:>7,}"
        f"  {proven}"
    ).rstrip()
    if not full:
        return
    if one.proven:
        yield f"  proven: {one.proven}"
    if one.extra:
        yield f"  its task needs {one.extra}: pip install 'eutree[envs]'"
    if one.module:
        yield f"  its task is an example of the repository: --import {one.module}"
    yield f"  learned by: {one.command} ({one.commit}, {one.date})"


_TASK = "eutree/Evasion2-v0"
_SHORT = ("--episodes", "40", "--evaluate-every", "40", "--evaluation-episodes", "4")
_NETWORKS = (
    "--method", "distilled-dqn", "--steps", "3000", "--evaluate-every", "1000",
    "--evaluation-episodes", "4", "--set", "teacher.updates_per_step=0.01",
    "--set", "demonstration_updates=1", "--set", "world_model.updates=1",
    "--set", "world_model.more_updates=1",
)  # fmt: skip
# The jobs that compile it: by name, a command to which demonstrations are added; longest first.
JOBS = {
    "planning": ("learn", _TASK, *_SHORT),
    "fitting": ("fit", "--episodes", "20"),
    "networks": ("learn", _TASK, *_NETWORKS),
    "u-tree": ("learn", _TASK, "--method", "corrected", *_SHORT),
    "paper": ("learn", _TASK, "--method", "paper", *_SHORT),
}


@option.command("eutree warm-up", helped=False, name="warm-up")
@option.count("--n-jobs", 2, "Processes that compile at the same time.")
def warm_up(n_jobs: int) -> Result:
    """Compile the loops of fitting, planning and learning for this computer.

    The compiled loops are kept beside the package, or in the folder NUMBA_CACHE_DIR.
    """
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        record = ("record", _TASK, "--expert", "gate", "--episodes", "5")
        _compiled_by(record, Path(folder) / "demos")
        with progress("compiling", len(JOBS)) as line:
            task = partial(_compiled, Path(folder))
            for count, name in enumerate(Workers(n_jobs).as_finished(task, list(JOBS)), 1):
                line.update(count, name)
    seconds = time.monotonic() - begin
    return Result({"seconds": seconds, "parts": list(JOBS)}, f"compiled in {seconds:.0f} s")


def _compiled(folder: Path, name: str) -> str:
    """Run one of the commands, in whichever process this is; return its name."""
    verb, *rest = JOBS[name]
    demos = str(folder / "demos")
    given = [demos] if verb == "fit" else ["--demos", demos]
    _compiled_by((verb, *rest, *given), folder / f"{name}.json")
    return name


def _compiled_by(command: tuple[str, ...], out: Path) -> None:
    """Run a command whose kernels are compiled at their first call."""
    from eutree import compiled
    from eutree.cli.main import run

    said, before = io.StringIO(), compiled.AT_ONCE
    compiled.AT_ONCE = True
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(said):
            code = run([*command, "--out", str(out)])
    finally:
        compiled.AT_ONCE = before
    if code:
        lines = said.getvalue().strip().splitlines() or [f"exit code {code}"]
        raise EutreeError(f"{command[0]} could not be compiled: {lines[-1]}")
