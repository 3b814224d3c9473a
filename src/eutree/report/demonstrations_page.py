"""The summary of demonstrations: would more help, what contradicts itself, what was seen, episodes.

Every figure on it comes from ``eutree.data`` (what the episodes hold) and ``eutree.evaluation``
(what a tree learns from them); here they are drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.data.coverage import Histogram, coverage_map, drawn_bounds, histograms
from eutree.data.neighbours import Neighbours, compare_neighbours
from eutree.data.summary import Conflict, Summary, summarize
from eutree.evaluation.expert_curve import ExpertCurve, expert_curve
from eutree.report.chart import chart, legend
from eutree.report.coverage_chart import action_legend, histogram_chart, map_chart
from eutree.report.head import Pointer, Verdict, head
from eutree.report.html import asset, page
from eutree.report.time_chart import MAX_FEATURES, panels, style_of, time_chart
from eutree.schema import Schema

MAX_EPISODES = 100
DIFFER = "where-they-differ"


@dataclass(frozen=True, eq=False)
class DemonstrationFigures:
    """The figures of a summary.

    Attributes:
        summary: Results, coverage and groups of near-equal observations with several actions.
        neighbours: Each observation against its nearest of another episode.
        curve: The learning curve of the expert tree; None with too few episodes.
    """

    summary: Summary
    neighbours: Neighbours
    curve: ExpertCurve | None

    @property
    def advice(self) -> str:
        """One or two sentences for the person who demonstrates."""
        if self.curve is None:
            return "Four episodes are needed to say whether more would help."
        return self.curve.advice


def demonstration_figures(demonstrations: Demonstrations) -> DemonstrationFigures:
    """Return all figures of a summary; the same demonstrations give the same figures."""
    return DemonstrationFigures(
        summarize(demonstrations), compare_neighbours(demonstrations), expert_curve(demonstrations)
    )


def demonstrations_page(
    demonstrations: Demonstrations,
    *,
    title: str = "Demonstrations",
    numbers: Sequence[int] | None = None,
    figures: DemonstrationFigures | None = None,
) -> str:
    """Return the summary of demonstrations as one self-contained HTML page without a script.

    Args:
        demonstrations: The episodes; discarded ones are drawn too, marked.
        title: Heading of the page.
        numbers: Number of each episode in its folder; 0, 1, ... if not given.
        figures: What ``demonstration_figures`` found; computed if not given.
    """
    numbers = range(len(demonstrations.episodes)) if numbers is None else numbers
    figures = figures or demonstration_figures(demonstrations)
    body = [
        "<main>",
        _head(demonstrations, title, figures),
        _section("Would more demonstrations help?", _curve(figures)),
        _section(
            "Where the demonstrations differ",
            _differences(demonstrations, figures, numbers),
            DIFFER,
        ),
        _section("What was seen", _coverage(demonstrations)),
        _section("Episodes", _episodes(demonstrations, figures, numbers)),
        "</main>",
    ]
    style = "".join(map(asset, ("chart.css", "run.css", "demonstrations.css")))
    return page(title=title, body="\n".join(body), style=style)


def _head(demonstrations: Demonstrations, title: str, figures: DemonstrationFigures) -> str:
    """Return what the demonstrations are worth, then what they are."""
    discarded = len(demonstrations.episodes) - len(demonstrations)
    facts = [
        str(demonstrations.environment or "environment unknown"),
        f"by {demonstrations.expert}" if demonstrations.expert else "",
        f"{len(demonstrations)} episodes" + (f" and {discarded} discarded" if discarded else ""),
        f"{demonstrations.n_transitions} steps",
    ]
    return head(title, _verdict(figures), [" · ".join(filter(None, facts))])


def _verdict(figures: DemonstrationFigures) -> Verdict:
    """Return how often the task was done, how often the hands contradict themselves, what to do."""
    parts: list[str | Pointer] = []
    success, share = figures.summary.success_rate, figures.neighbours.disagreement
    if success is not None:
        parts.append(f"{100 * success:.0f} % of the episodes succeed")
    if share is not None:
        parts += ["; " if parts else "", Pointer(f"{100 * share:.0f} % of the steps", DIFFER)]
        parts.append(" were answered otherwise elsewhere")
    return [*parts, ". " if parts else "", figures.advice]


def _section(title: str, content: str, name: str = "") -> str:
    known = f' id="{name}"' if name else ""
    return f"<section{known}><h2>{title}</h2>\n{content}\n</section>"


def _curve(figures: DemonstrationFigures) -> str:
    """Return the learning curve with its law, which the advice in the head rests on."""
    curve = figures.curve
    if curve is None:
        return "<p>There are too few episodes for a learning curve.</p>"
    measured = [(float(p.k), p.accuracy, *p.interval) for p in curve.points]
    last = curve.n_episodes + curve.more
    law = [(float(k), *(1.0 - curve.law.error(k),) * 3) for k in range(1, last + 1)]
    series = {"measured, with its 95 % interval": measured, "power law, extended": law}
    return (
        f'<figure class="single"><figcaption>Accuracy of the expert tree on '
        f"episodes it has not seen</figcaption>{chart('accuracy', series, percent=True)}"
        f"{legend(list(series))}</figure>\n"
        '<p class="quiet">Accuracy is the share of the steps of an episode at which C4.5, fitted '
        "to other episodes, chooses the same action. It is no measure of success, and it knows "
        "only of more episodes like these: showing rare situations can help where more of the "
        "same does not.</p>"
    )


def _differences(
    demonstrations: Demonstrations, figures: DemonstrationFigures, numbers: Sequence[int]
) -> str:
    """Return the shares and both lists of places."""
    summary, neighbours = figures.summary, figures.neighbours
    share = neighbours.disagreement
    lines = [
        "<p>With fewer than two episodes there is nothing to compare.</p>"
        if share is None
        else f"<p>{share:.1%} of the steps were answered otherwise than the most similar step of "
        f"another episode{_near(neighbours)}.</p>"
    ]
    schema = demonstrations.schema
    pairs = [
        (
            *(_place(numbers, place) for place in pair.places),
            " / ".join(schema.actions[action] for action in pair.actions),
            f"{pair.distance:.2%}",
        )
        for pair in neighbours.contradictions
    ]
    if pairs:
        lines.append(
            _table(
                "The nearest pairs with different actions; the distance is the largest difference "
                "of any feature, as a share of its range",
                ("step", "and step", "actions", "distance"),
                pairs,
            )
        )
    if summary.conflicts:
        lines.append(
            _table(
                f"Near-equal observations (within a fiftieth of the range of every feature) with "
                f"different actions: {summary.disagreement:.1%} of the steps, "
                f"{summary.n_conflicts} places; the largest",
                ("around", "actions", "first seen at"),
                [_conflict_row(conflict, schema, numbers) for conflict in summary.conflicts],
                name="places",
            )
        )
    return "\n".join(lines)


def _near(neighbours: Neighbours) -> str:
    """Return the share among near-equal neighbours, as the rest of a sentence."""
    if neighbours.near_disagreement is None:
        return "; none of them is near-equal"
    return (
        f"; of the {neighbours.n_near} that have a near-equal one, "
        f"{neighbours.near_disagreement:.1%} were"
    )


def _conflict_row(conflict: Conflict, schema: Schema, numbers: Sequence[int]) -> tuple[str, ...]:
    values = zip(schema.features, conflict.observation, strict=True)
    around = ", ".join(f"{f.name} {value:.4g} {f.unit}".strip() for f, value in values)
    counts = zip(schema.actions, conflict.counts, strict=True)
    actions = ", ".join(f"{name} ({count})" for name, count in counts if count)
    return around, actions, ", ".join(_place(numbers, place) for place in conflict.places)


def _place(numbers: Sequence[int], place: tuple[int, int]) -> str:
    return f"episode {numbers[place[0]]} step {place[1]}"


def _table(
    caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, name: str = "pairs"
) -> str:
    """Return a table in a region that scrolls by itself on a narrow screen."""
    head = "".join(f'<th scope="col">{escape(title)}</th>' for title in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>\n" for row in rows
    )
    return (
        f'<div class="scrolls" tabindex="0" role="region" aria-label="{escape(caption)}">'
        f'<table class="{name}">'
        f"<caption>{escape(caption)}.</caption><thead><tr>{head}</tr></thead>\n"
        f"<tbody>{body}</tbody></table></div>"
    )


def _coverage(demonstrations: Demonstrations) -> str:
    """Return the histograms and the map."""
    if not demonstrations.n_transitions:
        return "<p>No step is kept.</p>"
    schema, drawn = demonstrations.schema, histograms(demonstrations)
    charts = []
    found = coverage_map(demonstrations)
    if found is not None:
        first, second = (drawn[j] for j in found.features)
        names = [schema.features[j].name for j in found.features]
        charts.append(
            f"<figure><figcaption>{escape(names[0])} and {escape(names[1])}, which tell most "
            f"about the action: {found.share:.0%} of the cells visited</figcaption>"
            f"{map_chart(found, first, second, schema)}"
            '<p class="quiet">A dot marks a cell with more than one action.</p></figure>'
        )
    singles = "".join(
        f"<figure><figcaption>{escape(schema.features[h.feature].name)} "
        f'<span class="quiet">{escape(_unit_and_bounds(h, schema))}</span></figcaption>'
        f"{histogram_chart(h, schema)}</figure>"
        for h in drawn[:MAX_FEATURES]
    )
    charts.append(f'<div class="stack">{singles}</div>')
    rest = len(drawn) - MAX_FEATURES
    note = f'<p class="quiet">{rest} further features are not drawn.</p>' if rest > 0 else ""
    return f'{action_legend(schema)}\n<div class="charts">{"".join(charts)}</div>{note}'


def _unit_and_bounds(histogram: Histogram, schema: Schema) -> str:
    """Return the unit of a feature, and its bounds where only a part of them is drawn."""
    feature = schema.features[histogram.feature]
    part = (histogram.low, histogram.high) != (feature.low, feature.high)
    bounded = np.isfinite(feature.low) and np.isfinite(feature.high)
    bounds = f"of {feature.low:.4g} to {feature.high:.4g}" if part and bounded else ""
    return " ".join(filter(None, (feature.unit, bounds)))


def _episodes(
    demonstrations: Demonstrations, figures: DemonstrationFigures, numbers: Sequence[int]
) -> str:
    """Return a card for each episode."""
    schema = demonstrations.schema
    low, high = drawn_bounds(demonstrations)
    marked: dict[int, list[int]] = {}
    for pair in figures.neighbours.contradictions:
        for episode, step in pair.places:
            marked.setdefault(episode, []).append(step)
    cards = [
        _card(episode, number, schema, (low, high), sorted(set(marked.get(place, ()))))
        for place, (episode, number) in enumerate(
            zip(demonstrations.episodes[:MAX_EPISODES], numbers, strict=False)
        )
    ]
    shared = [group for group in panels(schema) if len(group) > 1]
    keys = "".join(
        f'<li><svg width="34" height="8" aria-hidden="true"><line class="curve series-{style} '
        f'dash-{style}" x1="0" x2="34" y1="4" y2="4" stroke-width="2.4"/></svg>'
        f"{escape(schema.features[j].name)}</li>"
        for group in shared
        for j in group
        for style in (style_of(schema, j),)
    )
    rest = len(demonstrations.episodes) - MAX_EPISODES
    note = f'<p class="quiet">{rest} further episodes are not drawn.</p>' if rest > 0 else ""
    marks = (
        '<p class="quiet">An upright line marks a step of a pair listed above.</p>'
        if marked
        else ""
    )
    key = f'<ul class="legend">{keys}</ul>' if keys else ""
    return f'{key}{marks}\n<div class="cards">{"".join(cards)}</div>{note}'


def _card(
    episode: Episode,
    number: int,
    schema: Schema,
    ends: tuple[Floats, Floats],
    marked: Sequence[int],
) -> str:
    """Return one episode: what became of it, and its course."""
    result = episode.ending or "no ending recorded"
    badges = [] if episode.kept else [episode.comment or "discarded"]
    if episode.kept and episode.comment:
        badges.append(episode.comment)
    if episode.ending == "interrupted":
        badges.append("recovered")
    mood = "" if episode.is_success is None else " good" if episode.is_success else " bad"
    shown = "".join(f'<span class="badge">{escape(badge)}</span>' for badge in badges)
    earned = f"return {episode.undiscounted_return:.4g}" if episode.has_rewards else "no rewards"
    facts = f"{len(episode)} steps, {earned}"
    label = f"episode {number}: {result}, {facts}"
    drawing = (
        time_chart(episode, schema, *ends, marked, label)
        if len(episode)
        else '<p class="quiet">No step was taken.</p>'
    )
    return (
        f'<article class="{"kept" if episode.kept else "discarded"}"><h3>Episode {number}: '
        f'<span class="result{mood}">{escape(result)}</span> {shown}</h3>'
        f'<p class="quiet">{facts}</p>{drawing}</article>\n'
    )
