"""Intervals that hold every number a program can compute: arithmetic rounded outward.

A plant moves boxes by the very operations of the program that it stands for, in its order, on
:class:`Intervals` in place of numbers. Each operation is computed at the bounds and moved outward
by more than it can have been rounded, so the result holds the exact value *and* the double that
the program computes, with or without fused operations. ``sin``, ``cos`` and ``sqrt`` are moved by
four units in the last place of 1: libraries round them as they like.

Bounds that are NaN say that nothing is known: the number may be NaN itself, infinity less infinity.

A comparison of intervals is true surely, true perhaps, or false: a :class:`Truth`. A program's
``if`` becomes ``where(truth, one, other)``: where the truth is not sure, both.

Affine arithmetic remembers how a number depends on the start. It is ``center + slope . x + error *
y`` with the start's place x in [-1, 1]^k and some y in [-1, 1]. Where two numbers depend on the
start in the same way, their difference is known to be small although both are wide; plain intervals
forget that, and a box that is turned grows at every step. The part that is not linear, and all
rounding, of the program and of the arithmetic here, goes into ``error``.

Reference: L. H. de Figueiredo, J. Stolfi, *Affine arithmetic: concepts and applications*, Numerical
Algorithms 37 (2004); here with one error for all that is not linear in the start.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.proof import _kernels

Number = Union["Intervals", NDArray[np.floating[Any]], float]

LIBRARY = 2.0**-50  # greatest error of sin, cos and sqrt of values up to 1, four units there
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

    def __bool__(self) -> bool:
        raise InvalidArgumentError(
            "a statement about intervals may hold for a part of them: in a plant write where, "
            "minimum, maximum, clip, &, | and ~ in place of if, min, max, and, or and not"
        )


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
        with np.errstate(all="ignore"):
            found = _outward(self.low + other.low, self.high + other.high)
        return found if are_finite(found).all() else _at_ends(np.add, self, other)

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
        found = _at_ends(np.multiply, self, other)
        if are_finite(found).all():  # then both are finite, or 0
            return found
        mine, theirs = _hold_zero(self) & ~are_finite(other), _hold_zero(other) & ~are_finite(self)
        return unless(mine | theirs, found)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> "Intervals":
        other = Intervals.of(other)
        return unless(_hold_zero(self) & _hold_zero(other), quotient(self, other))

    def __rtruediv__(self, other: Number) -> "Intervals":
        return Intervals.of(other) / self

    def square(self) -> "Intervals":
        """Return the squares, none of which is below 0."""
        found = _hull(self.low * self.low, self.high * self.high)
        return Intervals(np.where(_hold_zero(self), 0.0, np.maximum(found.low, 0.0)), found.high)

    def cos(self) -> "Intervals":
        """Return cosines of angles in radians."""
        return _wave(np.cos, self, 0.0)

    def sin(self) -> "Intervals":
        """Return sines of angles in radians."""
        return _wave(np.sin, self, np.pi / 2)

    def sqrt(self) -> "Intervals":
        """Return square roots; numbers below 0 count as 0."""
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
        return ~(self < other)

    def __gt__(self, other: Number) -> Truth:
        return ~(self <= other)

    def __eq__(self, other: Any) -> Any:
        return (self <= other) & (self >= other)


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


def quotient(one: Intervals, other: Intervals) -> Intervals:
    """Return quotients, among them any number for nought by nought."""
    found = _at_ends(np.divide, one, other)
    crosses = _hold_zero(other) & (one.low <= one.high)  # not of NaN
    low, high = np.where(crosses, -np.inf, found.low), np.where(crosses, np.inf, found.high)
    return unless(~are_finite(one) & ~are_finite(other), Intervals(low, high))


def cos(value: Intervals) -> Intervals:
    """Return cosines of angles in radians."""
    return value.cos()


def sin(value: Intervals) -> Intervals:
    """Return sines of angles in radians."""
    return value.sin()


def sqrt(value: Intervals) -> Intervals:
    """Return square roots; numbers below 0 count as 0."""
    return value.sqrt()


def middle(low: Floats, high: Floats) -> Floats:
    """Return a number in the middle of two, as nearly as doubles allow."""
    found: Floats = low / 2 + high / 2
    return found


def rounded(value: Intervals, precision: DTypeLike) -> Intervals:
    """Return the doubles that numbers are once they have been of a type: rounding keeps order."""
    with np.errstate(over="ignore"):
        ends = [end.astype(precision).astype(np.float64) for end in (value.low, value.high)]
    if not isinstance(value, Affine):
        return Intervals(*ends)
    kind, size = np.finfo(np.dtype(precision)), np.maximum(*map(np.abs, ends))
    number = value.low == value.high
    step = size * kind.eps + kind.smallest_subnormal  # infinite where the rounded number is
    error = np.where(number, 0.0, (value.error + step) * _UP)
    return Affine(np.where(number, ends[0], value.center), value.slope, error, value.doubt)


def _either(truth: Truth, one: Intervals, other: Intervals, both: Intervals) -> Intervals:
    """Let the operand choose that knows more than bounds, if one does."""
    if type(one) is Intervals and type(other) is not Intervals:
        return other.either(~truth, one, both)
    return one.either(truth, other, both)


def _wave(function: Callable[[Floats], Floats], value: Intervals, peak: float) -> Intervals:
    """Return sine or cosine, which is 1 at ``peak`` and -1 half a turn from there."""
    value = unless(~are_finite(value), value)
    ends = function(value.low), function(value.high)
    low = np.minimum(*ends) - LIBRARY
    high = np.maximum(*ends) + LIBRARY
    unknown = (np.abs(value.low) >= _FAR) | (np.abs(value.high) >= _FAR)
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


def _hold_zero(value: Intervals) -> Booleans:
    return np.asarray((value.low <= 0) & (value.high >= 0))


def are_finite(value: Intervals) -> Booleans:
    """Return which bounds are finite, shape [N]."""
    return np.isfinite(value.low) & np.isfinite(value.high)


def unless(may_be_nan: Booleans, value: Intervals) -> Intervals:
    """Return numbers, but that nothing is known of those that may be NaN."""
    nothing, known = Intervals.of(np.nan), Truth(~may_be_nan, ~may_be_nan)
    return value.either(known, nothing, nothing) if may_be_nan.any() else value


def _at_ends(operation: Callable[..., Floats], one: Intervals, other: Intervals) -> Intervals:
    """Return the hull of an operation's results at the ends; NaN where one of them is."""
    others = (other.low,) if other.low is other.high else (other.low, other.high)
    with np.errstate(all="ignore"):
        return _hull(*(operation(a, b) for a in (one.low, one.high) for b in others))


def _hull(*ends: Floats) -> Intervals:
    """Return the intervals that hold computed numbers and the exact ones they were rounded from."""
    return _outward(reduce(np.minimum, ends), reduce(np.maximum, ends))


def _outward(low: Floats, high: Floats) -> Intervals:
    low, high = np.array(low, np.float64), np.array(high, np.float64)
    _kernels.widen(low.reshape(-1), high.reshape(-1))
    return Intervals(low, high)


_ROUND = 2.0**-51  # of a result's size: its rounding in the program, and twice that of ours
_UP = 1.0 + 2.0**-48  # errors are sums of a few terms, each rounded
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Doubt:
    """The jumps of a step that N boxes may straddle, and the side that is assumed."""

    unsure: Integers  # [N]; how many a box straddles, counted while the step is computed
    assumed: Integers  # [N]; 1: the side where the statement holds, 0: the other, -1: both


class Affine(Intervals):
    """N numbers as functions of the start of their piece.

    They are ``center`` in the middle of the piece, shape [N], and change across half of it by
    ``slope``, shape [k, N]; the greatest deviation from that is ``error``, shape [N]. All numbers
    that are computed in a step share one ``doubt``.
    """

    def __init__(self, center: Floats, slope: Floats, error: Floats, doubt: Doubt) -> None:
        spread = sum(np.abs(slope), start=np.zeros_like(center))  # faster than over an axis
        size = np.abs(center) + spread + error
        radius = (spread + error + _ROUND * size) * _UP + _TINY
        radius = np.where(spread + error == 0, 0.0, radius)  # a number: it equals itself surely
        for name, value in (
            ("center", center), ("slope", slope), ("error", error), ("spread", spread),
            ("doubt", doubt),
            ("low", center - radius), ("high", center + radius),
        ):  # fmt: skip
            object.__setattr__(self, name, value)

    center: Floats  # [N]
    slope: Floats  # [k, N]
    error: Floats  # [N]
    spread: Floats  # [N] sum of the slopes' sizes
    doubt: Doubt

    def like(self, other: Number) -> "Affine":
        """Return another number, or its bounds, as a function of the same starts."""
        if isinstance(other, Affine):
            return other
        other = Intervals.of(other)
        if other.low is other.high:
            none = np.zeros_like(self.center)
            return Affine(none + other.low, np.zeros_like(self.slope), none, self.doubt)
        return self._unrelated(other)

    def _unrelated(self, other: Intervals) -> "Affine":
        """Return intervals as numbers of which only the bounds are known."""
        center = middle(other.low, other.high) + np.zeros_like(self.center)
        radius = np.maximum(other.high - center, center - other.low) * _UP + _TINY
        return Affine(center, np.zeros_like(self.slope), radius, self.doubt)

    def __add__(self, other: Number) -> "Affine":
        other = self.like(other)
        center = self.center + other.center
        return _rounded(center, self.slope + other.slope, self.error + other.error, self.doubt)

    __radd__ = __add__

    def __neg__(self) -> "Affine":
        return Affine(-self.center, -self.slope, self.error, self.doubt)

    def __mul__(self, other: Number) -> "Affine":
        number = not isinstance(other, Intervals)
        other = self.like(other)
        mine, theirs = np.abs(self.center), np.abs(other.center)
        slope = self.slope * other.center
        error = theirs * self.error
        if not number:
            slope = slope + self.center * other.slope
            error = error + mine * other.error + self._radius * other._radius
            # The two parts of a slope may cancel, their roundings do not.
            error = error + _ROUND * (theirs * self.spread + mine * other.spread)
        return _rounded(self.center * other.center, slope, error, self.doubt)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> "Affine":
        return self * self.like(other)._inverse()

    def __rtruediv__(self, other: Number) -> "Affine":
        return self.like(other) * self._inverse()

    def square(self) -> "Affine":
        """Return the squares; the square of the deviation from the center is at least 0."""
        half = self._radius * self._radius / 2
        error = 2 * np.abs(self.center) * self.error + half
        return _rounded(
            self.center * self.center + half, 2 * self.center * self.slope, error, self.doubt
        )

    def cos(self) -> "Affine":
        """Return cosines: their tangents, and at most half of the distance squared."""
        return self._curved(np.cos(self.center), -np.sin(self.center), 1.0)

    def sin(self) -> "Affine":
        """Return sines, as cosines."""
        return self._curved(np.sin(self.center), np.cos(self.center), 1.0)

    def sqrt(self) -> Intervals:
        """Return square roots; near 0 only their bounds."""
        known = self.low > 0
        floor = np.where(known, self.low, 1.0)
        center = np.where(known, self.center, 1.0)
        root = np.sqrt(center)
        found = self._curved(root, 0.5 / root, 0.25 / (floor * np.sqrt(floor)))
        return found.chosen(known, self._unrelated(Intervals.sqrt(self)))

    def _inverse(self) -> "Affine":
        """Return 1 / x; unbounded where x may be 0."""
        known = (self.low > 0) | (self.high < 0)
        least = np.where(known, np.minimum(np.abs(self.low), np.abs(self.high)), 1.0)
        center = np.where(known, self.center, 1.0)
        found = self._curved(1.0 / center, -1.0 / (center * center), 2.0 / least**3)
        unbounded = np.where(known, found.error, np.inf)
        return Affine(found.center, found.slope, unbounded, self.doubt)

    def _curved(self, value: Floats, tangent: Floats, bend: Floats | float) -> "Affine":
        """Return a function with this value, tangent and most bend, to second order."""
        error = np.abs(tangent) * self.error + 0.5 * bend * self._radius**2
        size = np.abs(value) + np.abs(tangent) * self._radius
        error = error + 2 * LIBRARY * (1.0 + size + self._radius)
        return _rounded(value, tangent * self.slope, error, self.doubt)

    @property
    def _radius(self) -> Floats:
        radius: Floats = (self.spread + self.error) * _UP
        return radius

    def chosen(self, truth: Booleans, other: Intervals) -> "Affine":
        """Return this where something is true, else the other."""
        other = self.like(other)
        return Affine(
            np.where(truth, self.center, other.center),
            np.where(truth, self.slope, other.slope),
            np.where(truth, self.error, other.error),
            self.doubt,
        )

    def either(self, truth: Truth, other: Intervals, both: Intervals) -> "Affine":
        """Return this where surely true, the other where surely not, else between ``both``."""
        found = self.chosen(truth.surely, other)
        unsure = truth.maybe & ~truth.surely
        return found.chosen(~unsure, self._unrelated(both)) if unsure.any() else found

    def settled(self, truth: Truth) -> Truth:
        """Return a statement about a jump, with the side that is assumed where it is not sure."""
        unsure = truth.maybe & ~truth.surely
        if not unsure.any():
            return truth
        assumed = self.doubt.assumed
        self.doubt.unsure[unsure] += 1
        return Truth(
            truth.surely | (unsure & (assumed == 1)), truth.maybe & ~(unsure & (assumed == 0))
        )


def _rounded(center: Floats, slope: Floats, error: Floats, doubt: Doubt) -> Affine:
    """Return a result, its rounding added to the error."""
    size = np.abs(center) + np.abs(slope).sum(axis=0) + error
    return Affine(center, slope, (error + _ROUND * size) * _UP + _TINY, doubt)
