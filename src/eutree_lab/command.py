"""``eutree reproduce``: the paper's figures beside ours; ``eutree study``: a study with people."""

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli.parts import (
    Output,
    ProgressLine,
    cluster,
    count_option,
    env_arg_option,
    import_option,
    json_option,
    output_option,
    refuse,
    seed_option,
    workers_options,
)
from eutree.cli.record import make_seen, page_options, record_on_page

_LINE = "eutree_lab.line"  # in click's context

if TYPE_CHECKING:
    from collections.abc import Callable

    from eutree_lab.framework.runs import FrameworkSpec
    from eutree_lab.paper.runs import RunSpec


@click.command(
    short_help="Reproduce the paper's figures and tables.",
    epilog="Example: eutree reproduce figure-2 --n-jobs 2",
)
@click.argument("experiment", required=False)
@click.option("--list", "listing", is_flag=True, help="List the experiments.")
@output_option(
    "--out", text="Folder of results; finished runs are never done again.", default="results"
)
@click.option("--preset", "presets", multiple=True, default=("paper", "default"),
              show_default=True, help="Settings to compare. May be repeated.")  # fmt: skip
@click.option("--method", "methods", multiple=True,
              help="Methods of the framework; all by default. May be repeated.")  # fmt: skip
@click.option("--domain", type=click.Choice(["PaperEvasion", "Evasion"]), default="PaperEvasion",
              show_default=True, help="Constants of the domain.")  # fmt: skip
@count_option("--runs", 15, "Runs of each learner.", least=2)
@count_option("--episodes", 400, "Episodes of each run.")
@click.option("--smoke", is_flag=True, help="A few tiny runs, to see that everything works.")
@workers_options("the runs")
@seed_option
@json_option
def reproduce(
    experiment: str | None,
    listing: bool,
    out: Path,
    presets: tuple[str, ...],
    methods: tuple[str, ...],
    domain: str,
    runs: int,
    episodes: int,
    smoke: bool,
    n_jobs: int,
    backend: str,
    address: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Reproduce EXPERIMENT, or all of the paper's, and say which of its claims hold.

    The experiment "framework" is ours: every method from every start, on three tasks. It has no
    presets, and episodes of its own.
    """
    from dataclasses import asdict, replace

    from rich.table import Column, Table

    from eutree.learners import PRESETS
    from eutree.validation import check_choice
    from eutree_lab.framework.runs import SMOKE_RUNS, TAUGHT, specs
    from eutree_lab.paper.experiment import FULL, SMOKE
    from eutree_lab.paper.reproduce import (
        EXPERIMENTS,
        FRAMEWORK,
        FRAMEWORK_TITLE,
        chosen,
        number_text,
    )
    from eutree_lab.paper.reproduce import reproduce as reproduce_experiments

    output = Output(as_json=as_json)
    if listing or experiment is None:
        titles = {name: e.title for name, e in EXPERIMENTS.items()}
        titles |= {FRAMEWORK: FRAMEWORK_TITLE}
        output.result(titles, "\n".join(f"{name}  {title}" for name, title in titles.items()))
        return
    check_choice("experiment", experiment, [*EXPERIMENTS, "all", FRAMEWORK])
    unused = ("presets", "domain", "episodes") if experiment == FRAMEWORK else ("methods",)
    refuse(unused, f"{experiment} has no use for it")
    if smoke:
        refuse(("runs", "episodes"), "--smoke has as many as it needs")
    if experiment == FRAMEWORK:
        runs = SMOKE_RUNS if smoke else runs
        wanted = specs(runs=runs, methods=methods or TAUGHT, first_seed=seed, smoke=smoke)
        with cluster(backend, address):
            _framework(output, wanted, out, n_jobs)
        return
    for preset in presets:
        check_choice("--preset", preset, PRESETS)
    selected = chosen(experiment)
    scale = SMOKE if smoke else replace(FULL, runs=runs, episodes=episodes)
    scale = replace(scale, first_seed=seed, domain=domain)
    with cluster(backend, address), output.progress("runs", 100) as progress:
        result = reproduce_experiments(
            selected, out, scale=scale, presets=presets, n_jobs=n_jobs, on_run=_shown_on(progress)
        )
    table = Table(Column("claim", no_wrap=True), "preset", "paper", "ours [95 %]", "verdict")
    for claim in result.claims:
        table.add_row(claim.id, claim.preset, claim.paper, number_text(claim), claim.holds)
    claims = [asdict(claim) for claim in result.claims]
    output.result({"smoke": smoke, "claims": claims, "path": str(result.folder)}, table)
    _say_smoke(output, smoke=smoke)
    output.say(f"report: {result.folder / 'report.html'}")


def _say_smoke(output: Output, *, smoke: bool) -> None:
    """Say that the verdicts above are of a smoke run, if they are."""
    from eutree_lab.paper.claims import SMOKE_RUN

    if smoke:
        output.say(SMOKE_RUN)


def _shown_on(progress: ProgressLine) -> "Callable[[int, int, FrameworkSpec | RunSpec], None]":
    """Return the function to be called after each run."""

    def show(count: int, total: int, spec: "FrameworkSpec | RunSpec") -> None:
        progress.update(100 * count // total, f"{count} of {total}: {spec.name}")

    return show


def _framework(output: Output, wanted: "list[FrameworkSpec]", out: Path, n_jobs: int) -> None:
    """Run every method from every start, and print the worth of teaching to each."""
    from rich.table import Column, Table

    from eutree_lab.framework.report import reproduce_framework, verdicts_to_facts
    from eutree_lab.framework.runs import is_smoke

    with output.progress("runs", 100) as progress:
        result = reproduce_framework(wanted, out, n_jobs=n_jobs, on_run=_shown_on(progress))
    table = Table(Column("method", no_wrap=True), "sentence", "ours [95 %]", "verdict", "expected")
    for verdict in result.verdicts:
        said = verdict.expectation
        table.add_row(
            said.method, said.sentence, verdict.number, verdict.holds, verdict.as_expected
        )
    smoke = is_smoke(wanted)
    facts = {"smoke": smoke, "verdicts": verdicts_to_facts(result.verdicts)}
    output.result(facts | {"path": str(result.folder)}, table)
    _say_smoke(output, smoke=smoke)
    output.say(f"tables: {result.folder / 'framework.md'}")


@click.group(epilog="Example: eutree study lead people/ eutree/Evasion2-v0")
def study() -> None:
    """A study with people: lead each one through it, and make the table of all."""


class _KeepsItsLine(click.Command):
    """A command that knows the words it was called with."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments."""
        ctx.meta[_LINE] = [*args]
        return super().parse_args(ctx, args)


@study.command(cls=_KeepsItsLine, epilog="Example: eutree study lead people/ eutree/Evasion2-v0")
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("environment")
@click.option("--person", metavar="CODE", help="Go on with this person.")
@page_options
@env_arg_option
@json_option
def lead(
    folder: Path,
    environment: str,
    person: str | None,
    keys: str | None,
    hud: bool,
    fps: float | None,
    env_arguments: dict[str, Any],
    as_json: bool,
    **page: Any,
) -> None:
    """Lead one person through the study in FOLDER, and pack the results.

    Its plan, study.toml, and the text that people agree to, consent.md, are written where they are
    missing: change them before the first person.
    """
    from eutree.recording import SessionSettings
    from eutree.schema import EnvironmentSpec
    from eutree_lab.study.lead import conduct

    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    output, spec = Output(as_json=as_json), EnvironmentSpec(environment, env_arguments)
    env, pace = make_seen(spec), SessionSettings(fps=fps, hud=hud)
    with conduct(folder, spec, env, person=person, keys=keys, pace=pace) as (recorder, tree, guide):
        code = recorder.folder.path.parent.name
        line = list(click.get_current_context().meta.get(_LINE, (str(folder), environment)))
        if person is None:
            place = line.index(environment) + 1
            line[place:place] = ["--person", code]
        again = shlex.join(["eutree", "study", "lead", *line])
        output.say(f"person {code}; if this stops: {again}")
        record_on_page(output, recorder, spec, recorder.folder.path, lead=(tree, guide), **page)
    packed = folder / f"{code}.zip"
    said = f"all of it is in {packed}" if guide.is_finished else (
        "nothing is kept" if guide.is_withdrawn else f"not finished; go on with --person {code}"
    )  # fmt: skip
    facts = {"person": code, "path": str(packed) if guide.is_finished else None}
    output.result(facts, f"person {code}: {said}")


@study.command(epilog="Example: eutree study table people/ --csv people.csv")
@click.argument("folder", type=click.Path(path_type=Path))
@count_option("--episodes", 500, "How many further episodes each tree plays.")
@output_option("--csv", "out", text="File to write: one row for each person.")
@import_option
@json_option
def table(folder: Path, episodes: int, out: Path | None, as_json: bool) -> None:
    """Print the results of the people of a study, and of their trees."""
    from eutree.files import write_text
    from eutree_lab.study.table import study_table

    found = study_table(folder, episodes=episodes)
    if out is not None:
        write_text(out, found.to_csv())
    facts = {"people": list(found.rows), "means": found.means(), "questions": found.questions}
    Output(as_json=as_json).result(facts, str(found))
