"""Wrap the prose of Markdown pages at 100 columns; code, tables, links and headings stay.

python docs/results/wrapping.py docs/results/house.md CHANGELOG.md

A paragraph that has no longer line is left as it is.
"""

import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

WIDTH = 100
FENCE = re.compile(r"\s*(```|~~~|:::|\$\$)")
STAYS = re.compile(
    r"\s*(\||<|!\[|#|>|\[[^\]]+\]:|\Z)|    "
)  # also pictures, targets, code, nothing
ITEM = re.compile(r"(?:[-*+]|\d+[.)]) +")
HELD = re.compile(r"`[^`]*`|!?\[[^\]]*\]\([^)]*\)|\$[^$ ][^$]*\$")  # what is not cut at a blank
BLANK = "\0"


def paragraphs(text: str) -> Iterator[tuple[list[str], bool]]:
    """Yield the lines of a page in groups, with whether a group is a paragraph of prose."""
    lines = text.split("\n")
    head = lines.index("---", 1) + 1 if lines[0] == "---" else 0
    yield lines[:head], False
    group: list[str] = []
    inside = False
    for line in lines[head:]:
        fenced = FENCE.match(line) is not None
        if inside or fenced or STAYS.match(line):
            yield group, True
            yield [line], False
            group, inside = [], inside != fenced
        elif ITEM.match(line.lstrip()) or len(line) - len(line.lstrip()) < _indent(group):
            yield group, True
            group = [line]
        else:
            group.append(line)
    yield group, True


def _indent(group: list[str]) -> int:
    """Return how far a group's next line is indented at least."""
    return len(group[0]) - len(group[0].lstrip()) if group else 0


def wrapped(text: str) -> str:
    """Return a page with its long paragraphs wrapped."""
    found: list[str] = []
    for group, is_prose in paragraphs(text):
        long = is_prose and any(len(line) > WIDTH for line in group)
        found += _wrap(group) if long and not _has_breaks(group) else group
    return "\n".join(found)


def _has_breaks(group: list[str]) -> bool:
    return any(line.endswith(("  ", "\\")) for line in group[:-1])


def _wrap(group: list[str]) -> list[str]:
    first = group[0]
    indent = first[: len(first) - len(first.lstrip())]
    item = ITEM.match(first.lstrip())
    mark = item[0] if item else ""
    whole = " ".join(line.strip() for line in group)[len(mark) :]
    whole = HELD.sub(lambda found: found[0].replace(" ", BLANK), whole)
    whole = re.sub(r" (?=(?:[-+*#>|=:]+|\d+[.)])(?: |$))", BLANK, whole)
    lines = textwrap.wrap(
        whole,
        WIDTH,
        initial_indent=indent + mark,
        subsequent_indent=indent + " " * len(mark),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(BLANK, " ") for line in lines]


def main() -> None:
    """Wrap the files that are named."""
    for name in sys.argv[1:]:
        path = Path(name)
        path.write_text(wrapped(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
