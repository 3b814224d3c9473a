"""Formulas mean one thing exactly, and nothing else is one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.features import Derivation
from eutree.formulas import LARGEST_RATIO, in_formula, parse, renamed
from eutree.schema import Feature, Schema
from tests.random_formulas import formulas_of

NAMES = ("a", "b", "turn rate", "lidar.x0")
ROAD = Schema((Feature("distance", "m"), Feature("speed", "m/s"), Feature("level")), ("go",))


def value(text, *now, before=None):
    last = now if before is None else before
    return float(parse(text, NAMES).compute([np.float64(x) for x in now], lambda j: last[j]))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a - b - 1", 3.0 - 8.0 - 1),
        ("a + b * 2", 3.0 + 16.0),
        ("(a + b) * 2", 22.0),
        ("-a * -b", 24.0),
        ('"turn rate" / lidar.x0', 2.0),
        ("min(a, b, 1)", 1.0),
        ("max(a, b)", 8.0),
        ("abs(a - b)", 5.0),
        ("a - last(a)", 2.0),
        ("a if b < 9 and a <= 3 else 0", 3.0),
        ("a if b < 1 and a <= 3 or b > 7 else 0", 3.0),
        ("a if b < 8 else b if b >= 8 else 0", 8.0),
        ("1.5e1 - .5", 14.5),
    ],
)
def test_a_formula_is_computed_as_it_is_read(text, expected):
    assert value(text, 3.0, 8.0, 10.0, 5.0, before=(1.0, 0.0, 0.0, 0.0)) == expected


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (2.0, 0.0, LARGEST_RATIO),
        (-2.0, 0.0, -LARGEST_RATIO),
        (2.0, -0.0, LARGEST_RATIO),
        (0.0, 0.0, 0.0),
        (1.0, 1e-300, LARGEST_RATIO),
        (-1.0, 1e-12, -LARGEST_RATIO),
        (1.0, math.inf, 0.0),
    ],
)
def test_division_by_zero_is_defined_and_a_quotient_bounded(a, b, expected):
    assert value("a / b", a, b) == expected


def test_a_number_that_is_none_stays_none():
    assert math.isnan(value("a / b", math.nan, 0.0))
    assert math.isnan(value("a / b", 1.0, math.nan))
    assert value("min(a, b)", math.nan, 1.0) != value("min(a, b)", math.nan, 1.0)
    assert value("min(b, a)", math.nan, 1.0) == 1.0  # b < a is false: the first one


@given(st.lists(st.floats(), min_size=4, max_size=4))
def test_rows_at_once_are_the_steps_one_by_one(numbers):
    schema = Schema((Feature("a"), Feature("b")), ("go",)).derive(
        ["c = a / b", "d = c - last(c)", "e = min(a, d) if b < a else abs(b)"]
    )
    derivation = Derivation.of(schema)
    rows = np.array(numbers).reshape(2, 2)
    first = derivation.rows(rows[0])
    steps = np.stack([first, derivation.rows(rows[1], first)])
    assert derivation.of_episode(rows).tobytes() == steps.tobytes()
    assert derivation.remembered == (2,)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "a number or a feature"),
        ("a +", "a number or a feature"),
        ("a b", "its end"),
        ("a ; b", "its end"),
        ("__import__('os')", "__import__"),
        ("a if b else 1", "a comparison"),
        ("last(a + b)", "')'"),
        ("last(3)", "a number or a feature"),
        ("min()", "a number or a feature"),
        ("1e999", "finite numbers"),
        ("(" * 60 + "a" + ")" * 60, "inside one another"),
        ("-" * 60 + "a", "inside one another"),
        ("+".join("a" * 400), "names, numbers and signs"),
        ("a" * 3000, "2,000 characters"),
        ("speed", "unknown feature 'speed'"),
    ],
)
def test_what_is_no_formula_is_said(text, word):
    with pytest.raises(InvalidArgumentError, match=r"^[^\n]*$") as raised:
        parse(text, NAMES)
    assert word in str(raised.value)


@given(st.text(alphabet='ab()+-*/<>=." ,0123456789minmaxlastifelse\\', max_size=60))
def test_any_text_is_a_formula_or_refused(text):
    try:
        formula = parse(text, NAMES)
    except InvalidArgumentError:
        return
    numbers = [np.float64(x) for x in (1.0, 2.0, 0.0, -1.0)]
    again = parse(renamed(text, NAMES, [in_formula(name) for name in NAMES]), NAMES)
    one, two = (f.compute(numbers, lambda j: numbers[j]) for f in (formula, again))
    assert np.float64(one).tobytes() == np.float64(two).tobytes()


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("distance / speed", "s"),
        ("distance - last(distance)", "m"),
        ("min(distance, 3)", "m"),
        ("distance * distance", "m²"),
        ("speed * speed / distance", "m/s²"),
        ("distance / distance", ""),
        ("distance + speed", ""),
        ("1 / speed", "s/m"),
        ("1 / (distance / speed)", "1/s"),
        ("2 * speed", "m/s"),
        ("distance if level < 1 else 3", "m"),
    ],
)
def test_units_follow(text, unit):
    assert ROAD.derive([f"new = {text}"]).features[-1].unit == unit


def test_a_unit_that_is_given_stays():
    assert ROAD.derive(["rest [min] = distance / speed / 60"]).features[-1].unit == "min"


@pytest.mark.parametrize(
    ("declaration", "word"),
    [
        ("distance / speed", "NAME = FORMULA"),
        ("= 3", "NAME = FORMULA"),
        ("speed = distance", "a name of its own"),
        ("next = last(next)", "unknown feature 'next'"),
        ("level <= 3", "NAME = FORMULA"),
    ],
)
def test_what_declares_nothing_is_said(declaration, word):
    with pytest.raises(InvalidArgumentError, match=word):
        ROAD.derive([declaration])


def test_derived_features_stand_together_behind_those_they_are_made_of():
    a, b = Feature("a"), Feature("b")
    with pytest.raises(InvalidArgumentError, match="together"):
        Schema((a, Feature("c", formula="a"), b, Feature("d", formula="a")), ("go",))
    with pytest.raises(InvalidArgumentError, match="together"):
        Schema((Feature("c", formula="1"), b), ("go",))
    with pytest.raises(UnknownNameError):
        Schema((a, Feature("c", formula="d"), Feature("d", formula="a")), ("go",))


def test_formulas_follow_new_names():
    schema = ROAD.derive(["gap = distance / speed", "rest = gap - last(gap)"])
    others = [Feature("way to go", "km"), Feature("v"), Feature("level")]
    renamed_schema = schema.renamed(others, ("go",))
    assert [feature.formula for feature in renamed_schema.derived] == [
        '"way to go" / v',
        "gap - last(gap)",
    ]


def test_units_that_follow_from_a_formula_follow_new_units():
    schema = ROAD.derive(["gap = distance / speed", "rest = gap - last(gap)", "far [%] = distance"])
    assert [feature.unit for feature in schema.derived] == ["s", "s", "%"]
    others = [Feature("way", "km"), Feature("speed", "km/h"), *ROAD.features[2:]]
    named = schema.renamed(others, ROAD.actions)
    assert [feature.unit for feature in named.derived] == ["h", "h", "%"]


@given(formulas_of("a", "b", '"c d"', "last(a)", "2", "0.1"))
def test_a_formula_with_the_brackets_that_it_needs_is_the_same_formula(text):
    names = ("a", "b", "c d")
    short = renamed(text, names, [in_formula(name) for name in names])
    assert parse(short, names) == parse(text, names)
    assert short.count("(") <= text.count("(")


def test_what_binds_as_it_is_read_has_no_brackets():
    names = ("x", "y", "turn rate")
    text = '((x - (0.5 * y)) + (2.6 * "turn rate")) - (x - (y - x))'
    assert renamed(text, names, names) == "x - 0.5 * y + 2.6 * turn rate - (x - (y - x))"
