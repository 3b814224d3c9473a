"""Prose of the pages is wrapped at 100 columns; tables and code are not."""

import importlib.util
import re
from pathlib import Path

import pytest

from tests.contracts.documents import ROOT, pages

WIDTH = 100
FENCE = re.compile(r"^\s*(```|~~~)")
STAYS = re.compile(r"^\s*(\||<|!\[|\[[^\]]+\]:|    )")  # tables, html, pictures, targets, code


spec = importlib.util.spec_from_file_location("wrapping", ROOT / "docs/results/wrapping.py")
assert spec is not None
assert spec.loader is not None
wrapping = importlib.util.module_from_spec(spec)
spec.loader.exec_module(wrapping)


def wrapped_pages() -> list[Path]:
    """Return the pages, the changelog and what the next release adds to it."""
    return [*pages(), ROOT / "CHANGELOG.md", *sorted((ROOT / "changelog.d").glob("*.md"))]


def prose(text: str) -> list[str]:
    """Return the lines of a page that are neither code, a part of a table nor its provenance."""
    found, inside = [], False
    if text.startswith("---\n"):
        text = text.split("---\n", 2)[2]
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
        for path in wrapped_pages()
        for line in prose(path.read_text())
        if len(line) > WIDTH and can_be_cut(line)
    ]
    assert long == []


def test_a_long_line_is_seen() -> None:
    assert prose("a\n```\nb\n```\n| c |\nd") == ["a", "d"]
    assert can_be_cut("word " * 30)
    assert not can_be_cut("- `" + "word " * 30 + "`")


def test_pages_are_looked_at() -> None:
    assert ROOT / "docs" / "learning.md" in wrapped_pages()
    assert ROOT / "docs" / "results" / "house.md" in wrapped_pages()
    assert ROOT / "CHANGELOG.md" in wrapped_pages()


LONG = " ".join(["word"] * 30)


@pytest.mark.parametrize(
    "text",
    [
        f"| {LONG} |",
        f"```text\n{LONG}\n```",
        f"    {LONG}",
        f"# {LONG}",
        f"![{LONG}](a.png)",
        f"[a]: {LONG}",
        f"---\ncommand: {LONG}\n---\n",
        f"`{LONG}`",
        f"[{LONG}](page.md)",
        "short\nlines\nstay",
        f"a break  \n{LONG}",
    ],
)
def test_what_stays_when_a_page_is_wrapped(text: str) -> None:
    assert wrapping.wrapped(text) == text


@pytest.mark.parametrize("mark", ["", "- ", "  * ", "12. "])
def test_prose_of_a_page_is_wrapped(mark: str) -> None:
    told = wrapping.wrapped(f"before\n\n{mark}{LONG}\n\nafter\n")
    assert max(map(len, told.splitlines())) <= WIDTH
    assert told.split() == f"before {mark} {LONG} after".split()
    assert told.splitlines()[3].startswith(" " * len(mark) + "word")
    assert wrapping.wrapped(told) == told


def test_no_line_begins_with_a_mark_that_was_none() -> None:
    told = wrapping.wrapped(" ".join(["word - 1. # :"] * 20))
    assert [line for line in told.splitlines() if not line.startswith("word")] == []
