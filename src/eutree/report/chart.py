"""Learning curves as inline SVG: a line for each learner, its interval as a band."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from eutree.compression.episodes import FrontEntry
from eutree.display import counted
from eutree.evaluation import CurvePoint
from eutree.export import to_svg
from eutree.inspection import diff
from eutree.report.html import figure, scrolling

# Of each learner: episode, mean, and both ends of the interval.
Points = Sequence[tuple[float, float, float, float]]
Series = Mapping[str, Points]

_WIDTH, _HEIGHT, _LOW = 420.0, 250.0, 150.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 58.0, 10.0, 10.0, 36.0
STYLES = 5
_LEAST = 0.1  # of the largest value: the least span of an axis
_MEASURES = {"success_rate": "success rate", "mean_return": "return", "n_leaves": "leaves"}
CHANGES = 6  # boxes that are named of each step


@dataclass(frozen=True)
class _Plane:
    """Where values lie in a drawing, by the round numbers on both of its axes."""

    x_ticks: list[float]
    y_ticks: list[float]
    height: float = _HEIGHT

    def x(self, value: float) -> float:
        share = (value - self.x_ticks[0]) / (self.x_ticks[-1] - self.x_ticks[0])
        return _LEFT + share * (_WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        inside = min(max(value, self.y_ticks[0]), self.y_ticks[-1])
        share = (inside - self.y_ticks[0]) / (self.y_ticks[-1] - self.y_ticks[0])
        return self.height - _BOTTOM - share * (self.height - _TOP - _BOTTOM)

    def frame(self, label: str, x_title: str, y_labels: Sequence[str]) -> list[str]:
        """Return the beginning of the drawing: the words for a screen reader, grid and axis."""
        bottom = self.height - _BOTTOM
        return [
            f'<svg class="chart" viewBox="0 0 {_WIDTH:.0f} {self.height:.0f}" role="img" '
            f'aria-label="{escape(label)}">',
            *(
                f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{self.y(tick):.1f}" '
                f'y2="{self.y(tick):.1f}"/><text x="{_LEFT - 6}" y="{self.y(tick) + 4:.1f}" '
                f'text-anchor="end">{escape(words)}</text>'
                for tick, words in zip(self.y_ticks, y_labels, strict=True)
            ),
            *(
                f'<text x="{self.x(tick):.1f}" y="{bottom + 15:.1f}" '
                f'text-anchor="middle">{_number(tick, False)}</text>'
                for tick in self.x_ticks
            ),
            f'<line class="axis" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{bottom}" y2="{bottom}"/>'
            f'<text x="{(_LEFT + _WIDTH) / 2:.0f}" y="{self.height - 4}" text-anchor="middle">'
            f"{escape(x_title)}</text>",
        ]


def chart(
    title: str,
    series: Series,
    *,
    over: str = "episodes",
    percent: bool = False,
    whole: bool = False,
    ends: tuple[float, float] | None = None,
    names: Sequence[str] = (),
) -> str:
    """Return one chart of several series over episodes, or over something else.

    Args:
        title: The name of the measure; said by screen readers together with each last value.
        series: Points of each learner, in the order of their episodes.
        over: The name of the horizontal axis.
        percent: Whether the values are shares, to be shown as percentages.
        whole: Whether they are counts, of which there are no halves.
        ends: Of the axis, of one of several charts, which are low; else those of the series.
        names: The names of the values 0, 1, ...
    """
    points = [point for entries in series.values() for point in entries]
    if not points:
        return f'<p class="quiet">No {escape(title)} was recorded.</p>'
    seen = min(p[2] for p in points), max(p[3] for p in points)
    plane = _Plane(
        ticks(min(p[0] for p in points), max(p[0] for p in points), whole=True),
        _shares(*seen) if percent else ticks(*(ends or _with_room(*seen)), whole=whole),
        _HEIGHT if ends is None else _LOW,
    )

    def said(value: float) -> str:
        if not names:
            return _number(value, percent)
        return names[int(value)] if 0 <= value < len(names) else ""

    last = ", ".join(
        f"{name} ends at {said(entries[-1][1])}" for name, entries in series.items() if entries
    )
    lines = plane.frame(f"{title} over {over}: {last}", over, [*map(said, plane.y_ticks)])
    for number, entries in enumerate(series.values()):
        style = number % STYLES
        middle, lower, upper = (
            [f"{plane.x(p[0]):.1f},{plane.y(p[end]):.1f}" for p in entries] for end in (1, 2, 3)
        )
        if upper != lower:
            band = " ".join(upper + lower[::-1])
            lines.append(f'<polygon class="band series-{style}" points="{band}"/>')
        lines.append(
            f'<polyline class="curve series-{style} dash-{style}" points="{" ".join(middle)}"/>'
        )
    return "\n".join([*lines, "</svg>"])


def line(points: Iterable[tuple[float, float]]) -> Points:
    """Return the points of a line without an interval."""
    return [(float(x), *3 * (float(y),)) for x, y in points]


def curves(learners: Mapping[str, Sequence[CurvePoint]]) -> dict[str, Series]:
    """Return success, return and leaves of learners by the name of the measure.

    A measure that is not known at every point is left out.
    """
    return {
        measure: {
            learner: line((p.episode, getattr(p, name)) for p in points)
            for learner, points in learners.items()
        }
        for name, measure in _MEASURES.items()
        if all(getattr(p, name) is not None for points in learners.values() for p in points)
    }


def curve_figures(curves: Mapping[str, Series]) -> list[str]:
    """Return a chart of each measure with its title; success rates are percentages."""
    return [
        figure(
            measure.capitalize(),
            chart(measure, series, percent=measure == "success rate", whole=measure == "leaves"),
        )
        for measure, series in curves.items()
    ]


def scatter(
    x_title: str, y_title: str, points: Sequence[tuple[float, float, str]], *, percent: bool = False
) -> str:
    """Return a chart of single points, whose names are shown under the pointer.

    With ``percent`` the values upwards are shares, to be shown as percentages.
    """
    across, up, _ = zip(*points, strict=True)
    plane = _Plane(
        ticks(min(across), max(across), whole=all(float(x).is_integer() for x in across)),
        _shares(min(up), max(up)) if percent else ticks(min(up), max(up)),
    )
    drawn = (
        f'<circle class="point" cx="{plane.x(x):.1f}" cy="{plane.y(y):.1f}" r="4.5">'
        f"<title>{escape(name)}</title></circle>"
        for x, y, name in points
    )
    said = f"{y_title} against {x_title} of {len(points)}"
    frame = plane.frame(said, x_title, [_number(tick, percent) for tick in plane.y_ticks])
    return "\n".join([*frame, *drawn, "</svg>"])


def legend(names: Sequence[str], styles: Sequence[int] | None = None) -> str:
    """Return the list of learners, or of other things drawn, with the line of each.

    The styles of the lines are by default one after the other.
    """
    styles = styles or [k % STYLES for k in range(len(names))]
    entries = (
        f'<li><svg width="34" height="8" aria-hidden="true"><line class="curve series-{style} '
        f'dash-{style}" x1="0" x2="34" y1="4" y2="4" stroke-width="2.4"/></svg>{escape(name)}</li>'
        for name, style in zip(names, styles, strict=True)
    )
    return f'<ul class="legend">{"".join(entries)}</ul>'


def ticks(low: float, high: float, *, whole: bool = False) -> list[float]:
    """Return round numbers, evenly spaced, that enclose the interval; ``whole`` ones if asked."""
    if high <= low:
        low, high = low - 0.5, low + 0.5
    raw = max((high - low) / 5, 1.0 if whole else 0.0)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * factor for factor in (1.0, 2.0, 2.5, 5.0, 10.0)
                if power * factor >= raw and not (whole and power * factor % 1))  # fmt: skip
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [number * step for number in range(first, last + 1)]


def _with_room(low: float, high: float) -> tuple[float, float]:
    """Return the interval, wide enough that a flat line looks flat."""
    missing = _LEAST * max(abs(low), abs(high)) - (high - low)
    if missing <= 0.0:
        return low, high
    return (low - missing / 2 if low < 0.0 else max(0.0, low - missing / 2)), high + missing / 2


def _shares(low: float, high: float) -> list[float]:
    """Return round shares from 0 to 1 that enclose the interval."""
    inside = max(0.0, min(low, 0.9)), min(1.0, max(high, 0.1))
    return [min(max(tick, 0.0), 1.0) for tick in ticks(*inside)]


def _number(value: float, percent: bool) -> str:
    """Return a number as people write it on an axis."""
    return f"{100 * value:.4g} %" if percent else f"{value:.4g}"


def front_in_words(front: Sequence[FrontEntry]) -> str:
    """Return the mean return of each size, in a line."""
    return "; ".join(f"{counted(one.policy.n_leaves, 'leaf')}: {_earned(one)}" for one in front)


def front_section(front: Sequence[FrontEntry], picked: int | None) -> str:
    """Return the charts of a front, and its trees, of which one is open at a time.

    It begins with the learned tree, the largest; ``picked`` are the leaves of the one picked.
    """
    walk = "".join(
        _step(front[max(number - 1, 0)], one, _name(number, one, picked))
        for number, one in enumerate(front)
    )
    words = (
        "The best tree of each size, all of them in the same episodes, which chose none of them. "
        "Open one to see it, what it decides otherwise than the one before, and what that costs."
    )
    return (
        f'<p class="quiet">{words}</p><div class="charts">{"".join(front_charts(front))}</div>\n'
        f'<div class="front">{walk}</div>'
    )


def front_charts(front: Sequence[FrontEntry]) -> list[str]:
    """Return the return of each size, and its share of successes where that is reported, drawn."""
    charts = []
    for measure, of, percent in (
        ("mean return", "mean_return", False),
        ("share of successes", "success_rate", True),
    ):
        points = [
            (float(leaves), value, f"{counted(leaves, 'leaf')}: {_number(value, percent)}")
            for leaves, value in [(one.policy.n_leaves, getattr(one, of)) for one in front]
            if value is not None
        ]
        if points:
            drawing = scatter("leaves", measure, points, percent=percent)
            charts.append(figure(f"{measure.capitalize()} by leaves", drawing))
    return charts


def _name(number: int, one: FrontEntry, picked: int | None) -> str:
    if number == 0:
        return ", as learned"
    return ", the pick" if one.policy.n_leaves == picked else ""


def _step(larger: FrontEntry, one: FrontEntry, name: str) -> str:
    """Return a tree, folded, with the changes from its larger neighbour."""
    title = f"{counted(one.policy.n_leaves, 'leaf')}{name}: {_earned(one)}"
    changed = "" if one is larger else _changed(larger, one)
    label = f"{counted(one.policy.n_leaves, 'leaf')}{name}, drawn"
    drawing = scrolling(label, to_svg(one.policy, standalone=False), kind="tree")
    return f'<details name="front"><summary>{escape(title)}</summary>{changed}{drawing}</details>\n'


def _changed(larger: FrontEntry, one: FrontEntry) -> str:
    """Return the cost of a tree beside its larger neighbour, and where it decides otherwise."""
    found = diff(larger.policy, one.policy)
    cost, n = one.mean_return - larger.mean_return, larger.policy.n_leaves - one.policy.n_leaves
    words = (
        f"{cost:+.2f} return with {abs(n)} {'fewer' if n > 0 else 'more'} "
        f"{'leaf' if abs(n) == 1 else 'leaves'}; "
        f"another action on {found.share:.2%} of the observation box."
    )
    boxes = "".join(f"<li>{escape(box.words)}</li>" for box in found.boxes[:CHANGES])
    more = len(found.boxes) - CHANGES
    boxes += f"<li>and {more} smaller {'box' if more == 1 else 'boxes'}</li>" if more > 0 else ""
    return f"<p>{escape(words)}</p><ul>{boxes}</ul>"


def _earned(one: FrontEntry) -> str:
    success = "" if one.success_rate is None else f"{one.success_rate:.1%} success, "
    return f"{success}return {one.return_interval.around(one.mean_return, 2)}"
