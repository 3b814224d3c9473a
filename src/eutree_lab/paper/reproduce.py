"""Reproduce results of the paper: do the missing runs, judge the claims, draw, report.

A folder of results holds

    runs/             one document a run; finished runs are never done again
    claims.json       every claim with the paper's number, ours, its interval and the verdict
    claims.md         the same as a table
    points.csv        every evaluation of every run
    figure-*.svg/png  the figures
    report.html       all of it on one page
"""

import base64
import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from html import escape
from pathlib import Path

from eutree.display import counted
from eutree.files import write_bytes, write_text
from eutree.report.html import asset, head, page
from eutree.validation import check_choice
from eutree_lab.paper.claims import FAILS, HOLDS, OPEN, SMOKE_RUN, Claim
from eutree_lab.paper.drawing import drawn, side_by_side
from eutree_lab.paper.experiment import Experiment, ExperimentScale, Records
from eutree_lab.paper.expert_and_compression import COMPRESSION, EXPERT
from eutree_lab.paper.figure_2_3 import FIGURE_2, FIGURE_3
from eutree_lab.paper.figure_4_5 import FIGURE_4A, FIGURE_4B, FIGURE_5
from eutree_lab.paper.results import Results
from eutree_lab.paper.runs import RunSpec
from eutree_lab.paper.table_2 import TABLE_2

PRESETS = ("paper", "default")
_EACH = (FIGURE_2, FIGURE_3, TABLE_2, FIGURE_4A, FIGURE_4B, FIGURE_5, EXPERT, COMPRESSION)
EXPERIMENTS = {experiment.id: experiment for experiment in _EACH}

FRAMEWORK = "framework"  # runs methods from starts, not learners under presets
FRAMEWORK_TITLE = "The framework: every method, every start"


@dataclass(frozen=True, eq=False)
class Reproduction:
    """Results of a reproduction.

    Attributes:
        claims: All claims, those of one experiment together.
        folder: Where everything was written.
    """

    claims: tuple[Claim, ...]
    folder: Path


def chosen(name: str) -> list[Experiment]:
    """Return the experiment of that name, or every one of the paper's for ``"all"``."""
    check_choice("experiment", name, [*EXPERIMENTS, "all"])
    return list(EXPERIMENTS.values()) if name == "all" else [EXPERIMENTS[name]]


def reproduce(
    experiments: Sequence[Experiment],
    folder: str | Path,
    *,
    scale: ExperimentScale,
    presets: Sequence[str] = PRESETS,
    n_jobs: int | None = None,
    on_run: Callable[[int, int, RunSpec], None] = lambda count, total, spec: None,
) -> Reproduction:
    """Run, judge, draw and report some experiments.

    Args:
        experiments: Figures and tables to reproduce.
        folder: Results; runs that are already there are not done again.
        scale: How much.
        presets: Settings of the learners, side by side.
        n_jobs: Processes.
        on_run: Called after each run with how many are done, how many there are, and the run.
    """
    results = Results(folder)
    needed = {(e.id, p): e.specs(scale, p) for e in experiments for p in presets}
    wanted = list(dict.fromkeys(spec for specs in needed.values() for spec in specs))
    results.complete(
        wanted, n_jobs=n_jobs, on_run=lambda count, spec: on_run(count, len(wanted), spec)
    )
    records = {key: results.load(specs) for key, specs in needed.items()}
    claims = tuple(
        replace(claim, preset=preset)
        for experiment in experiments
        for preset in _distinct(needed, experiment, presets)
        for claim in experiment.judge(records[experiment.id, preset])
    )
    figures = {}
    for experiment in experiments:
        if experiment.draw is not None:
            shown: dict[str, Records] = {
                p: records[experiment.id, p] for p in _distinct(needed, experiment, presets)
            }
            figures[experiment.id] = _draw(experiment, shown, results.folder)
    write_text(results.folder / "claims.json", claims_to_json(claims, smoke=scale.smoke))
    write_text(results.folder / "claims.md", claims_to_markdown(claims, smoke=scale.smoke))
    write_text(results.folder / "points.csv", _points(records))
    said = [SMOKE_RUN] * scale.smoke
    write_text(results.folder / "report.html", _page(experiments, claims, figures, said))
    return Reproduction(claims, results.folder)


def claims_to_json(claims: Sequence[Claim], *, smoke: bool = False) -> str:
    """Return the claims as JSON text, and whether they are of a smoke run."""
    found = {"smoke": smoke, "claims": [asdict(claim) for claim in claims]}
    return json.dumps(found, indent=1) + "\n"


def claims_to_markdown(claims: Sequence[Claim], *, smoke: bool = False) -> str:
    """Return the claims as a table of Markdown, the presets of a claim one below the other.

    Above it stands whether they are of a smoke run.
    """
    lines = [f"**{SMOKE_RUN}**\n"] * smoke + [
        "| claim | the paper says | paper | preset | ours [95 % interval] | verdict | rule |",
        "|---|---|---|---|---|---|---|",
    ]
    for claim in claims:
        cells = (
            f"`{claim.id}`",
            claim.sentence,
            claim.paper,
            claim.preset,
            number_text(claim),
            f"**{claim.holds}**",
            claim.rule,
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def number_text(claim: Claim) -> str:
    """Return our number with its interval."""
    low, high = claim.interval
    return f"{claim.ours:.3g} [{low:.3g}, {high:.3g}]"


def _distinct(
    needed: dict[tuple[str, str], list[RunSpec]], experiment: Experiment, presets: Sequence[str]
) -> list[str]:
    """Return the presets under which the experiment runs something different."""
    seen: list[list[RunSpec]] = []
    distinct = []
    for preset in presets:
        specs = needed[experiment.id, preset]
        if specs not in seen:
            seen.append(specs)
            distinct.append(preset)
    return distinct


def _draw(experiment: Experiment, records: dict[str, Records], folder: Path) -> str:
    """Write the figure as SVG and PNG; return the SVG."""
    draw = experiment.draw
    if draw is None:
        raise TypeError(f"{experiment.id} has no figure")
    svg, png = drawn(
        experiment.id, lambda: side_by_side(experiment.title, records, draw), "svg", "png"
    )
    write_bytes(folder / f"{experiment.id}.svg", svg)
    write_bytes(folder / f"{experiment.id}.png", png)
    return svg.decode()


def _points(records: Mapping[tuple[str, str], Records]) -> str:
    """Return every evaluation of every run as CSV text."""
    lines = [
        "environment,learner,preset,opponent_speed,seed,episode,success,mean_return,n_leaves,kind"
    ]
    seen = set()
    for group in records.values():
        for record in group:
            spec = record.spec
            if spec.name in seen:
                continue
            seen.add(spec.name)
            key = (spec.environment, spec.learner, spec.preset, spec.opponent_speed, spec.seed)
            rows = [
                (p.episode, p.success, p.mean_return, p.n_leaves, "frozen") for p in record.curve
            ]
            finals = {"final": record.final, "compressed": record.compressed}
            if record.expert is not None:
                finals["expert"] = record.expert
            rows += [
                (spec.episodes, p.success, p.mean_return, p.n_leaves, kind)
                for kind, p in finals.items()
                if p is not None
            ]
            lines += [",".join(map(str, (*key, *row))) for row in rows]
    return "\n".join(lines) + "\n"


def _page(
    experiments: Sequence[Experiment],
    claims: Sequence[Claim],
    figures: dict[str, str],
    warnings: Sequence[str],
) -> str:
    """Return everything on one self-contained page, which begins with the warnings."""
    sections = []
    for experiment in experiments:
        mine = [c for c in claims if c.id.split("/")[0] == experiment.id]
        title = escape(experiment.title)
        drawn = _figure(figures[experiment.id], title) if experiment.id in figures else ""
        sections.append(f"<section><h2>{title}</h2>{drawn}{_table(mine)}</section>")
    title = "The paper's results, reproduced"
    verdict = " ".join([*warnings, _verdict(claims)])
    top = head(title, [verdict], ["Brackets are 95 % intervals; a rule decides each."])
    body = f"<main>{top}{''.join(sections)}</main>"
    return page(title=title, body=body, style=asset("run.css"))


def _verdict(claims: Sequence[Claim]) -> str:
    """Return how many claims have each verdict."""
    counts = Counter(claim.holds for claim in claims)
    found = ", ".join(
        f"{counts[verdict]} {one if counts[verdict] == 1 else many}"
        for verdict, one, many in (
            (HOLDS, "holds", "hold"),
            (FAILS, "does not", "do not"),
            (OPEN, "cannot be told", "cannot be told"),
        )
        if counts[verdict] or verdict == HOLDS
    )
    return f"Of {counted(len(claims), 'verdict')} on the paper's claims {found}."


def _figure(svg: str, title: str) -> str:
    """Return the figure as an image: a style within the page itself would be refused by it."""
    data = base64.b64encode(svg.encode()).decode("ascii")
    return f'<div class="scrolls"><img src="data:image/svg+xml;base64,{data}" alt="{title}"></div>'


def _table(claims: Sequence[Claim]) -> str:
    head = "".join(f'<th scope="col">{title}</th>' for title in _COLUMNS)
    rows = "".join(_row(claim) for claim in claims)
    return f'<table class="claims"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'


_COLUMNS = ("The paper says", "Verdict", "Paper", "Ours [95 %]", "Preset", "Rule")
# Look of each verdict; the word says it, too.
_LOOKS = {HOLDS: "good", FAILS: "bad", OPEN: "open"}


def _row(claim: Claim) -> str:
    """Return a claim as a row; on a phone it becomes a card, which needs each column's title."""
    verdict = f'<strong class="{_LOOKS[claim.holds]}">{escape(claim.holds)}</strong>'
    rule = escape(claim.rule).replace(" %", "&nbsp;%")
    cells = (verdict, escape(claim.paper), escape(number_text(claim)), escape(claim.preset), rule)
    row = "".join(
        f'<td data-title="{title}">{cell}</td>'
        for title, cell in zip(_COLUMNS[1:], cells, strict=True)
    )
    return f'<tr><th scope="row">{escape(claim.sentence)}</th>{row}</tr>'
