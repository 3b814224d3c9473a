"""The page of demonstrations: whether more would help, and a picture of each episode.

Features with the same unit share a chart, so the position of a task and those of its opponents
are seen against each other; a feature without a unit has a chart to itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.display import counted
from eutree.evaluation.expert_curve import ExpertCurve, expert_curve
from eutree.fitting import Person
from eutree.fitting.report import result_in_words
from eutree.report.chart import STYLES, chart, legend, line
from eutree.report.html import asset, figure, head, page
from eutree.schema import Schema

MAX_FEATURES = 12
_MAX_POINTS = 400  # of a line
_LONGEST = 7  # letters of an action's name on an axis
MAX_EPISODES = 100


@dataclass(frozen=True, eq=False)
class DemonstrationFigures:
    """The figures of demonstrations.

    Attributes:
        demonstrations: The episodes that were measured.
        curve: The learning curve of the expert tree; None with too few episodes.
    """

    demonstrations: Demonstrations
    curve: ExpertCurve | None

    @property
    def success_rate(self) -> float | None:
        """Share of the demonstrator's whole episodes that succeeded; None if nothing says so."""
        return Person.of(self.demonstrations).success_rate

    @property
    def advice(self) -> str:
        """One or two sentences for the person who demonstrates."""
        if self.curve is None:
            return "Four episodes are needed to say whether more would help."
        return self.curve.advice

    def values(self) -> dict[str, Any]:
        """Return the figures for ``--json``."""
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
        shown = self.demonstrations
        discarded = len(shown.episodes) - len(shown)
        return (
            f"{counted(len(shown), 'episode')} ({discarded} discarded), "
            f"{counted(shown.n_transitions, 'transition')}\n"
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


def panels(schema: Schema) -> list[list[int]]:
    """Return the features of each chart, in index order."""
    by_unit: dict[str, list[int]] = {}
    for number, feature in enumerate(schema.features[:MAX_FEATURES]):
        by_unit.setdefault(feature.unit or f"alone {number}", []).append(number)
    return list(by_unit.values())


def _drawn(episode: Episode, schema: Schema, ends: Sequence[tuple[float, float]]) -> str:
    """Return the charts of an episode; ``ends`` are those of the axes of its ``panels``."""
    count = len(episode.observations)
    shown = np.unique(np.linspace(0, count - 1, min(count, _MAX_POINTS)).astype(int))
    charts = []
    for group, axis in zip(panels(schema), ends, strict=True):
        features = [schema.features[j] for j in group]
        series = {
            feature.name: line(
                (step, value)
                for step, value in zip(shown, episode.observations[shown, j], strict=True)
                if np.isfinite(value)
            )
            for feature, j in zip(features, group, strict=True)
        }
        alone = f"{features[0].name} {features[0].unit}".strip()
        title = alone if len(group) == 1 else features[0].unit
        charts.append(figure(title, chart(title, series, over="steps", ends=axis)))
    starts = [0, *(np.flatnonzero(np.diff(episode.actions)) + 1).tolist(), len(episode)]
    held = line(
        (step, episode.actions[first]) for first, last in pairwise(starts) for step in (first, last)
    )
    names = [n if len(n) <= _LONGEST else f"{n[: _LONGEST - 2]}…" for n in schema.actions]
    highest = float(schema.n_actions - 1)
    acted = chart(
        "action", {"action": held}, over="steps", whole=True, ends=(0.0, highest), names=names
    )
    return f'<div class="charts">{"".join(charts)}{figure("action", acted)}</div>'


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
        figures: The result of ``demonstration_figures``; computed if not given.
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
    """Return the worth of the demonstrations, then the facts about them."""
    discarded = len(demonstrations.episodes) - len(demonstrations)
    facts = [
        str(demonstrations.environment or "environment unknown"),
        f"by {demonstrations.expert}" if demonstrations.expert else "",
        counted(len(demonstrations), "episode") + f" and {discarded} discarded" * (discarded > 0),
        counted(demonstrations.n_transitions, "step"),
    ]
    success = figures.success_rate
    share = "" if success is None else f"{100 * success:.0f} % of the episodes succeed. "
    return head(title, [share + figures.advice], [" · ".join(filter(None, facts))])


def _episodes(demonstrations: Demonstrations, numbers: Sequence[int]) -> str:
    schema = demonstrations.schema
    seen = [episode.observations for episode in demonstrations.episodes]
    ends = [_ends(np.concatenate(seen)[:, group]) for group in panels(schema)] if seen else []
    cards = [
        _card(episode, number, schema, ends)
        for episode, number in zip(demonstrations.episodes[:MAX_EPISODES], numbers, strict=False)
    ]
    shared = [j for group in panels(schema) if len(group) > 1 for j in group]
    styles = [group.index(j) % STYLES for group in panels(schema) if len(group) > 1 for j in group]
    key = legend([schema.features[j].name for j in shared], styles) if shared else ""
    note = "".join(
        f'<p class="quiet">{count} further {name} are not drawn.</p>'
        for name, count in {
            "features": schema.n_features - MAX_FEATURES,
            "episodes": len(demonstrations.episodes) - MAX_EPISODES,
        }.items()
        if count > 0
    )
    return f'{key}\n<div class="cards">{"".join(cards)}</div>{note}'


def _ends(values: Floats) -> tuple[float, float]:
    """Return the least and the largest finite value."""
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)


def _card(
    episode: Episode, number: int, schema: Schema, ends: Sequence[tuple[float, float]]
) -> str:
    result = episode.ending or "no ending recorded"
    badges = [] if episode.kept else [episode.comment or "discarded"]
    if episode.kept and episode.comment:
        badges.append(episode.comment)
    if episode.ending == "interrupted":
        badges.append("recovered")
    mood = "" if episode.is_success is None else " good" if episode.is_success else " bad"
    shown = "".join(f'<span class="badge">{escape(badge)}</span>' for badge in badges)
    earned = f"return {episode.undiscounted_return:.4g}" if episode.has_rewards else "no rewards"
    facts = f"{counted(len(episode), 'step')}, {earned}"
    drawing = '<p class="quiet">No step was taken.</p>'
    if len(episode):
        drawing = _drawn(episode, schema, ends)
    return (
        f'<article class="{"kept" if episode.kept else "discarded"}"><h3>Episode {number}: '
        f'<span class="result{mood}">{escape(result)}</span> {shown}</h3>'
        f'<p class="quiet">{facts}</p>{drawing}</article>\n'
    )
