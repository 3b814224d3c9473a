"""The page of demonstrations: whether more would help, and a picture of each episode."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.data.coverage import drawn_bounds
from eutree.data.summary import Summary, summarize
from eutree.evaluation.expert_curve import ExpertCurve, expert_curve
from eutree.report.head import head
from eutree.report.html import asset, page
from eutree.report.time_chart import MAX_FEATURES, panels, style_of, time_chart
from eutree.schema import Schema

MAX_EPISODES = 100


@dataclass(frozen=True, eq=False)
class DemonstrationFigures:
    """The figures of a summary.

    Attributes:
        summary: Results, coverage and groups of near-equal observations with several actions.
        curve: The learning curve of the expert tree; None with too few episodes.
    """

    summary: Summary
    curve: ExpertCurve | None

    @property
    def advice(self) -> str:
        """One or two sentences for the person who demonstrates."""
        if self.curve is None:
            return "Four episodes are needed to say whether more would help."
        return self.curve.advice


def demonstration_figures(demonstrations: Demonstrations) -> DemonstrationFigures:
    """Return all figures of a summary; the same demonstrations give the same figures."""
    return DemonstrationFigures(summarize(demonstrations), expert_curve(demonstrations))


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
    success = figures.summary.success_rate
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
    shared = [group for group in panels(schema) if len(group) > 1]
    keys = "".join(
        f'<li><svg width="34" height="8" aria-hidden="true"><line class="curve series-{style} '
        f'dash-{style}" x1="0" x2="34" y1="4" y2="4" stroke-width="2.4"/></svg>'
        f"{escape(schema.features[j].name)}</li>"
        for group in shared
        for j in group
        for style in (style_of(schema, j),)
    )
    rest = {
        "features": schema.n_features - MAX_FEATURES,
        "episodes": len(demonstrations.episodes) - MAX_EPISODES,
    }
    note = "".join(
        f'<p class="quiet">{count} further {name} are not drawn.</p>'
        for name, count in rest.items()
        if count > 0
    )
    key = f'<ul class="legend">{keys}</ul>' if keys else ""
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
