"""How objects and numbers are shown: HTML in notebooks, the digits that matter, nouns that agree.

Numbers: as few digits as a reader needs, the exact ones are in the files.

Objects: a policy or an evaluation must not import the pages that show it. The package root, which
may import everything, says where the drawing is (``draw_with``); it is loaded when a notebook asks.
"""

import math
import sys
from collections.abc import Callable, Iterable
from typing import Any

_PLURALS = {"leaf": "leaves"}


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: ``1 leaf``, ``2 leaves``, ``0 episodes``."""
    return f"{count} {noun if count == 1 else _PLURALS.get(noun, noun + 's')}"


def fixed(digits: int, values: Iterable[float]) -> str:
    """Return a format with so many digits after the point, or more where all values are below 1.

    >>> f"{-0.0123:{fixed(1, [-0.0123, 0.002])}}"
    '-0.012'
    """
    largest = max(map(abs, values), default=0.0)
    more = -math.floor(math.log10(largest)) if 0.0 < largest < 1.0 else 0
    return f".{digits + more}f"


_load: Callable[[], Any] | None = None


def draw_with(load: Callable[[], Any]) -> None:
    """Take the loader of the module whose ``html_of`` and ``framed`` draw objects."""
    global _load
    _load = load


class Displayed:
    """An object that notebooks show as HTML; see ``eutree.report.notebook``."""

    def _repr_html_(self) -> str:
        """Return the object as a piece of HTML: escaped, self-contained, without a script."""
        html: str = _notebook().html_of(self)
        return html


def framed(drawing: str) -> str:
    """Return a drawing (SVG) as a piece of HTML for notebooks."""
    html: str = _notebook().framed(drawing)
    return html


def _notebook() -> Any:
    assert _load is not None  # noqa: S101 - the root of the package sets it while it is imported
    return _load()


SAME = 1e-6  # of a quantity's range: two values that are nearer are one
_TINY = 1e-12  # where nothing bounds a quantity
_HUGE = 1e30  # a bound beyond is none
_USUAL = 6  # digits after the point of which nothing is known
_NEAR = 0.1  # of itself: a number is shown at least so near,
_NOTHING = 1e-9  # or of its range


def usual_width(low: float, high: float, values: Iterable[float]) -> float:
    """Return over how wide a range the digits of a quantity's values matter.

    That is the range between its bounds, or ten times the largest of the values where this is
    less: where a speed may be 10 m/s and never is 0.3, hundredths matter. A range that the bounds,
    or ``_TINY`` without any, call 0 has no digits that matter.
    """
    width = high / 2 - low / 2 if max(-low, high) < _HUGE else math.inf
    sizes = [abs(value) for value in values if abs(value) < _HUGE]
    least = _TINY if math.isinf(width) else max(SAME * 2 * width, sys.float_info.min)
    return max(min(2 * width, 10 * max(sizes, default=width)), least)


def decimals_of(width: float) -> int:
    """Return how many digits after the point matter in a range: a thousandth of it is seen."""
    return _USUAL if math.isinf(width) else max(0, 3 - math.floor(math.log10(width)))


def number(value: float, decimals: int) -> str:
    """Return a number with at most so many digits after the point; there is no minus zero.

    >>> number(8.2578, 2), number(24.0, 2), number(-6e-17, 3)
    ('8.26', '24', '0')
    """
    return repr(round(float(value), decimals) + 0.0).removesuffix(".0")


def told_apart(values: Iterable[float], width: float, *, down: bool = False) -> dict[float, str]:
    """Return each value in as few digits as tell it from the others, and within a tenth of itself.

    Two that are nearer than a millionth of ``width``, the range over which their digits matter (see
    ``usual_width``), may look the same. Where they go ``down``, a number shown is at most the
    value, but for a millionth of the range: "at most 8.257" is shown as "at most 8.25", which is
    true.

    >>> told_apart([8.2578, 8.2581, 20.0], width=20.0)
    {8.2578: '8.2578', 8.2581: '8.2581', 20.0: '20'}
    """
    known = sorted(set(values))
    return {value: _told_apart(known, place, width, down=down) for place, value in enumerate(known)}


def _told_apart(known: list[float], place: int, width: float, *, down: bool) -> str:
    """Return a value so that it looks like none that is no nearer than a millionth."""
    value, decimals = known[place], decimals_of(width)
    lower = next((v for v in reversed(known[:place]) if value - v > SAME * width), -math.inf)
    upper = next((v for v in known[place + 1 :] if v - value > SAME * width), math.inf)
    most, near = decimals + sys.float_info.dig, max(_NEAR * abs(value), _NOTHING * width, _TINY)
    while True:
        texts = [_shown(v, decimals, SAME * width if down else math.inf) for v in (lower, upper)]
        text = _shown(value, decimals, SAME * width if down else math.inf)
        if (text not in texts and abs(float(text) - value) <= near) or decimals == most:
            return text
        decimals += 1


def _shown(value: float, decimals: int, above: float) -> str:
    """Return a rounded number that is at most so far above the value."""
    text = number(value, decimals)
    return text if float(text) <= value + above else number(float(text) - 10.0**-decimals, decimals)
