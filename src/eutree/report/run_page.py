"""The report of a run: the verdict, the tree to watch, changes and curves, the rest folded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from string import Template
from typing import Any
from urllib.parse import quote

import numpy as np

from eutree.arrays import Floats
from eutree.compression.episodes import FrontEntry
from eutree.display import counted
from eutree.export import to_svg
from eutree.export.svg import STYLE
from eutree.policies import TreePolicy
from eutree.policy_search.model_trust import ModelTrust
from eutree.report.chart import Series, curve_figures, front_section, legend, scatter
from eutree.report.html import LeafChange, Verdict, asset, figure, head, page, scrolling
from eutree.report.tree_data import add_pictures, tree_data
from eutree.report.watching import WatchedEpisode

CHANGES_ID = "what-changed"  # where a verdict may point

_SCRIPTS = ("model", "tree", "player", "details", "start")


@dataclass(frozen=True)
class Headline:
    """One of the large figures below the verdict.

    Attributes:
        label: The name of the figure.
        figure: Its value, as a text.
        interval: Its interval, or other words that belong to it.
        words: A few words on its meaning.
    """

    label: str
    figure: str
    interval: str = ""
    words: str = ""


@dataclass(frozen=True)
class Table:
    """A table of texts; the first column names the row.

    Attributes:
        header: Titles of the columns.
        rows: The cells of each row, the name first.
        caption: Its subject, and the episodes on which it was measured.
        marked: Number of the row to point out; -1 for none.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    marked: int = -1


@dataclass(frozen=True, eq=False)
class WatchedTree:
    """The tree that the page shows, and the episodes to play.

    Attributes:
        policy: The policy of the tree.
        episodes: Episodes to play: its own, and those of others for comparison.
        changes: Leaves that decide otherwise than before, to be marked.
        observations: The rows on which the shares of nodes are counted, [N, d]; by default the
            policy's own counts or else the episodes.
        caption: The words below the tree.
    """

    policy: TreePolicy
    episodes: Sequence[WatchedEpisode] = ()
    changes: Mapping[int, LeafChange] = field(default_factory=dict)
    observations: Floats | None = None  # [N, d]
    caption: str = ""


@dataclass(frozen=True)
class RunReport:
    """The content of a run's report; empty parts are left out.

    Attributes:
        title: The subject of the page.
        verdict: The result in a sentence.
        notes: Sentences below the verdict.
        stages: Large figures, in the order of the story.
        watched: The tree to watch.
        changes: Sentences on changes, each with the share of the steps that it concerns.
        curves: For each measure ("success rate", "return", "leaves") the points of each learner:
            episode, mean, low and high. A success rate is shown as a percentage.
        tables: Tables by title.
        front: The learned tree and the best tree of each size, the largest first.
        picked: Leaves of the tree of the front that was picked; None for none.
        trust: The returns of trees as the world model imagined them, and their real ones.
        trees: Policies to draw, with a caption each; folded.
        texts: Further texts, such as source code, by title; folded.
        files: A label and a path, relative to the page, for each file to link.
    """

    title: str
    verdict: Verdict = ()
    notes: Sequence[str] = ()
    stages: Sequence[Headline] = ()
    watched: WatchedTree | None = None
    changes: Sequence[tuple[str, float]] = ()
    curves: Mapping[str, Series] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    front: Sequence[FrontEntry] = ()
    picked: int | None = None
    trust: ModelTrust | None = None
    trees: Mapping[str, TreePolicy] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    files: Sequence[tuple[str, str]] = ()


def run_page(report: RunReport) -> str:
    """Return the report as one self-contained HTML page.

    Above ``SIZE_LIMIT`` bytes pictures are left out, those of the last episodes first.
    """
    sections = [
        _stages(report.stages) if report.stages else "",
        _watch(report.watched) if report.watched else "",
        _section("What changed", _changes(report.changes), CHANGES_ID) if report.changes else "",
        _section("Learning", _charts(report)) if report.curves else "",
        _section("Can this world model be trusted here?", _trust(report.trust))
        if report.trust is not None
        else "",
        *(_section(title, _table(table)) for title, table in report.tables.items()),
        _section("Smaller trees", front_section(report.front, report.picked), "front")
        if report.front
        else "",
        _folds(report),
        _section("Files", _files(report)) if report.files else "",
    ]
    top = head(report.title, report.verdict, report.notes)
    body = "\n".join(["<main>", top, *filter(None, sections), "</main>"])
    style = asset("chart.css") + asset("run.css") + STYLE
    if report.watched is None:
        return page(title=report.title, body=body, style=style)
    style = asset("watch.css") + style
    script = "".join(asset(f"{name}.js") for name in _SCRIPTS)
    data = _data(report.watched)
    add_pictures(data, report.watched.episodes, body + script + style)
    return page(title=report.title, body=body, style=style, script=script, data=data)


def _data(watched: WatchedTree) -> dict[str, Any]:
    tree, rows = watched.policy.tree, watched.observations
    data = tree_data(watched.policy, watched.episodes, changes=watched.changes)
    if rows is not None:
        data["visits"] = np.bincount(tree.leaf_index(rows), minlength=tree.n_leaves).tolist()
    return data


def _section(title: str, content: str, name: str = "") -> str:
    """Return a section with its heading, and the name by which links find it."""
    known = f' id="{name}"' if name else ""
    return f"<section{known}><h2>{escape(title)}</h2>\n{content}\n</section>"


def _stages(stages: Sequence[Headline]) -> str:
    entries = "".join(
        f"<li><h2>{escape(stage.label)}</h2>"
        f'<p class="figure">{escape(stage.figure)} '
        f'<span class="quiet">{escape(stage.interval)}</span></p>'
        f'<p class="quiet">{escape(stage.words)}</p></li>'
        for stage in stages
    )
    return f'<section><ol class="stages">{entries}</ol></section>'


def _watch(watched: WatchedTree) -> str:
    """Return the tree and the player beside it; its script draws both."""
    return Template(asset("watch.html")).substitute(
        title="Watch it decide" if watched.episodes else "The tree",
        caption=escape(watched.caption),
        **{part: asset(f"{part}.html") for part in ("tree", "player", "details")},
    )


def _changes(changes: Sequence[tuple[str, float]]) -> str:
    """Return the changes as a list; a bar says how many steps each concerns."""
    most = max(share for _, share in changes) or 1.0
    entries = "".join(
        f'<li><span class="share">{100 * share:.1f} %</span>'
        f'<svg viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">'
        f'<rect class="amount" width="{100 * share / most:.1f}" height="10" rx="2"/></svg>'
        f"<span>{escape(words)}</span></li>"
        for words, share in changes
    )
    return f'<ol class="changes">{entries}</ol>'


def _charts(report: RunReport) -> str:
    """Return the charts side by side, and one legend for all."""
    names = list(dict.fromkeys(name for series in report.curves.values() for name in series))
    complete = [{name: series.get(name, ()) for name in names} for series in report.curves.values()]
    figures = curve_figures(dict(zip(report.curves, complete, strict=True)))
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
    drawn = ""
    if points:
        drawing = scatter("score in the world model", "mean real return", points)
        drawn = figure("Mean real return of each tree", drawing)
        drawn = f'<div class="charts alone">{drawn}</div>'
    return f"<p>{escape(sentence[0].upper() + sentence[1:])}.</p>{drawn}"


def _table(table: Table) -> str:
    """Return the table in a region that scrolls by itself on a narrow screen."""
    head_cells = "".join(f'<th scope="col">{escape(title)}</th>' for title in table.header)
    rows = [
        "".join(
            f'<th scope="row">{escape(cell)}</th>' if column == 0 else f"<td>{escape(cell)}</td>"
            for column, cell in enumerate(row)
        )
        for row in table.rows
    ]
    opened = ["<tr>"] * len(rows)
    if 0 <= table.marked < len(rows):
        opened[table.marked] = '<tr class="marked">'
    body = "".join(f"{start}{row}</tr>\n" for start, row in zip(opened, rows, strict=True))
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    inside = f"{caption}<thead><tr>{head_cells}</tr></thead>\n<tbody>{body}</tbody>"
    return scrolling(table.caption or "Table", f"<table>{inside}</table>")


def _folds(report: RunReport) -> str:
    folds = [
        _fold(
            f"{name}: {counted(policy.n_leaves, 'leaf')}",
            scrolling(f"{name}, drawn", to_svg(policy, standalone=False), kind="tree"),
        )
        for name, policy in report.trees.items()
    ]
    folds += [
        _fold(title, scrolling(title, escape(text), tag="pre"))
        for title, text in report.texts.items()
    ]
    return f"<section>{''.join(folds)}</section>" if folds else ""


def _fold(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>\n"


def _files(report: RunReport) -> str:
    """Return links to the files beside the page; a path is quoted, so it cannot be a scheme."""
    entries = (
        f'<li><a href="{quote(path)}">{escape(path)}</a> <span class="quiet">{escape(label)}</span>'
        "</li>"
        for label, path in report.files
    )
    return f'<ul class="files">{"".join(entries)}</ul>'
