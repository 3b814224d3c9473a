"""What notebooks show: objects of this package as HTML, drawn by the top of the package.

A policy or an evaluation must not import the pages that show it, so the module that draws is
loaded by its name, when a notebook asks.
"""

from importlib import import_module
from typing import Any


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
    return import_module("eutree.report.notebook")
