"""The page of messages has every sentence of the sources, and no other."""

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "docs" / "reference"
PAGE = REFERENCE / "messages.md"
OF_PARTS = {"Did you mean", "unknown environment"}  # made of a kind and a name

sys.path.insert(0, str(REFERENCE))
import said  # noqa: E402 - beside the page that it is for

sys.path.remove(str(REFERENCE))


def quoted() -> list[str]:
    return re.findall(r"^\| `([^`]+)` \|", PAGE.read_text(), re.MULTILINE)


def test_what_the_page_quotes_is_said() -> None:
    sources = " ".join(" ".join(p.read_text().split()) for p in (ROOT / "src").rglob("*.py"))
    joined = re.sub(r'" f?"', "", sources)  # a sentence goes on in the next line of source
    assert [text for text in quoted() if text not in joined and text not in OF_PARTS] == []
    assert len(quoted()) > 35


def test_every_warning_has_a_row() -> None:
    warnings = [one for one in said.said() if one.kind == "warning"]
    assert len(warnings) > 20
    rows = quoted()
    assert [one for one in warnings if not any(text in one.text for text in rows)] == []


def test_every_refusal_falls_into_a_family() -> None:
    """A new sentence that fails here needs a family in ``docs/reference/said.py``, or a row."""
    refusals = [one for one in said.said() if one.kind != "warning"]
    assert len(refusals) > 650
    assert [one for one in refusals if not said.family(one)] == []


def test_every_raise_is_looked_at() -> None:
    """Not those that pass on another error, nor those that a function of the file makes."""
    found = {(one.file, one.kind) for one in said.said()} | {("", "")}
    files = {path.relative_to(said.SOURCE).as_posix(): path for path in said.SOURCE.rglob("*.py")}
    kinds = ("InvalidArgumentError", "FileError", "UnknownNameError", "RunFolderError")
    missing = []
    for file, path in files.items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                kind = ast.unparse(node.exc.func)
                if kind in kinds and (file, kind) not in found:
                    missing.append((file, kind, ast.unparse(node.exc)))
    assert [one for one in missing if "error" not in one[2].rpartition("(")[2]] == []


def test_every_family_is_on_the_page_and_has_sentences() -> None:
    shown = re.findall(r"^```\{messages\} (\w+)$", PAGE.read_text(), re.MULTILINE)
    assert sorted({*shown, "warnings"}) == sorted({kin.name for kin in said.FAMILIES})
    assert len(shown) == len(set(shown))
    assert all(said.packages(kin.name) for kin in said.FAMILIES)


def test_no_rule_and_no_exception_is_left_over() -> None:
    firsts = {next(k for k in said.FAMILIES if k.has(one)) for one in said.said()}
    assert [kin for kin in said.FAMILIES if kin not in firsts] == []


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("InvalidArgumentError", "the moon is full"),
        ("EutreeError", "this went wrong"),
        ("ZeroDivisionError", "x must be above 0"),
    ],
)
def test_a_new_sentence_without_a_family_is_found(kind: str, text: str) -> None:
    assert said.family(said.Said(kind, "eutree/new.py", text)) == ""


def test_the_words_of_a_sentence_are_found_where_they_stand() -> None:
    texts = {one.file: one for one in said.said() if "environment's own bounds" in one.text}
    assert texts["eutree/interaction/guard.py"].text.startswith("<name>: observation <name> must")
    assert any("must have actions in 0.." in one.text for one in said.said())  # by a function
