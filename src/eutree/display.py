"""What notebooks show: objects of this package as HTML, drawn by the top of the package.

A policy or an evaluation must not import the pages that show it. The package root, which may
import everything, says where the drawing is (``draw_with``); it is loaded when a notebook asks.
"""

from collections.abc import Callable
from typing import Any

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
