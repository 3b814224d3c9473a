"""Colours of actions: distinct for people with any colour vision, readable under dark text.

Levels of one quantity are an order, so theirs are one scale: from blue below 0 over grey to orange
above, or from grey to orange. Any other actions have a hue each.
"""

import colorsys

import numpy as np

from eutree.schema import Schema

# After Okabe and Ito, lightened until black text on each has a contrast of at least 7 to 1.
FILLS = (
    "#f6b26b",
    "#8ecae6",
    "#7fd1ae",
    "#f3e27a",
    "#d9a6e0",
    "#a9b8f5",
    "#f0a8a0",
    "#c9cfd6",
)
_BELOW, _MIDDLE, _ABOVE = (102, 178, 240), (214, 219, 224), (245, 160, 70)
_TURN, _LIGHT, _STRONG = 0.618, 0.8, 0.55  # of the hues after the first eight


def fills(schema: Schema) -> tuple[str, ...]:
    """Return the fill colour of each action's leaves."""
    if len(schema.controls) == 1:
        return _scale(schema.controls[0].levels)
    more = range(len(FILLS), schema.n_actions)
    return (*FILLS[: schema.n_actions], *map(_hue, more))


def _scale(levels: tuple[float, ...]) -> tuple[str, ...]:
    """Return the colours of some levels of a quantity, from low to high."""
    low, high = min(levels), max(levels)
    ends, anchors = [low, high], [_MIDDLE, _ABOVE]
    if low < 0.0 < high:
        ends, anchors = [low, 0.0, high], [_BELOW, _MIDDLE, _ABOVE]
    columns = np.array(anchors, dtype=np.float64).T
    return tuple(
        _hexadecimal([float(np.interp(level, ends, column)) for column in columns])
        for level in levels
    )


def _hue(number: int) -> str:
    """Return a hue far from those of the numbers before; some look much alike for a few people."""
    parts = colorsys.hls_to_rgb(number * _TURN % 1.0, _LIGHT, _STRONG)
    return _hexadecimal([255.0 * part for part in parts])


def _hexadecimal(parts: list[float]) -> str:
    return "#" + "".join(f"{round(part):02x}" for part in parts)
