"""Intervals that hold every number a program can compute: arithmetic rounded outward.

A plant moves boxes by the very operations of the program that it stands for, in its order, on
:class:`Intervals` in place of numbers. Each operation is computed at the bounds and moved outward
by more than it can have been rounded, so the result holds the exact value *and* the double that
the program computes, with or without fused operations. ``sin``, ``cos`` and ``sqrt`` are moved by
four units in the last place of 1: libraries round them as they like.

A comparison of intervals is true surely, true perhaps, or false: a :class:`Truth`. What a program
does after ``if`` becomes ``where(truth, one, other)``: where the truth is not sure, both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats
from eutree.proof import _kernels

Number = Union["Intervals", NDArray[np.floating[Any]], float]

LIBRARY = 2.0**-50  # what sin, cos and sqrt of values up to 1 may be off, four units there
_NEAR = 1e-9  # so near to a peak, sin and cos are 1 to the last place
_FAR = 1e5  # beyond, no digit of a peak's place is relied on


@dataclass(frozen=True, eq=False)
class Truth:
    """Whether statements about intervals hold.

    Attributes:
        surely: They hold for all numbers in the intervals.
        maybe: They hold for some, or it is not known that they hold for none.
    """

    surely: Booleans  # [N]
    maybe: Booleans  # [N]

    def __and__(self, other: "Truth") -> "Truth":
        return Truth(self.surely & other.surely, self.maybe & other.maybe)

    def __or__(self, other: "Truth") -> "Truth":
        return Truth(self.surely | other.surely, self.maybe | other.maybe)

    def __invert__(self) -> "Truth":
        return Truth(~self.maybe, ~self.surely)


@dataclass(frozen=True, eq=False)
class Intervals:
    """N closed intervals.

    Attributes:
        low: Lower bounds.
        high: Upper bounds.
    """

    low: Floats  # [N]
    high: Floats  # [N]

    __array_ufunc__ = None  # NumPy's arrays leave the operators to the methods below

    @classmethod
    def of(cls, value: Number) -> "Intervals":
        """Return a number, or numbers [N], as intervals of one point."""
        if isinstance(value, Intervals):
            return value
        array = np.asarray(value, dtype=np.float64)
        return cls(array, array)

    @classmethod
    def between(cls, low: ArrayLike, high: ArrayLike) -> "Intervals":
        """Return the intervals between some bounds: a disturbance, say."""
        return cls(np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))

    def __add__(self, other: Number) -> "Intervals":
        other = Intervals.of(other)
        return _outward(self.low + other.low, self.high + other.high)

    __radd__ = __add__

    def __neg__(self) -> "Intervals":
        if self.low is self.high:  # numbers stay numbers
            return Intervals.of(-self.low)
        return Intervals(-self.high, -self.low)

    def __sub__(self, other: Number) -> "Intervals":
        return self + -Intervals.of(other)

    def __rsub__(self, other: Number) -> "Intervals":
        return -self + other

    def __mul__(self, other: Number) -> "Intervals":
        other = Intervals.of(other)
        if other.low is other.high:  # numbers
            return _hull(self.low * other.low, self.high * other.low)
        return _hull(
            self.low * other.low, self.low * other.high,
            self.high * other.low, self.high * other.high,
        )  # fmt: skip

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> "Intervals":
        other = Intervals.of(other)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = _hull(
                self.low / other.low, self.low / other.high,
                self.high / other.low, self.high / other.high,
            )  # fmt: skip
        crosses = ~((other.low > 0) | (other.high < 0))
        return Intervals(
            np.where(crosses, -np.inf, found.low), np.where(crosses, np.inf, found.high)
        )

    def __rtruediv__(self, other: Number) -> "Intervals":
        return Intervals.of(other) / self

    def square(self) -> "Intervals":
        """Return the squares, none of which is below 0."""
        ends = self.low * self.low, self.high * self.high
        found = _hull(*ends)
        holds_zero = (self.low <= 0) & (self.high >= 0)
        return Intervals(np.where(holds_zero, 0.0, np.maximum(found.low, 0.0)), found.high)

    def cos(self) -> "Intervals":
        """Return cosines of angles in radians."""
        return _wave(np.cos, self, 0.0)

    def sin(self) -> "Intervals":
        """Return sines of angles in radians."""
        return _wave(np.sin, self, np.pi / 2)

    def sqrt(self) -> "Intervals":
        """Return square roots; of what is below 0, that of 0."""
        low, high = (np.sqrt(np.maximum(end, 0.0)) for end in (self.low, self.high))
        return Intervals(np.maximum(low - _margin(low), 0.0), high + _margin(high))

    def settled(self, truth: Truth) -> Truth:
        """Return a statement about a jump as it is: of a box, both sides are followed."""
        return truth

    def either(self, truth: Truth, other: "Intervals", both: "Intervals") -> "Intervals":
        """Return this where surely true, the other where surely not, else ``both``."""
        ends = (
            np.where(truth.surely, mine, np.where(truth.maybe, joined, theirs))
            for mine, joined, theirs in (
                (self.low, both.low, other.low),
                (self.high, both.high, other.high),
            )
        )
        return Intervals(*ends)

    def __le__(self, other: Number) -> Truth:
        other = Intervals.of(other)
        return Truth(self.high <= other.low, ~(self.low > other.high))

    def __lt__(self, other: Number) -> Truth:
        other = Intervals.of(other)
        return Truth(self.high < other.low, ~(self.low >= other.high))

    def __ge__(self, other: Number) -> Truth:
        other = Intervals.of(other)
        return Truth(self.low >= other.high, ~(self.high < other.low))

    def __gt__(self, other: Number) -> Truth:
        other = Intervals.of(other)
        return Truth(self.low > other.high, ~(self.high <= other.low))


def where(truth: Truth, one: Number, other: Number) -> Intervals:
    """Return ``one`` where the statement holds, ``other`` where not, both where it is not sure."""
    one, other = Intervals.of(one), Intervals.of(other)
    both = Intervals(np.minimum(one.low, other.low), np.maximum(one.high, other.high))
    knowing = other if type(one) is Intervals else one
    return _either(knowing.settled(truth), one, other, both)


def minimum(one: Number, other: Number) -> Intervals:
    """Return the smaller one of two numbers."""
    one, other = Intervals.of(one), Intervals.of(other)
    both = Intervals(np.minimum(one.low, other.low), np.minimum(one.high, other.high))
    return _either(one <= other, one, other, both)


def maximum(one: Number, other: Number) -> Intervals:
    """Return the larger one of two numbers."""
    return -minimum(-Intervals.of(one), -Intervals.of(other))


def clip(value: Number, low: Number, high: Number) -> Intervals:
    """Return a value, not below ``low`` and not above ``high``."""
    return minimum(maximum(value, low), high)


def cos(value: Intervals) -> Intervals:
    """Return cosines of angles in radians."""
    return value.cos()


def sin(value: Intervals) -> Intervals:
    """Return sines of angles in radians."""
    return value.sin()


def sqrt(value: Intervals) -> Intervals:
    """Return square roots; of what is below 0, that of 0."""
    return value.sqrt()


def middle(low: Floats, high: Floats) -> Floats:
    """Return a number in the middle of two, as nearly as doubles allow."""
    found: Floats = low / 2 + high / 2
    return found


def _either(truth: Truth, one: Intervals, other: Intervals, both: Intervals) -> Intervals:
    """Let the operand choose that knows more than bounds, if one does."""
    if type(one) is Intervals and type(other) is not Intervals:
        return other.either(~truth, one, both)
    return one.either(truth, other, both)


def _wave(function: Callable[[Floats], Floats], value: Intervals, peak: float) -> Intervals:
    """Return sine or cosine, which is 1 at ``peak`` and -1 half a turn from there."""
    ends = function(value.low), function(value.high)
    low = np.minimum(*ends) - LIBRARY
    high = np.maximum(*ends) + LIBRARY
    unknown = ~((np.abs(value.low) < _FAR) & (np.abs(value.high) < _FAR))
    low = np.where(_holds(value, peak + np.pi) | unknown, -1.0, low)
    high = np.where(_holds(value, peak) | unknown, 1.0, high)
    return Intervals(np.maximum(low, -1.0), np.minimum(high, 1.0))


def _holds(value: Intervals, place: float) -> Booleans:
    """Return whether intervals hold, or nearly, the place or one some whole turns from it."""
    turn = 2 * np.pi
    first = np.ceil((value.low - _NEAR - place) / turn) * turn + place
    return np.asarray(first <= value.high + _NEAR)


def _margin(value: Floats) -> Floats:
    margin: Floats = value * LIBRARY + 5e-324
    return margin


def _hull(*ends: Floats) -> Intervals:
    """Return the intervals that hold some computed numbers and what they were rounded from."""
    low, high = ends[0], ends[0]
    for end in ends[1:]:
        low, high = np.minimum(low, end), np.maximum(high, end)
    return _outward(low, high)


def _outward(low: Floats, high: Floats) -> Intervals:
    low, high = np.array(low, np.float64), np.array(high, np.float64)
    _kernels.widen(low.reshape(-1), high.reshape(-1))
    return Intervals(low, high)
