"""Intervals that remember how they depend on the start: affine arithmetic.

A number that a program computes from a start is ``center + slope . x + error * y`` with the start's
place x in [-1, 1]^k and some y in [-1, 1]. Where two numbers depend on the start in the same way,
their difference is known to be small although both are wide; plain intervals forget that, and a box
that is turned grows at every step. The part that is not linear, and all rounding, of the program
and of what is computed here, goes into ``error``.

Reference: L. H. de Figueiredo, J. Stolfi, *Affine arithmetic: concepts and applications*, Numerical
Algorithms 37 (2004); here with one error for all that is not linear in the start.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.proof.intervals import LIBRARY, Intervals, Number, Truth, middle

_ROUND = 2.0**-51  # of a result's size: its rounding in the program, and twice that of ours
_UP = 1.0 + 2.0**-48  # errors are sums of a few terms, each rounded
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Doubt:
    """What a step of N boxes is not sure of: which side of a jump they are on.

    Attributes:
        unsure: How many jumps a box straddles; counted while the step is computed.
        assumed: Which side is taken: 1 where the statement holds, 0 where not, -1 for both.
    """

    unsure: Integers  # [N]
    assumed: Integers  # [N]


class Affine(Intervals):
    """N numbers as functions of the start of their piece.

    Args:
        center: Values in the middle of the piece, shape [N].
        slope: Half the change across the piece, shape [k, N].
        error: What they may be off, shape [N].
        doubt: That of the step; one for all numbers that are computed in it.
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

    def _like(self, other: Number) -> "Affine":
        """Return another number, or what is known of it, as a function of the same starts."""
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
        other = self._like(other)
        center = self.center + other.center
        return _rounded(center, self.slope + other.slope, self.error + other.error, self.doubt)

    __radd__ = __add__

    def __neg__(self) -> "Affine":
        return Affine(-self.center, -self.slope, self.error, self.doubt)

    def __mul__(self, other: Number) -> "Affine":
        number = not isinstance(other, Intervals)
        other = self._like(other)
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
        return self * self._like(other)._inverse()

    def __rtruediv__(self, other: Number) -> "Affine":
        return self._like(other) * self._inverse()

    def square(self) -> "Affine":
        """Return the squares; the square of what is not the center is at least 0."""
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
        other = self._like(other)
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
