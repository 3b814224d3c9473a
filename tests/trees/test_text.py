"""Names made printable, conditions, nested rules."""

import json
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.text import AskedTest, at_most, definitions, printable, quoted, rules
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


@pytest.mark.parametrize("name", ["a*", "*a", "*"])
def test_no_formula_opens_or_closes_a_comment(name: str) -> None:
    """`abs(a*)` closed the comment that it stood in, and `min(*a, x)` opened another."""
    schema = Schema((Feature(name), Feature("x")), ("stop", "go"))
    schema = schema.derive([f'd = abs("{name}") + min("{name}", x)'])
    (line,) = definitions(DecisionTree.single_leaf(3).split(0, 2, 1.0), schema)
    assert not SIGNIFICANT.search(line)
    assert quoted(name) in line
    assert printable("a*b") == "a*b"


def test_conditions_are_exact_and_have_units() -> None:
    exact = AskedTest(0, Feature("speed", "m/s"), 0.1 + 0.2)
    assert exact.condition() == "speed <= 0.30000000000000004 m/s"
    assert AskedTest(1, Feature("a <= b"), -0.0).condition() == r'"a \u003c= b" <= -0.0'


def test_right_branches_continue_the_chain() -> None:
    schema = Schema((Feature("x", "m"), Feature("y")), ("a", "b", "c", "d"))
    tree = DecisionTree.single_leaf(2).split(0, 0, 1.0).split(1, 1, 2.0).split(0, 1, 3.0)
    assert rules(tree, schema, list("abcd")).splitlines() == [
        "if x <= 1 m:",
        "    if y <= 3:",
        "        a",
        "    else:",
        "        d",
        "else if y <= 2:",
        "    b",
        "else:",
        "    c",
    ]


def test_a_single_leaf_is_its_action() -> None:
    schema = Schema((Feature("x"),), ("go",))
    assert rules(DecisionTree.single_leaf(1), schema, ["go"]) == "go"


def before(number: float) -> float:
    return math.nextafter(number, -math.inf)


@pytest.mark.parametrize(
    ("threshold", "words"),
    [
        (8.25, "<= 8.25"),
        (before(24.0), "< 24.0"),
        (before(20.1), "< 20.1"),
        (20.12699, "<= 20.12699"),
        (0.30000000000000004, "<= 0.30000000000000004"),
        (1.7976931348623157e308, "<= 1.7976931348623157e+308"),
    ],
)
def test_a_number_just_below_a_short_one_is_written_as_less_than_it(
    threshold: float, words: str
) -> None:
    """A rule said ``room <= 23.999999999999996`` where ``room < 24`` was meant."""
    assert at_most(threshold) == words


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from([0, 1, 2]))
def test_tests_in_words_are_exact(number: float, digits: int) -> None:
    for threshold in (number, before(round(number, digits))):
        if not math.isfinite(threshold):
            continue
        sign, text = at_most(threshold).split()
        for x in (before(threshold), threshold, math.nextafter(threshold, math.inf)):
            said = x <= float(text) if sign == "<=" else x < float(text)
            assert said == (x <= threshold)
