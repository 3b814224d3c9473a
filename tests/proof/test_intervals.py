"""Every operation on intervals against mpmath; every rounding outward; a wrong one is caught."""

import operator

import numpy as np
import pytest

from eutree.proof import Intervals, _kernels, cos, intervals, maximum, minimum, sin, sqrt, where
from eutree.proof.intervals import Affine, Doubt

mpmath = pytest.importorskip("mpmath", reason="the slow twin of intervals is mpmath's")

from tests.naive_proof import ends, twin_of  # noqa: E402 - it needs mpmath

BINARY = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "truediv": operator.truediv
}  # fmt: skip
UNARY = {"sin": sin, "cos": cos, "sqrt": sqrt, "square": Intervals.square}


def operands(generator, n):
    """Return intervals of all widths, around numbers of all sizes, 0 among them."""
    center = generator.choice([-1, 1], n) * 10.0 ** generator.uniform(-8, 2, n)
    center[generator.random(n) < 0.1] = 0.0
    width = np.abs(center) * 10.0 ** generator.uniform(-17, 1, n)
    width[generator.random(n) < 0.2] = 0.0
    return Intervals(center - width, center + width)


def escapes(found, name, *of):
    """Count the intervals that do not hold what mpmath says; its bounds are a unit too wide."""
    wrong = 0
    for k in range(found.low.size):
        pairs = [(one.low[k], one.high[k]) for one in of]
        if name == "truediv" and pairs[1][0] <= 0 <= pairs[1][1]:
            continue
        if name == "sqrt":
            pairs = [(max(low, 0.0), max(high, 0.0)) for low, high in pairs]
        mpmath.iv.prec = 120
        low, high = ends(twin_of(name, *pairs))
        wrong += not (mpmath.mpf(float(found.low[k])) <= low and high <= float(found.high[k]))
    return wrong


@pytest.mark.parametrize("name", BINARY)
def test_arithmetic_holds_the_exact_range(name):
    generator = np.random.default_rng(1)
    one, other = operands(generator, 400), operands(generator, 400)
    assert escapes(BINARY[name](one, other), name, one, other) == 0


@pytest.mark.parametrize("name", UNARY)
def test_functions_hold_the_exact_range(name):
    generator = np.random.default_rng(2)
    one = operands(generator, 400)
    assert escapes(UNARY[name](one), name, one) == 0


@pytest.mark.parametrize("name", BINARY)
def test_a_result_that_is_not_rounded_outward_is_caught(name, monkeypatch):
    """The control: without the widening the same comparison fails."""
    monkeypatch.setattr(_kernels, "widen", lambda low, high: None)
    generator = np.random.default_rng(1)
    one, other = operands(generator, 400), operands(generator, 400)
    assert escapes(BINARY[name](one, other), name, one, other) > 20


def test_functions_that_are_not_widened_are_caught(monkeypatch):
    monkeypatch.setattr(intervals, "LIBRARY", 0.0)
    one = operands(np.random.default_rng(2), 400)
    assert escapes(cos(one), "cos", one) > 20


def test_results_are_hardly_wider_than_exact():
    generator = np.random.default_rng(3)
    one, other = operands(generator, 200), operands(generator, 200)
    found = one * other
    mpmath.iv.prec = 120
    for k in range(200):
        low, high = ends(twin_of("mul", (one.low[k], one.high[k]), (other.low[k], other.high[k])))
        size = float(max(abs(low), abs(high)))
        assert float(low) - found.low[k] <= 4e-16 * size + 1e-300
        assert found.high[k] - float(high) <= 4e-16 * size + 1e-300


def test_a_truth_is_sure_only_where_all_numbers_agree():
    one = Intervals(np.array([0.0, 2.0, 0.0]), np.array([1.0, 3.0, 3.0]))
    found = one <= 1.5
    assert found.surely.tolist() == [True, False, False]
    assert found.maybe.tolist() == [True, False, True]
    assert (~found).surely.tolist() == [False, True, False]
    chosen = where(found, 10.0, one)
    assert chosen.low.tolist() == [10.0, 2.0, 0.0]
    assert chosen.high.tolist() == [10.0, 3.0, 10.0]
    assert minimum(one, 1.0).high.tolist() == [1.0, 1.0, 1.0]
    assert maximum(one, 1.0).low.tolist() == [1.0, 2.0, 1.0]


def test_what_is_not_a_number_is_never_sure():
    found = Intervals(np.array([np.nan]), np.array([np.nan])) <= 1.0
    assert not found.surely[0]
    assert found.maybe[0]


def affine_of(center, radius):
    n = center.size
    doubt = Doubt(np.zeros(n, np.int64), np.full(n, -1))
    return Affine(center, radius[None], np.zeros(n), doubt)


FORMULAS = {
    "polynomial": lambda x: x * x - 3.0 * x + 0.5,
    "waves": lambda x: cos(3.0 * x) * -0.0025 + sin(x) * x,
    "quotient": lambda x: (x + 2.0) / (4.0 / 3.0 - 0.1 * cos(x).square()),
    "root": lambda x: sqrt(x + 1.5) * 2.0,
    "corner": lambda x: maximum(minimum(x, 0.25), -0.25) + x,
}


@pytest.mark.parametrize("name", FORMULAS)
@pytest.mark.parametrize("radius", [1e-12, 1e-6, 1e-2, 0.3])
def test_affine_results_hold_what_the_program_computes(name, radius):
    """Every point of a piece, computed in doubles, lies in the result at its own place."""
    generator = np.random.default_rng(4)
    center = generator.uniform(-1, 1, 300)
    found = FORMULAS[name](affine_of(center, np.full(300, radius)))
    for _ in range(20):
        place = generator.uniform(-1, 1, 300)
        point = center + radius * place
        exact = FORMULAS[name](Intervals.of(point))  # holds what the program computes
        error = found.error + 1e-15 * (1 + np.abs(found.center))
        line = found.center + found.slope[0] * place
        assert (exact.low >= line - error - 2e-15).all()
        assert (exact.high <= line + error + 2e-15).all()
        assert (exact.low >= found.low - 1e-15).all()
        assert (exact.high <= found.high + 1e-15).all()


def test_affine_results_are_of_second_order():
    """A tenth of the width leaves a hundredth of the error: plain intervals leave a tenth."""
    center = np.random.default_rng(5).uniform(-1, 1, 50)
    wide, narrow = (
        FORMULAS["waves"](affine_of(center, np.full(50, radius))).error for radius in (1e-2, 1e-3)
    )
    assert (narrow < 0.011 * wide).all()


def test_an_affine_error_that_is_too_small_is_caught():
    found = FORMULAS["waves"](affine_of(np.array([0.3]), np.array([0.1])))
    place = np.linspace(-1, 1, 101)
    exact = FORMULAS["waves"](Intervals.of(0.3 + 0.1 * place)).low
    off = np.abs(exact - (found.center + found.slope[0] * place))
    assert off.max() <= found.error[0]
    assert off.max() > found.error[0] / 10
