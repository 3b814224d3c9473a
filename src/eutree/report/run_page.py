"""The report of a run: learning curves, the comparison, the trees, the files."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from urllib.parse import quote

from eutree.export import to_svg
from eutree.export.svg import STYLE
from eutree.learners.model_trust import ModelTrust
from eutree.policies import TreePolicy
from eutree.report.chart import Series, chart, legend, scatter
from eutree.report.coverage_chart import action_legend
from eutree.report.html import asset, page
from eutree.wording import counted

RACES = ("race", "tree", "made by", "episodes", "mean return", "then")


@dataclass(frozen=True)
class RunReport:
    """What a run's report shows; whatever is empty is left out.

    Attributes:
        title: Heading of the page.
        curves: For each measure ("success rate", "return", "leaves") the points of each learner:
            episode, mean, low and high. A success rate is shown as a percentage.
        header: Titles of the table's columns.
        rows: Rows of the table, as text; the first column names the row.
        trees: Policies to draw, with a caption each.
        partitions: Drawings of the partition while it grew: a caption and SVG text each.
        files: A label and a path, relative to the page, for each file to link.
        notes: Sentences below the title.
        trust: What the world model imagined of trees, and what they really earned.
        races: Rows of the table of races, as text: race, tree, how it was made, episodes, mean
            return, what became of it.
    """

    title: str
    curves: Mapping[str, Series] = field(default_factory=dict)
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    trees: Mapping[str, TreePolicy] = field(default_factory=dict)
    partitions: Sequence[tuple[str, str]] = ()
    files: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = ()
    trust: ModelTrust | None = None
    races: Sequence[Sequence[str]] = ()


def run_page(report: RunReport) -> str:
    """Return the report as one self-contained HTML page."""
    sections = [
        _section("Learning", _charts(report)) if report.curves else "",
        _section("Can this world model be trusted here?", _trust(report.trust))
        if report.trust is not None
        else "",
        _section("Races", _table("Races", RACES, report.races)) if report.races else "",
        _section("Comparison", _table("Comparison", report.header, report.rows))
        if report.rows
        else "",
        _section("Partition", _partitions(report)) if report.partitions else "",
        _section("Trees", _trees(report)) if report.trees else "",
        _section("Files", _files(report)) if report.files else "",
    ]
    notes = "".join(f"<p>{escape(note)}</p>" for note in report.notes)
    heading = f"<header><h1>{escape(report.title)}</h1>{notes}</header>"
    return page(
        title=report.title,
        body="\n".join(["<main>", heading, *filter(None, sections), "</main>"]),
        style=asset("chart.css") + asset("partition.css") + asset("run.css") + STYLE,
    )


def _section(title: str, content: str) -> str:
    """Return a section with its heading."""
    return f"<section><h2>{title}</h2>\n{content}\n</section>"


def _charts(report: RunReport) -> str:
    """Return the charts side by side, and one legend for all."""
    names = list(dict.fromkeys(name for series in report.curves.values() for name in series))
    complete = [{name: series.get(name, ()) for name in names} for series in report.curves.values()]
    figures = [
        f"<figure><figcaption>{escape(measure.capitalize())}</figcaption>\n"
        f"{chart(measure, series, percent=measure == 'success rate')}</figure>"
        for measure, series in zip(report.curves, complete, strict=True)
    ]
    return f'<div class="charts">{"".join(figures)}</div>\n{legend(names)}'


def _trust(trust: ModelTrust) -> str:
    """Return a sentence on the model, and its scores against real returns."""
    sentence = trust.describe()
    points = [
        (imagined, real, f"imagined {imagined:.1f}, really {real:.1f} in {n} episodes")
        for imagined, real, n in zip(
            trust.imagined.tolist(), trust.real.tolist(), trust.episodes.tolist(), strict=True
        )
    ]
    drawn = (
        '<div class="charts alone"><figure><figcaption>Mean real return of each tree</figcaption>\n'
        f"{scatter('score in the world model', 'mean real return', points)}</figure></div>"
    )
    return f"<p>{escape(sentence[0].upper() + sentence[1:])}.</p>{drawn if points else ''}"


def _table(name: str, header: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """Return a table in a region that scrolls by itself on a narrow screen."""
    head = "".join(f'<th scope="col">{escape(title)}</th>' for title in header)
    rows = [
        "".join(
            f'<th scope="row">{escape(cell)}</th>' if column == 0 else f"<td>{escape(cell)}</td>"
            for column, cell in enumerate(row)
        )
        for row in cells
    ]
    body = "".join(f"<tr>{row}</tr>\n" for row in rows)
    return (
        '<div class="scrolls" tabindex="0" role="region" '
        f'aria-label="{name} table">'
        f"<table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>"
    )


def _trees(report: RunReport) -> str:
    """Return each tree, drawn, in a frame that scrolls."""
    return "\n".join(
        f'<figure class="tree"><figcaption>{escape(name)}: '
        f"{counted(policy.n_leaves, 'leaf')}</figcaption>"
        f'<div class="scrolls" tabindex="0" role="region" aria-label="{escape(name)}, drawn">'
        f"{to_svg(policy, standalone=False)}</div></figure>"
        for name, policy in report.trees.items()
    )


def _partitions(report: RunReport) -> str:
    """Return the drawings side by side, each an image of its own: no word of it is the page's."""
    figures = (
        f'<figure><img alt="{escape(caption)}" src="data:image/svg+xml;base64,'
        f'{b64encode(drawing.encode()).decode("ascii")}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for caption, drawing in report.partitions
    )
    schemas = [policy.schema for policy in report.trees.values()]
    actions = action_legend(schemas[0]) if schemas else ""
    key = (
        '<p class="quiet">A region has the hue of its action and is stronger the more it is worth; '
        "the line is the way of the last episode.</p>"
    )
    return f'{key}<div class="partitions">{"".join(figures)}</div>{actions}'


def _files(report: RunReport) -> str:
    """Return links to the files beside the page; a path is quoted, so it cannot be a scheme."""
    entries = (
        f'<li><a href="{quote(path)}">{escape(path)}</a> <span class="quiet">{escape(label)}</span>'
        "</li>"
        for label, path in report.files
    )
    return f'<ul class="files">{"".join(entries)}</ul>'
