"""Draw how eutree is built: its layers, read from pyproject.toml, and how data flow through it.

The pages draw both while they are built (``{picture}`` in ``docs/conf.py``), so that the picture of
the layers cannot differ from what ``lint-imports`` checks.
"""

import importlib
import tomllib
from html import escape
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
WIDTH = 860


class Box(NamedTuple):
    """A box of the picture of the flow: where it is, and what it says."""

    x: int
    y: int
    title: str
    words: str
    kind: str  # "step" or "thing"


# Columns are 220 wide, rows 96 high; a step makes the thing that its arrow points to.
FLOW = {
    "env": Box(0, 0, "your environment", "Gymnasium, names, units", "thing"),
    "record": Box(1, 0, "record", "a person or a script acts", "step"),
    "demos": Box(2, 0, "Demonstrations", "episodes on disk", "thing"),
    "fit": Box(3, 0, "fit", "C4.5", "step"),
    "history": Box(1, 1, "history", "all transitions", "thing"),
    "learn": Box(2, 1, "learn", "EU-Tree, in the environment", "step"),
    "expert": Box(3, 1, "TreePolicy", "the expert tree", "thing"),
    "small": Box(0, 2, "TreePolicy", "small", "thing"),
    "compress": Box(1, 2, "compress", "fewer leaves, same decisions", "step"),
    "policy": Box(2, 2, "TreePolicy", "learned", "thing"),
    "export": Box(0, 3, "export", "C, ONNX, ST, SVG, ...", "step"),
    "edit": Box(1, 3, "edit", "rules, locks; learn goes on", "step"),
    "ask": Box(2, 3, "show, why, diff, verify", "what it does, proven", "step"),
    "evaluate": Box(3, 3, "evaluate", "how good, with intervals", "step"),
}
ARROWS = [
    ("env", "record"),
    ("record", "demos"),
    ("demos", "fit"),
    ("fit", "expert"),
    ("demos", "learn"),
    ("expert", "learn"),
    ("learn", "history"),
    ("learn", "policy"),
    ("history", "compress"),
    ("policy", "compress"),
    ("compress", "small"),
    ("small", "export"),
    ("small", "edit"),
    ("policy", "ask"),
    ("policy", "evaluate"),
]


def layers() -> list[list[tuple[str, str]]]:
    """Return the rows of packages from top to bottom, each with its first line of documentation."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    rows = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    return [[(name, _first_line(name)) for name in row.split(" | ")] for row in rows]


def _first_line(name: str) -> str:
    text = importlib.import_module(f"eutree.{name}").__doc__ or ""
    return text.strip().splitlines()[0].rstrip(".").replace("``", "")


def layers_html() -> str:
    """Return the layers as nested boxes, a row of packages each."""
    rows = "".join(
        "<tr>"
        + "".join(
            f'<td colspan="{60 // len(row)}"><strong>{name}</strong><br>{escape(words)}</td>'
            for name, words in row
        )
        + "</tr>"
        for row in layers()
    )
    return f'<table class="layers"><tbody>{rows}</tbody></table>'


def flow_svg() -> str:
    """Return the picture of the flow of data, in the page's own colours."""
    boxes = "".join(_box(box) for box in FLOW.values())
    arrows = "".join(_arrow(FLOW[a], FLOW[b]) for a, b in ARROWS)
    return (
        f'<div class="flow-frame"><svg class="flow" viewBox="0 0 {WIDTH} 400" role="img" '
        'aria-label="From an environment by demonstrations, fitting and learning to a small '
        'tree that is verified, edited and exported" font-family="inherit">'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0 8 4 0 8z" fill="currentColor"/></marker>'
        f"</defs>{arrows}{boxes}</svg></div>"
    )


def _place(box: Box) -> tuple[int, int]:
    return 4 + 218 * box.x, 8 + 104 * box.y


def _box(box: Box) -> str:
    x, y = _place(box)
    look = 'rx="6" fill="#2f6f9f" fill-opacity=".16"' if box.kind == "step" else 'fill="none"'
    return (
        f'<rect x="{x}" y="{y}" width="190" height="56" {look} stroke="currentColor"/>'
        f'<text x="{x + 95}" y="{y + 24}" text-anchor="middle" font-size="15" '
        f'font-weight="600" fill="currentColor">{escape(box.title)}</text>'
        f'<text x="{x + 95}" y="{y + 43}" text-anchor="middle" font-size="12" '
        f'fill="currentColor">{escape(box.words)}</text>'
    )


def _arrow(start: Box, end: Box) -> str:
    (x, y), (u, v) = _place(start), _place(end)
    if start.y == end.y:
        right = end.x > start.x
        ends = (x + 190, y + 28, u - 2, v + 28) if right else (x, y + 28, u + 192, v + 28)
    else:
        ends = (x + 95, y + 56, u + 95 + 40 * ((start.x > end.x) - (start.x < end.x)), v - 2)
    return (
        f'<line x1="{ends[0]}" y1="{ends[1]}" x2="{ends[2]}" y2="{ends[3]}" '
        'stroke="currentColor" stroke-opacity=".7" marker-end="url(#tip)"/>'
    )
