"""The one rule for a threshold between two values: it parts them, whatever they are."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from eutree.compiled import compiled
from eutree.features import threshold_between

finite = st.floats(allow_nan=False, allow_infinity=False)
fast_threshold_between = compiled(threshold_between)


@given(finite, finite)
@example(1.0, math.nextafter(1.0, 2.0))
@example(math.nextafter(1.0, 0.0), 1.0)
@example(-5e-324, 0.0)
@example(0.0, 5e-324)
@example(-1.7976931348623157e308, 1.7976931348623157e308)
def test_it_parts_any_two_numbers_compiled_or_not(one: float, other: float) -> None:
    low, high = sorted((one, other))
    threshold = threshold_between(low, high)
    if low < high:
        assert low <= threshold < high
    else:
        assert threshold == low
    assert fast_threshold_between(low, high) == threshold


@pytest.mark.parametrize(("low", "high", "middle"), [(1.0, 2.0, 1.5), (-3.0, 1.0, -1.0)])
def test_it_is_the_midpoint(low: float, high: float, middle: float) -> None:
    assert threshold_between(low, high) == middle
