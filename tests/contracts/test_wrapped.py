"""Prose of the pages is wrapped at 100 columns; tables and code are not."""

import re
from pathlib import Path

from tests.contracts.documents import ROOT, pages

WIDTH = 100
FENCE = re.compile(r"^\s*(```|~~~)")
STAYS = re.compile(r"^\s*(\||<|!\[|\[[^\]]+\]:|    )")  # tables, html, pictures, targets, code


def prose(text: str) -> list[str]:
    """Return the lines of a page that are neither code nor a part of a table."""
    found, inside = [], False
    for line in text.splitlines():
        if FENCE.match(line):
            inside = not inside
        elif not inside and not STAYS.match(line):
            found.append(line)
    return found


def can_be_cut(line: str) -> bool:
    """Return whether a line has a blank outside of code and links before the limit."""
    plain = re.sub(r"`[^`]*`|\[[^\]]*\]\([^)]*\)", lambda m: m[0].replace(" ", "_"), line)
    return " " in plain.lstrip(" -*0123456789.")[: WIDTH - 4]


def test_prose_is_wrapped() -> None:
    long = [
        f"{path.relative_to(ROOT)}: {line[:60]}"
        for path in pages()
        if path.parent.name != "results"  # scripts write those
        for line in prose(path.read_text())
        if len(line) > WIDTH and can_be_cut(line)
    ]
    assert long == []


def test_a_long_line_is_seen() -> None:
    assert prose("a\n```\nb\n```\n| c |\nd") == ["a", "d"]
    assert can_be_cut("word " * 30)
    assert not can_be_cut("- `" + "word " * 30 + "`")


def test_pages_are_looked_at() -> None:
    assert Path(ROOT / "docs" / "learning.md") in pages()
