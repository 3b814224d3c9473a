"""Numbers are shown in the digits that matter: enough to tell them apart, and no more."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.display import SAME, decimals_of, fixed, number, told_apart, usual_width


@pytest.mark.parametrize(
    ("low", "high", "values", "texts"),
    [
        (-10.0, 10.0, [8.257812345678901], ["8.26"]),  # fifteen digits, once
        (-1.0, 1.0, [-6.1e-17], ["0"]),  # and not -0
        (-math.inf, math.inf, [-6.1e-17], ["0"]),
        (-10.0, 10.0, [8.2578, 8.2581], ["8.2578", "8.2581"]),  # told apart
        (-10.0, 10.0, [8.2578, 8.2578 + 1e-9], ["8.26", "8.26"]),  # one, but for noise
        (0.0, 50.0, [math.nextafter(24.0, 0.0), 24.0], ["24", "24"]),
        (-2.0, 2.0, [-1.6363636363636365], ["-1.636"]),
        (-3.4e38, 3.4e38, [0.7123456], ["0.712"]),  # float32 without a bound
        (0.0, 1e-9, [3.214e-10], ["3.21e-10"]),
        (0.0, 1e6, [123456.789], ["123457"]),
        (-10.0, 10.0, [0.05, -0.3], ["0.05", "-0.3"]),  # small beside its bounds
        (-math.inf, math.inf, [0.0491734, 1957.2], ["0.05", "1957"]),  # not 0
        (-math.inf, math.inf, [-0.24898, 99.0], ["-0.25", "99"]),
    ],
)
def test_as_few_digits_as_matter(low, high, values, texts):
    found = told_apart(values, usual_width(low, high, values))
    assert [found[value] for value in values] == texts


finite = st.floats(-1e6, 1e6)


@given(st.lists(finite, min_size=1, max_size=8, unique=True))
def test_what_differs_by_more_than_a_millionth_looks_different(values):
    width = usual_width(-math.inf, math.inf, values)
    found = told_apart(values, width)
    for one in values:
        assert abs(float(found[one]) - one) <= width / 1000
        for other in values:
            if abs(one - other) > 1.01 * SAME * width:
                assert found[one] != found[other]
                assert (float(found[one]) < float(found[other])) == (one < other)


def test_nothing_known_is_no_crash():
    for width in (usual_width(-math.inf, math.inf, []), usual_width(0.0, 0.0, [])):
        assert number(0.25, decimals_of(width)) == "0.25"
    assert number(math.inf, 2) == "inf"
    assert number(math.nan, 2) == "nan"
    assert told_apart([], 1.0) == {}


def test_small_numbers_have_digits_that_say_something():
    assert f"{86.14:{fixed(1, [86.14])}}" == "86.1"
    assert f"{-0.0123:{fixed(1, [-0.0123, -0.0101])}}" == "-0.012"
    assert f"{0.0:{fixed(2, [0.0])}}" == "0.00"
    assert f"{1.0:{fixed(2, [1.0, 0.002])}}" == "1.00"
    assert f"{0.5:{fixed(1, [0.5])}}" == "0.50"
    assert fixed(1, []) == fixed(1, [float("nan")]) == fixed(1, [float("inf")]) == ".1f"
