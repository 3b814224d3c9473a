"""Names made printable, conditions, nested rules."""

import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.text import condition, printable, quoted, rules
from tests.export.policies import NASTY

# Whatever opens, closes or continues something in a language that exports write.
SIGNIFICANT = re.compile(r"\*/|/\*|//|\(\*|\*\)|\?\?|--|<|&|\\$|\n|\r")


@given(st.one_of(st.sampled_from(NASTY), st.text(), st.text(alphabet="*/()-?<>\\\"'&$ ")))
def test_any_name_is_one_harmless_line_that_reads_back(name: str) -> None:
    text = printable(name)
    assert text.isprintable()
    assert not SIGNIFICANT.search(text)
    assert (json.loads(text) if text.startswith('"') else text) == name
    assert json.loads(quoted(name)) == name


@given(st.text(), st.text())
def test_different_names_look_different(first: str, second: str) -> None:
    assert (printable(first) == printable(second)) == (first == second)


@pytest.mark.parametrize("name", ["opponent_1", "m/s²", "pole angle", "x0, 1 ago", "速度", "100 %"])
def test_ordinary_names_are_left_alone(name: str) -> None:
    assert printable(name) == name


def test_conditions_are_exact_and_have_units() -> None:
    schema = Schema((Feature("speed", "m/s"), Feature("a <= b")), ("go",))
    assert condition(schema, 0, 0.1 + 0.2) == "speed <= 0.30000000000000004 m/s"
    assert condition(schema, 1, -0.0) == r'"a \u003c= b" <= -0.0'


def test_right_branches_continue_the_chain() -> None:
    schema = Schema((Feature("x", "m"), Feature("y")), ("a", "b", "c", "d"))
    tree = DecisionTree.single_leaf(2).split(0, 0, 1.0).split(1, 1, 2.0).split(0, 1, 3.0)
    assert rules(tree, schema, list("abcd")).splitlines() == [
        "if x <= 1.0 m:",
        "    if y <= 3.0:",
        "        a",
        "    else:",
        "        d",
        "else if y <= 2.0:",
        "    b",
        "else:",
        "    c",
    ]


def test_a_single_leaf_is_its_action() -> None:
    schema = Schema((Feature("x"),), ("go",))
    assert rules(DecisionTree.single_leaf(1), schema, ["go"]) == "go"
