"""``eutree reproduce``: the paper's figures and tables, with our numbers beside."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from eutree.cli.parts import (
    Output,
    ProgressLine,
    cluster,
    count_option,
    json_option,
    output_option,
    seed_option,
    workers_options,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from eutree_lab.framework.runs import FrameworkSpec
    from eutree_lab.paper.runs import RunSpec

SEARCH = "search"
SEARCH_TITLE = "The domain and the reading in which the paper's numbers come out"


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
@click.option("--demos", type=click.Path(path_type=Path, exists=True), multiple=True,
              help="Folder of a person's demonstrations, for search. May be repeated.")  # fmt: skip
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
    demos: tuple[Path, ...],
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

    The experiment "search" looks for the domain and the reading of what the paper leaves open in
    which its numbers come out, on seeds of its own.
    """
    from dataclasses import asdict, replace

    from rich.table import Column, Table

    from eutree.learners import PRESETS
    from eutree.validation import check_choice
    from eutree_lab.framework.runs import SMOKE_RUNS, TAUGHT, specs
    from eutree_lab.paper.experiment import FULL, SMOKE
    from eutree_lab.paper.registry import EXPERIMENTS, FRAMEWORK, FRAMEWORK_TITLE, chosen
    from eutree_lab.paper.reproduce import number_text
    from eutree_lab.paper.reproduce import reproduce as reproduce_experiments

    output = Output(as_json=as_json)
    if listing or experiment is None:
        titles = {name: e.title for name, e in EXPERIMENTS.items()}
        titles |= {FRAMEWORK: FRAMEWORK_TITLE, SEARCH: SEARCH_TITLE}
        output.result(titles, "\n".join(f"{name}  {title}" for name, title in titles.items()))
        return
    if experiment == SEARCH:
        _search(output, out, demos, smoke=smoke, n_jobs=n_jobs, backend=backend, address=address)
        return
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
    """Return what is to be called after each run."""

    def show(count: int, total: int, spec: "FrameworkSpec | RunSpec") -> None:
        progress.update(100 * count // total, f"{count} of {total}: {spec.name}")

    return show


def _framework(output: Output, wanted: "list[FrameworkSpec]", out: Path, n_jobs: int) -> None:
    """Run every method from every start, and say what teaching is worth to each."""
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


def _search(
    output: Output,
    out: Path,
    demos: tuple[Path, ...],
    *,
    smoke: bool,
    n_jobs: int,
    backend: str,
    address: str | None,
) -> None:
    """Search, write the tables, and show the nearest settings."""
    from rich.table import Table

    from eutree_lab.paper.search import Search
    from eutree_lab.paper.search_plan import PLAN, SMOKE_PLAN
    from eutree_lab.paper.search_space import choices_of
    from eutree_lab.paper.search_table import SHOWN, write_tables

    with cluster(backend, address), output.progress("runs", 100) as progress:

        def show(stage: str, count: int, total: int) -> None:
            progress.update(100 * count // total, f"{stage}: {count} of {total}")

        plan = SMOKE_PLAN if smoke else PLAN
        search = Search(out, plan=plan, demonstrations=demos, n_jobs=n_jobs, on_run=show)
        scored = search.run()
    write_tables(out, scored, smoke=smoke)
    table = Table("setting", "stage", "final policy", "numbers that agree", "mean cost")
    for index, one in enumerate(scored[:SHOWN], start=1):
        agreeing = f"{one.distance.n_agreeing} of {len(one.distance.costs)}"
        table.add_row(str(index), one.stage, one.final, agreeing, f"{one.distance.mean:.3f}")
    found = [
        {
            "choices": choices_of(one.setting),
            "stage": one.stage,
            "final": one.final,
            "mean_cost": one.distance.mean,
            "numbers": dict(one.distance.ours),
        }
        for one in scored
    ]
    output.result({"smoke": smoke, "settings": found, "path": str(out)}, table)
    _say_smoke(output, smoke=smoke)
    output.say(f"{len(scored)} settings: {out / 'search.md'}")
