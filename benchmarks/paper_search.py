"""Tables of the search for the domain and the reading of the paper, from the table it made.

    python -m benchmarks.paper_search [--write]

Reads docs/results/search.csv: a row each setting, with its choices and its numbers. Prints the
nearest settings, each number, and which numbers exclude which; ``--write`` puts these sections into
docs/results/search.md. The runs themselves were those of commit 0b5bbdb, where ``eutree reproduce
search`` did them.
"""

import argparse
import csv
import re
from itertools import combinations
from pathlib import Path

from benchmarks.paper_numbers import NUMBERS, Number

RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"
ABOUT = {"setting", "stage", "runs", "final", "mean_cost", "agreeing", "told", "digest"}
SHOWN = 6  # settings side by side
LISTED = 8  # settings that are named beside a number
LEAST_TRIED = 3  # settings that must have told both numbers before they can exclude each other
Row = dict[str, str]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write docs/results/search.md")
    options = parser.parse_args()
    page = RESULTS / "search.md"
    with (RESULTS / "search.csv").open(encoding="utf-8", newline="") as file:
        sections = tables(list(csv.DictReader(file)))
    if not options.write:
        print("\n\n".join(sections))
        return
    text = page.read_text(encoding="utf-8")
    for section in sections:
        title = re.escape(section.splitlines()[0])
        text = re.sub(rf"^{title}\n.*?(?=^## )", lambda _, s=section: f"{s}\n\n", text,
                      flags=re.DOTALL | re.MULTILINE)  # fmt: skip
    page.write_text(text, encoding="utf-8")


def tables(rows: list[Row]) -> list[str]:
    """Return the sections that can be made of the settings, nearest first."""
    return [nearest(rows[:SHOWN]), each_number(rows), exclusions(rows)]


def agrees(row: Row, number: Number) -> bool:
    return bool(row[number.name]) and number.missed_by(float(row[number.name])) == 0.0


def nearest(rows: list[Row]) -> str:
    lines = []
    known = {number.name for number in NUMBERS}
    for name in (name for name in rows[0] if name not in ABOUT | known):
        if any(row[name] for row in rows):
            lines.append([f"`{name}`", "", *(row[name] for row in rows)])
    lines.append(["final policy", "", *(row["final"] for row in rows)])
    lines.append(["runs", "", *(row["runs"] for row in rows)])
    agreeing = (f"{row['agreeing']} of {row['told']}" for row in rows)
    lines.append(["**numbers that agree**", "", *agreeing])
    for number in NUMBERS:
        shown = [f"{float(row[number.name]):.3g}" if row[number.name] else "" for row in rows]
        bold = [f"**{v}**" if agrees(r, number) else v for r, v in zip(rows, shown, strict=True)]
        lines.append([number.name, number.paper, *bold])
    head = ["", "paper", *(str(i) for i in range(1, len(rows) + 1))]
    text = "## The nearest settings\n\nA number in bold agrees with the paper's.\n\n"
    return text + table(head, lines)


def each_number(rows: list[Row]) -> str:
    lines = []
    for number in NUMBERS:
        told = [row for row in rows if row[number.name]]
        best = min(
            told,
            key=lambda row: (number.missed_by(float(row[number.name])), -int(row["agreeing"])),
        )
        agree = [row for row in told if agrees(row, number)]
        lines.append(
            [number.name, number.paper, span(number), str(len(told)), str(len(agree)),
             f"{float(best[number.name]):.3g} (setting {best['setting']})",
             places(agree) if agree else "none"]
        )  # fmt: skip
    head = ["number", "paper", "agrees if", "settings that tell", "that agree", "nearest",
            "settings under which it agrees"]  # fmt: skip
    return "## Each number\n\n" + table(head, lines)


def places(agree: list[Row]) -> str:
    """Return which settings agree: those that learned, else those that did not."""
    learned = [row["setting"] for row in agree if row["untried"]]
    named = (learned or [row["setting"] for row in agree])[:LISTED]
    rest = len(agree) - len(named)
    return ", ".join(named) + (f" and {rest} more" if rest else "")


def exclusions(rows: list[Row]) -> str:
    lines = []
    for first, second in combinations(NUMBERS, 2):
        both = [row for row in rows if row[first.name] and row[second.name]]
        here = [agrees(row, first) for row in both]
        there = [agrees(row, second) for row in both]
        together = any(a and b for a, b in zip(here, there, strict=True))
        if len(both) >= LEAST_TRIED and any(here) and any(there) and not together:
            counts = (len(both), sum(here), sum(there))
            lines.append([first.name, second.name, *map(str, counts)])
    head = ["number", "and", "settings that tell both", "first agrees", "second agrees"]
    text = "## Which numbers exclude which\n\nEach agrees under some setting, both under none.\n\n"
    return text + table(head, lines)


def span(number: Number) -> str:
    if number.low == -float("inf"):
        return f"<= {number.high:g}"
    if number.high == float("inf"):
        return f">= {number.low:g}"
    return f"{number.low:g} to {number.high:g}"


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


if __name__ == "__main__":
    main()
