"""Where demonstrations were, as inline SVG: a histogram of one feature, a map of two."""

from html import escape

import numpy as np

from eutree.data.coverage import GRID_BINS, CoverageMap, Histogram
from eutree.schema import Feature, Schema

_STYLES = 5
_WIDTH, _HEIGHT = 420.0, 150.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 56.0, 10.0, 8.0, 24.0
_SIDE = 420.0  # of the map
_FAINT = 0.25  # a cell visited once


def histogram_chart(histogram: Histogram, schema: Schema) -> str:
    """Return the bars of one feature, divided by action."""
    feature = schema.features[histogram.feature]
    highest = max(int(histogram.counts.sum(axis=1).max()), 1)
    width = (_WIDTH - _LEFT - _RIGHT) / GRID_BINS
    visited = int((histogram.counts.sum(axis=1) > 0).sum())
    label = f"{feature.name}: {visited} of {GRID_BINS} bins visited"
    lines = [
        f'<svg class="chart" viewBox="0 0 {_WIDTH:.0f} {_HEIGHT:.0f}" role="img" '
        f'aria-label="{escape(label)}">',
        f'<text x="{_LEFT - 6}" y="{_TOP + 8}" text-anchor="end">{highest}</text>',
    ]
    edges = np.linspace(histogram.low, histogram.high, GRID_BINS + 1)
    for place, counts in enumerate(histogram.counts.tolist()):
        top, parts = _HEIGHT - _BOTTOM, []
        for action, count in enumerate(counts):
            height = count / highest * (_HEIGHT - _TOP - _BOTTOM)
            top -= height
            if count:
                parts.append(
                    f'<rect class="action-{action % _STYLES}" x="{_LEFT + place * width + 1:.1f}" '
                    f'y="{top:.1f}" width="{width - 2:.1f}" height="{height:.1f}"/>'
                )
        if parts:
            said = f"{edges[place]:.4g} to {edges[place + 1]:.4g}: {_said(counts, schema)}"
            lines.append(f"<g>{''.join(parts)}<title>{escape(said)}</title></g>")
    bottom = _HEIGHT - _BOTTOM
    lines.append(
        f'<line class="axis" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{bottom}" y2="{bottom}"/>'
        f'<text x="{_LEFT}" y="{bottom + 15}">{histogram.low:.3g}</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="{bottom + 15}" text-anchor="end">{histogram.high:.3g}'
        "</text>"
    )
    return "\n".join([*lines, "</svg>"])


def map_chart(coverage: CoverageMap, x: Histogram, y: Histogram, schema: Schema) -> str:
    """Return the map: the hue of a cell is its most frequent action, its strength the visits.

    A dot marks a cell in which more than one action was taken.
    """
    visits = coverage.counts.sum(axis=2)
    most = max(int(visits.max()), 1)
    names = [schema.features[j].name for j in coverage.features]
    label = f"{names[0]} across, {names[1]} upwards: {coverage.share:.0%} of the cells visited"
    side = (_SIDE - _LEFT - _RIGHT) / GRID_BINS
    bottom = _TOP + side * GRID_BINS
    lines = [
        f'<svg class="chart map" viewBox="0 0 {_SIDE:.0f} {bottom + 40:.0f}" role="img" '
        f'aria-label="{escape(label)}"><rect class="row" x="{_LEFT}" y="{_TOP}" '
        f'width="{side * GRID_BINS:.1f}" height="{side * GRID_BINS:.1f}"/>'
    ]
    for i, j in np.argwhere(visits > 0).tolist():
        counts = coverage.counts[i, j]
        strength = _FAINT + (1 - _FAINT) * np.log1p(visits[i, j] - 1) / max(np.log1p(most - 1), 1)
        left, top = _LEFT + i * side, bottom - (j + 1) * side
        lines.append(
            f'<rect class="action-{int(counts.argmax()) % _STYLES}" x="{left:.1f}" y="{top:.1f}" '
            f'width="{side:.1f}" height="{side:.1f}" fill-opacity="{min(strength, 1):.2f}">'
            f"<title>{escape(_said(counts.tolist(), schema))}</title></rect>"
        )
        if (counts > 0).sum() > 1:
            lines.append(
                f'<circle class="dot" cx="{left + side / 2:.1f}" cy="{top + side / 2:.1f}" r="3"/>'
            )
    lines += [
        f'<text x="{_LEFT}" y="{bottom + 15:.1f}">{x.low:.3g}</text>'
        f'<text x="{_SIDE - _RIGHT}" y="{bottom + 15:.1f}" text-anchor="end">{x.high:.3g}</text>'
        f'<text x="{(_LEFT + _SIDE - _RIGHT) / 2:.1f}" y="{bottom + 30:.1f}" '
        f'text-anchor="middle">{escape(_titled(schema.features[x.feature]))}</text>',
        f'<text x="{_LEFT - 6}" y="{bottom:.1f}" text-anchor="end">{y.low:.3g}</text>'
        f'<text x="{_LEFT - 6}" y="{_TOP + 10}" text-anchor="end">{y.high:.3g}</text>'
        f'<text transform="translate(14 {(_TOP + bottom) / 2:.1f}) rotate(-90)" '
        f'text-anchor="middle">{escape(_titled(schema.features[y.feature]))}</text>',
    ]
    return "\n".join([*lines, "</svg>"])


def action_legend(schema: Schema) -> str:
    """Return the list of actions with the hue of each."""
    entries = (
        f'<li><svg width="14" height="12" aria-hidden="true"><rect class="action-'
        f'{action % _STYLES}" width="14" height="12" rx="2"/></svg>{escape(name)}</li>'
        for action, name in enumerate(schema.actions)
    )
    return f'<ul class="legend">{"".join(entries)}</ul>'


def _titled(feature: Feature) -> str:
    return f"{feature.name} [{feature.unit}]" if feature.unit else feature.name


def _said(counts: list[int], schema: Schema) -> str:
    """Return counts as text: "stop (3), go (1)"."""
    return ", ".join(f"{schema.actions[a]} ({count})" for a, count in enumerate(counts) if count)
