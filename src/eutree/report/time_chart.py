"""One episode as inline SVG: its observation features over time, and its actions below them.

Features with the same unit share a panel, so the position of a task and those of its opponents are
seen against each other; a feature without a unit has a panel to itself.
"""

from html import escape

import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.report.chart import ticks
from eutree.schema import Schema

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
