"""The map of the paper points at symbols and tests that exist."""

import importlib
import re
from pathlib import Path
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).parents[2]


class Row(NamedTuple):
    """One row of docs/paper.md."""

    paper: str
    what: str
    symbols: list[str]
    tests: list[str]
    status: str


def rows() -> list[Row]:
    text = (ROOT / "docs" / "paper.md").read_text()
    cells = [[cell.strip() for cell in line.split(" | ")] for line in text.splitlines()]
    return [
        Row(
            row[0].strip("| "),
            row[1],
            re.findall(r"`(eutree[\w.]*)`", row[2]),
            re.findall(r"`(tests/[^`]+)`", row[3]),
            row[4].strip("| "),
        )
        for row in cells
        if len(row) == 5 and row[0] != "| paper"
    ]


def resolve(symbol: str) -> Any:
    """Import the longest module in a dotted path and walk the rest."""
    parts = symbol.split(".")
    value: Any = importlib.import_module(parts[0])
    for position, part in enumerate(parts[1:], start=2):
        try:
            value = getattr(value, part)
        except AttributeError:
            value = importlib.import_module(".".join(parts[:position]))
    return value


DONE = [row for row in rows() if row.status == "done"]


def test_map_covers_the_paper() -> None:
    papers = {row.paper for row in rows()}
    assert papers >= {f"Eq. {n}" for n in range(1, 7)}
    assert papers >= {*(f"Figure {n}" for n in range(1, 6)), "Table 2"}
    assert sum(name.startswith(("Init", "Gath", "Expa")) for name in papers) == 13
    assert {row.status for row in rows()} <= {"done", "planned"}


@pytest.mark.parametrize("row", DONE, ids=lambda row: row.paper)
def test_symbols_and_tests_exist(row: Row) -> None:
    assert row.symbols
    assert row.tests
    for symbol in row.symbols:
        resolve(symbol)
    for test in row.tests:
        path, _, name = test.partition("::")
        assert (ROOT / path).exists(), test
        assert f"def {name}" in (ROOT / path).read_text() if name else True, test


def test_equations_cited_in_the_source_have_a_row() -> None:
    cited = {
        number
        for path in (ROOT / "src").rglob("*.py")
        for group in re.findall(r"Eqs?\. (\d)((?:(?:, | and | to )\d)*)", path.read_text())
        for number in re.findall(r"\d", "".join(group))
    }
    assert cited <= {row.paper.removeprefix("Eq. ") for row in rows()}
