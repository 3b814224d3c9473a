"""The pages about the paper say what their tables say."""

import csv
import importlib.util
import sys
from pathlib import Path

import pytest
from benchmarks.paper_numbers import NUMBERS

from eutree.evaluation.evaluation import Estimate
from eutree_lab.paper.claims import judged

DOCS = Path(__file__).parents[3] / "docs"
SEARCHED = range(7000, 7004)  # seeds of the search: docs/results/search.md


def script(name, folder=DOCS / "pictures"):
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def page(tmp_path, monkeypatch):
    """The page's script, with a table of two settings: states agree in one, rewards in none."""
    module = script("make_paper_results")
    (tmp_path / "results").mkdir()
    table = tmp_path / "results" / "search.csv"
    names = [number.name for number in NUMBERS]
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, ["setting", *names])
        writer.writeheader()
        writer.writerow({"setting": 1, "C. U-Tree: states": 167, "C. U-Tree: reward": 90})
        writer.writerow({"setting": 2, "C. U-Tree: states": 8, "C. U-Tree: reward": 20})
    monkeypatch.setattr(module, "DOCS", tmp_path)
    return module


def test_the_first_paragraph_counts_verdicts_and_what_no_setting_reaches(page):
    row = "| `x/{}` | s | 1 | paper | 1 [1, 1] | **{}** | rule |"
    verdicts = ["holds", "holds", "does not hold", "cannot be told"]
    body = "\n".join(row.format(i, verdict) for i, verdict in enumerate(verdicts))
    text = " ".join(page._counts(body).split())
    assert "**With one reading and in one domain 2 of 4 claims hold, 1 do not hold" in text
    assert "1 cannot be told.** 2 settings of" in text
    assert "agree: C. U-Tree: reward (50), told by 2." in text
    assert "C. U-Tree: states" not in text


def test_the_kept_table_of_the_search_has_every_choice_and_every_number():
    with (DOCS / "results" / "search.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert set(rows[0]) >= {number.name for number in NUMBERS}
    assert len(rows) >= 100
    first = (DOCS / "results" / "search.md").read_text(encoding="utf-8")
    assert f"**{len(rows)} settings" in first
    assert f"agrees in {rows[0]['agreeing']}" in first


def test_the_judging_seeds_are_not_those_of_the_search():
    judged = script("make_paper_results").JUDGED
    assert not {*SEARCHED} & {*range(judged.first_seed, judged.first_seed + judged.runs)}


def test_the_tables_of_the_search_are_made_of_its_settings():
    tables = script("paper_search", DOCS.parent / "benchmarks").tables
    with (DOCS / "results" / "search.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    page = (DOCS / "results" / "search.md").read_text(encoding="utf-8")
    assert all(section in page for section in tables(rows))
    rows[0]["EU-Tree: states"] = "41"  # one more than agrees
    assert tables(rows)[0] not in page


@pytest.mark.parametrize(
    ("value", "interval", "times", "inside"),
    [
        (0.98, (0.94, 0.99), (0.04 / 0.03) ** 2, True),  # the lower end has to rise to 0.95
        (0.94, (0.92, 0.97), (0.03 / 0.01) ** 2, False),  # the upper end has to fall to 0.95
        (0.95, (0.90, 0.99), None, True),
        (0.99, (0.98, 1.0), None, True),  # told
    ],
)
def test_how_many_more_runs_would_tell_by_hand(value, interval, times, inside):
    claim = judged("x", "s", paper="1", estimate=Estimate(value, interval, 15), low=0.95, rule="r")
    assert claim.times == (None if times is None else pytest.approx(times))
    assert claim.is_inside == inside


def test_both_ends_have_to_be_cleared():
    estimate = Estimate(1.0, (-4.0, 7.0), 15)
    claim = judged("x", "s", paper="2", estimate=estimate, low=0.0, high=5.0, rule="r")
    assert claim.times == pytest.approx(25.0)
