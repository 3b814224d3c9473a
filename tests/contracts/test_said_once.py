"""What was measured is said on its page of results, and on one other page at most."""

import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
# A mean with its interval, of at least three digits: hardly the same by accident.
MEAN = re.compile(r"(?<![\w.\-])(-?\d{2,}\.\d)(?: %)? (?:\[|\(-?\d+\.\d to )")
OTHERWISE = {  # said on two pages, and why
    "-100.5": "ends of the intervals of two MountainCar trees: not the same figure",
    "500.0": "the most that CartPole pays: an end of an interval, and what a tree of the zoo earns",
    "92.6": "a return of the default, and the worst agreement of C4.5: not the same figure",
    "98.7": "of the expert tree, and of the default in the first table: not the same figure",
    "99.4": "of a scripted expert, and an end of the tutorial's interval: not the same figure",
    "99.7": "of raw numbers, of a tree of the zoo, of a case of the default: not the same figure",
    "99.9": "of a scripted expert and of the tutorial's pump: not the same figure",
}


def measured() -> set[str]:
    return {value for page in RESULTS.glob("*.md") for value in MEAN.findall(page.read_text())}


def said_on() -> dict[str, list[str]]:
    """Return the pages that say each measured figure."""
    found = defaultdict(list)
    texts = {page.name: page.read_text() for page in PAGES}
    for value in measured():
        here = re.compile(rf"(?<![\w.\-]){re.escape(value)}(?!\.?\d)")
        found[value] = [name for name, text in texts.items() if here.search(text)]
    return found


def test_figures_are_found() -> None:
    assert len(measured()) > 100
    assert sum(bool(pages) for pages in said_on().values()) > 10


def test_each_figure_is_said_once_outside_of_its_results() -> None:
    twice = {value: pages for value, pages in said_on().items() if len(pages) > 1}
    assert {value: pages for value, pages in twice.items() if value not in OTHERWISE} == {}
    assert OTHERWISE.keys() <= twice.keys(), "an exception that is needed no more"


@pytest.mark.parametrize("page", ["good-for.md", "decisions/default-learner.md"])
def test_what_two_pages_say_of_the_default_learner_is_what_was_measured(page: str) -> None:
    text = (ROOT / "docs" / page).read_text()
    page_of_results = (RESULTS / "default-learner.md").read_text()
    (row,) = re.findall(r"^\| (?:the )?default[^|]*\| 9[89].*\|$", text, re.MULTILINE)
    for value in re.findall(r"\d+\.\d", row)[:3]:
        assert re.search(rf"(?<![\d.]){re.escape(value)}(?!\d)", page_of_results), (page, value)
