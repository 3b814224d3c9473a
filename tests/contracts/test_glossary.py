"""Each term of art that a page of the guide or the README uses is explained in the glossary."""

import re

import pytest

from tests.contracts.documents import ROOT

GLOSSARY = ROOT / "docs" / "glossary.md"
TERMS = {  # term: the word of a page; a plain word where it is written as the term is
    "action grid": r"action grid|--action-grid",
    "agreement": "agreement",
    "betting": "betting",
    "box": "box",
    "certificate": "certificate",
    "challenger": "challenger",
    "checkpoint": "checkpoint",
    "contest": "contest",
    "demonstrations": "demonstrations",
    "derived feature": "derived feature",
    "discount": "discount",
    "episode": "episode",
    "evaluation": "evaluation",
    "expansion": "expansion",
    "expert tree": "expert tree",
    "explorer": "explorer",
    "front": r"(?<!in )front(?! (?:door|end|page))",
    "gathering": "gathering",
    "handed over": r"hand(?:s|ed) over",
    "history": "history",
    "incumbent": "incumbent",
    "leaf": "leaf",
    "leaf price": r"leaf[ _]price|price of (?:a leaf|its leaves)|price=",
    "listener": "listener",
    "lock": "lock",
    "margin": "margin",
    "mask": "mask",
    "method": "method",
    "monotone": "monotone",
    "optimistic": r"optimis(?:m|t|tic)",
    "observation": "observation",
    "pessimistic": r"pessimis(?:m|t|tic)",
    "plant": "plant",
    "policy": "policy",
    "practice": "practi[cs]e",
    "preset": "preset",
    "property": "property",
    "race": "race",
    "rollout": "rollout",
    "run folder": "run folder",
    "schema": "schema",
    "significance": "significance",
    "split": "split",
    "start": "start",
    "state tree": "state tree",
    "taking over": r"tak(?:e|es|en|ing) over",
    "target": "target",
    "teacher": "teacher",
    "terminated": "terminated",
    "threshold": "threshold",
    "transition": "transition",
    "truncated": "truncated",
    "world model": "world model",
    "zoo": "zoo",
}


def pages() -> str:
    """Return the README and the guide: the pages beside the glossary."""
    guide = [page for page in sorted((ROOT / "docs").glob("*.md")) if page != GLOSSARY]
    return "\n".join(page.read_text() for page in [ROOT / "README.md", *guide])


def rows(text: str) -> list[str]:
    """Return the first cell and the words in italics of each row, as these are explained too."""
    found = re.findall(r"^\| ([^|]+) \| (.+) \|$", text, re.MULTILINE)
    return [
        f"{term}, {', '.join(re.findall(r'[*]([^*]+)[*]', meaning))}" for term, meaning in found
    ]


def is_used(word: str, text: str) -> bool:
    return re.search(rf"(?<!\w)(?:{word})(?:s|es)?(?!\w)", text, re.IGNORECASE) is not None


def is_explained(term: str, explained: list[str]) -> bool:
    return any(term in re.split(r",\s*", row) for row in explained)


@pytest.mark.parametrize("term", TERMS)
def test_a_term_that_a_page_uses_is_a_row(term: str) -> None:
    assert is_explained(term, rows(GLOSSARY.read_text()))


def test_each_term_is_used() -> None:
    text = pages()
    assert [term for term, word in TERMS.items() if not is_used(word, text)] == []


def test_each_term_has_one_row() -> None:
    terms = re.findall(r"^\| ([^|]+) \|", GLOSSARY.read_text(), re.MULTILINE)
    assert sorted(terms) == sorted(set(terms))


def test_a_row_is_read() -> None:
    assert rows("| a, b | what *c* is |\n|---|---|\n") == ["a, b, c"]
    assert is_explained("c", ["a, b, c"])
    assert not is_explained("d", ["a, b, c"])
    assert is_used("front", "two fronts")
    assert not is_used("front", "confront")
