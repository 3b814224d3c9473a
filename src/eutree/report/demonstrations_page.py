"""The page of demonstrations: whether more would help, and a picture of each episode."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.evaluation.expert_curve import ExpertCurve, expert_curve
from eutree.report.chart import legend, ticks
from eutree.report.html import asset, head, page
from eutree.schema import Schema


@dataclass(frozen=True, eq=False)
class DemonstrationFigures:
    """The figures of demonstrations.

    Attributes:
        demonstrations: The demonstrations.
        curve: The learning curve of the expert tree; None with too few episodes.
    """

    demonstrations: Demonstrations
    curve: ExpertCurve | None

    @property
    def success_rate(self) -> float | None:
        """Share of the kept episodes that succeeded; None where none reports it."""
        known = [e.is_success for e in self.demonstrations if e.is_success is not None]
        return sum(known) / len(known) if known else None

    @property
    def advice(self) -> str:
        """One or two sentences for the person who demonstrates."""
        if self.curve is None:
            return "Four episodes are needed to say whether more would help."
        return self.curve.advice

    def values(self) -> dict[str, Any]:
        """Return the figures for ``--json``."""
        from eutree.fitting import Person

        shown, person = self.demonstrations, Person.of(self.demonstrations)
        return {
            "episodes": len(shown),
            "discarded": len(shown.episodes) - len(shown),
            "n_transitions": shown.n_transitions,
            "success_rate": self.success_rate,
            "whole_episodes": person.episodes,
            "interval": person.success_interval,
            "mean_return": person.mean_return,
            "return_interval": person.return_interval,
            "learning_curve": self.curve and _curve(self.curve),
            "advice": self.advice,
        }

    def words(self) -> str:
        """Return the figures in a few lines."""
        from eutree.fitting import Person
        from eutree.fitting.report import result_in_words

        shown = self.demonstrations
        discarded = len(shown.episodes) - len(shown)
        return (
            f"{len(shown)} episodes ({discarded} discarded), {shown.n_transitions} transitions\n"
            f"shown: {result_in_words(Person.of(shown).whole)}\n{self.advice}"
        )


def demonstration_figures(demonstrations: Demonstrations) -> DemonstrationFigures:
    """Return all figures of demonstrations; the same demonstrations give the same figures."""
    return DemonstrationFigures(demonstrations, expert_curve(demonstrations))


def _curve(curve: ExpertCurve) -> dict[str, Any]:
    return {
        "points": [
            {"episodes": p.k, "accuracy": p.accuracy, "interval": list(p.interval)}
            for p in curve.points
        ],
        "most_frequent": curve.most_frequent,
        "law": vars(curve.law),
        "more": curve.more,
        "gain": curve.gain,
        "gain_interval": list(curve.gain_interval),
    }


FILLED = 0.5  # share of a feature's bounds below which the values seen bound a drawing


def drawn_bounds(demonstrations: Demonstrations) -> tuple[Floats, Floats]:
    """Return between which values each feature is drawn; each of shape [d].

    These are its bounds or, where it has none or the values seen fill less than half of them, the
    values seen.
    """
    seen, features = demonstrations.observations, demonstrations.schema.features
    low, high = np.array([(feature.low, feature.high) for feature in features]).T
    if not len(seen):
        return np.zeros_like(low), np.zeros_like(high)
    least, most = seen.min(axis=0), seen.max(axis=0)
    bounded = np.isfinite(low) & np.isfinite(high)
    # Halves, because high - low may overflow. A feature that never moved keeps its bounds.
    reach = most / 2 - least / 2
    narrow = ~bounded | ((reach > 0) & (reach < FILLED * (high / 2 - low / 2)))
    # Adding 0 makes a -0 that was recorded, or is a bound, a 0.
    return np.where(narrow, least, low) + 0.0, np.where(narrow, most, high) + 0.0


# Features with the same unit share a panel, so the position of a task and those of its opponents
# are seen against each other; a feature without a unit has a panel to itself.


MAX_FEATURES = 12
_MAX_POINTS = 400  # of a line
_STYLES = 5
_WIDTH, _LEFT, _RIGHT = 420.0, 72.0, 8.0
_GAP, _ROW = 12.0, 16.0
_PANEL, _LOW_PANEL = 104.0, 56.0
_FEW = 3  # panels; more are lower, so that an episode can be seen at a glance


def panels(schema: Schema) -> list[list[int]]:
    """Return the features of each panel, in index order."""
    by_unit: dict[str, list[int]] = {}
    for number, feature in enumerate(schema.features[:MAX_FEATURES]):
        by_unit.setdefault(feature.unit or f"alone {number}", []).append(number)
    return list(by_unit.values())


def style_of(schema: Schema, feature: int) -> int:
    """Return the style of a feature's line: the first of a panel has the first."""
    return next(p.index(feature) for p in panels(schema) if feature in p) % _STYLES


def time_chart(episode: Episode, schema: Schema, low: Floats, high: Floats, label: str) -> str:
    """Return the drawing of one episode.

    Args:
        episode: The episode, of at least one step.
        schema: Names of its features and actions.
        low: Lower end of each feature's axis, shape [d].
        high: Upper end of each feature's axis, shape [d].
        label: What a screen reader says.
    """
    groups = panels(schema)
    panel = _PANEL if len(groups) <= _FEW else _LOW_PANEL
    top_of_actions = len(groups) * (panel + _GAP)
    height = top_of_actions + schema.n_actions * _ROW + 34
    lines = [
        f'<svg class="chart time" viewBox="0 0 {_WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(label)}">'
    ]
    for place, group in enumerate(groups):
        top = place * (panel + _GAP)
        lines += _panel(episode, schema, group, (low, high), (top, panel))
    lines += _actions(episode, schema, top_of_actions)
    bottom = top_of_actions + schema.n_actions * _ROW
    for tick in (0, len(episode)):
        anchor = "start" if tick == 0 else "end"
        lines.append(
            f'<text x="{_x(tick, len(episode)):.1f}" y="{bottom + 16:.1f}" '
            f'text-anchor="{anchor}">{"step 0" if tick == 0 else tick}</text>'
        )
    return "\n".join([*lines, "</svg>"])


def _panel(
    episode: Episode,
    schema: Schema,
    group: list[int],
    ends: tuple[Floats, Floats],
    place: tuple[float, float],
) -> list[str]:
    """Return the grid and the lines of one panel; its place is its top and its height."""
    top, high = place
    marks = ticks(
        float(min(ends[0][j] for j in group)), float(max(ends[1][j] for j in group)), about=3
    )
    if high < _PANEL:
        marks = [marks[0], marks[-1]]
    scale = (high - 16) / (marks[-1] - marks[0])

    def y(value: float) -> float:
        inside = min(max(value, marks[0]), marks[-1])
        return top + high - 4 - (inside - marks[0]) * scale

    feature = schema.features[group[0]]
    title = feature.unit if len(group) > 1 else f"{feature.name} {feature.unit}".strip()
    lines = [f'<text class="unit" x="{_LEFT}" y="{top + 8:.1f}">{escape(title)}</text>']
    for mark in marks:
        lines.append(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y(mark):.1f}" '
            f'y2="{y(mark):.1f}"/><text x="{_LEFT - 5}" y="{y(mark) + 4:.1f}" text-anchor="end">'
            f"{mark:.4g}</text>"
        )
    count = len(episode.observations)
    shown = np.unique(np.linspace(0, count - 1, min(count, _MAX_POINTS)).astype(int)).tolist()
    for j in group:
        values = episode.observations[:, j].tolist()
        points = " ".join(
            f"{_x(step, len(episode)):.1f},{y(values[step]):.1f}"
            for step in shown
            if np.isfinite(values[step])
        )
        style = style_of(schema, j)
        lines.append(f'<polyline class="curve series-{style} dash-{style}" points="{points}"/>')
    return lines


def _actions(episode: Episode, schema: Schema, top: float) -> list[str]:
    """Return a row for each action, filled while it was taken."""
    lines = []
    for action, name in enumerate(schema.actions):
        y = top + action * _ROW
        text = name if len(name) <= 8 else f"{name[:7]}…"
        lines.append(
            f'<text x="{_LEFT - 5}" y="{y + 12:.1f}" text-anchor="end">{escape(text)}</text>'
            f'<rect class="row" x="{_LEFT}" y="{y + 2:.1f}" width="{_WIDTH - _LEFT - _RIGHT:.1f}" '
            f'height="{_ROW - 4:.1f}"/>'
        )
    changes = np.flatnonzero(np.diff(episode.actions)) + 1
    starts = [0, *changes.tolist()]
    for first, last in zip(starts, [*starts[1:], len(episode)], strict=True):
        action = int(episode.actions[first])
        left, right = _x(first, len(episode)), _x(last, len(episode))
        lines.append(
            f'<rect class="action-{action % _STYLES}" x="{left:.1f}" '
            f'y="{top + action * _ROW + 2:.1f}" width="{max(right - left, 0.3):.1f}" '
            f'height="{_ROW - 4:.1f}"/>'
        )
    return lines


def _x(step: float, length: int) -> float:
    return _LEFT + step / max(length, 1) * (_WIDTH - _LEFT - _RIGHT)


MAX_EPISODES = 100


def demonstrations_page(
    demonstrations: Demonstrations,
    *,
    title: str = "Demonstrations",
    numbers: Sequence[int] | None = None,
    figures: DemonstrationFigures | None = None,
) -> str:
    """Return a page about demonstrations: one self-contained file of HTML without a script.

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
        f"<section><h2>Episodes</h2>\n{_episodes(demonstrations, numbers)}\n</section>",
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
    return head(title, [_verdict(figures)], [" · ".join(filter(None, facts))])


def _verdict(figures: DemonstrationFigures) -> str:
    """Return how often the task was done, and whether more would help."""
    success = figures.success_rate
    share = "" if success is None else f"{100 * success:.0f} % of the episodes succeed. "
    return share + figures.advice


def _episodes(demonstrations: Demonstrations, numbers: Sequence[int]) -> str:
    """Return a card for each episode."""
    schema = demonstrations.schema
    ends = drawn_bounds(demonstrations)
    cards = [
        _card(episode, number, schema, ends)
        for episode, number in zip(demonstrations.episodes[:MAX_EPISODES], numbers, strict=False)
    ]
    shared = [j for group in panels(schema) if len(group) > 1 for j in group]
    styles = [style_of(schema, j) for j in shared]
    key = legend([schema.features[j].name for j in shared], styles) if shared else ""
    rest = {
        "features": schema.n_features - MAX_FEATURES,
        "episodes": len(demonstrations.episodes) - MAX_EPISODES,
    }
    note = "".join(
        f'<p class="quiet">{count} further {name} are not drawn.</p>'
        for name, count in rest.items()
        if count > 0
    )
    return f'{key}\n<div class="cards">{"".join(cards)}</div>{note}'


def _card(episode: Episode, number: int, schema: Schema, ends: tuple[Floats, Floats]) -> str:
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
        time_chart(episode, schema, *ends, label)
        if len(episode)
        else '<p class="quiet">No step was taken.</p>'
    )
    return (
        f'<article class="{"kept" if episode.kept else "discarded"}"><h3>Episode {number}: '
        f'<span class="result{mood}">{escape(result)}</span> {shown}</h3>'
        f'<p class="quiet">{facts}</p>{drawing}</article>\n'
    )
