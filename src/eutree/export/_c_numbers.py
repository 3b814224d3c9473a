"""The number types of exported C: how each one writes a threshold without changing a decision.

``double`` thresholds are written in hexadecimal, so no compiler rounds them. For a narrower type
the threshold becomes the largest value of that type that is not above it: then ``x <= rounded``
and ``x <= exact`` agree on every ``x`` of that type. For ``int32`` the integer ``r`` stands for the
double nearest to ``r / scale``, so a threshold becomes the largest ``r`` whose double passes the
test: ``floor(threshold * scale)``, but for the last bit of that division.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

import numpy as np

from eutree.arrays import Integers
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.policies import TreePolicy
from eutree.schema import Feature
from eutree.trees import DecisionTree
from eutree.trees.edit import reachable
from eutree.validation import check_choice, check_number

Number = Literal["double", "float", "int32"]
Scale = float | Mapping[str, float] | None

C_TYPES: Mapping[str, str] = {"double": "double", "float": "float", "int32": "int32_t"}
_LOWEST, _HIGHEST = -(2**31), 2**31 - 1
_LARGEST_FLOAT = float(np.finfo(np.float32).max)
_BEYOND_FLOAT = 2.0**128 - 2.0**103  # the smallest number that would be rounded to infinity


@dataclass(frozen=True)
class Numbers:
    """A number type of C, with the scale of each feature where the type is an integer."""

    number: Number
    scales: tuple[float, ...] = ()  # integers per unit of each feature; empty unless "int32"

    @property
    def c_type(self) -> str:
        """The type in C."""
        return C_TYPES[self.number]

    def test(self, tree: DecisionTree, node: int) -> str:
        """Return the test of a node as a C expression."""
        x, threshold = f"observation[{tree.feature[node]}]", float(tree.threshold[node])
        if self.number == "double":
            return f"{x} <= {hexadecimal(threshold)}"
        if self.number == "int32":
            return f"{x} <= {integer(int(threshold))}"
        below = float_below(threshold)
        if math.isinf(below):  # C has no constant for -inf, which alone passes
            return f"{x} < {hexadecimal(-_LARGEST_FLOAT)}F"
        return f"{x} <= {hexadecimal(below)}F"

    def measured(self, feature: int) -> str:
        """Return the observation that an entry stands for as a double of C."""
        stored = f"(double)observation[{feature}]"
        scaled = self.number == "int32"
        return f"{stored} / {hexadecimal(self.scales[feature])}" if scaled else stored

    def value(self, stored: float, feature: int) -> float:
        """Return the observation that a stored number of this type stands for."""
        return stored / self.scales[feature] if self.number == "int32" else float(stored)

    def constant(self, stored: float) -> str:
        """Return a stored number as a constant of C."""
        if self.number == "int32":
            return integer(int(stored))
        if math.isnan(stored):
            return f"({self.c_type})NAN"
        if math.isinf(stored):
            return f"({self.c_type}){'-' if stored < 0 else ''}INFINITY"
        return hexadecimal(stored) + ("F" if self.number == "float" else "")


def numbers(policy: TreePolicy, number: Number, scale: Scale) -> Numbers:
    """Check the choice of a number type and return it with the scale of each feature."""
    check_choice("number", number, C_TYPES)
    levels = (abs(level) for control in policy.schema.controls for level in control.levels)
    if number != "double" and (largest := max(levels, default=0.0)) >= _BEYOND_FLOAT:
        raise InvalidArgumentError(
            f"number must be double for levels beyond single precision, {largest!r}, got {number!r}"
        )
    if number != "int32":
        if scale is not None:
            raise InvalidArgumentError(
                f"scale must be left out unless number is int32, got {scale!r}"
            )
        return Numbers(number)
    features = policy.schema.measured.features
    if isinstance(scale, Mapping):
        for name in scale:
            known = policy.schema.measured.feature_names
            if name not in known:
                raise UnknownNameError("feature in scale", name, known)
        scales = [scale.get(feature.name, _scale_of(feature)) for feature in features]
    else:
        scales = [_scale_of(feature) if scale is None else scale for feature in features]
    for feature, value in zip(features, scales, strict=True):
        if value is None:
            raise InvalidArgumentError(
                f"scale must be given for feature {feature.name!r}, which has no bounds"
            )
        check_number(f"scale of feature {feature.name!r}", value, low=1e-9, high=1e9)
    return Numbers(number, tuple(float(value) for value in scales if value is not None))


def in_integers(policy: TreePolicy, scales: tuple[float, ...]) -> tuple[TreePolicy, Integers]:
    """Return the policy over scaled integers, without the tests that every int32 decides alike.

    Return also the number that each of its leaves has in the given one, shape [L].
    """
    tree = policy.tree
    inner = np.flatnonzero(tree.feature != tree.NO_FEATURE)
    limit = np.full(tree.n_nodes, np.nan)
    for node in inner.tolist():
        limit[node] = largest_integer(float(tree.threshold[node]), scales[tree.feature[node]])
    reached = np.ones(tree.n_nodes, dtype=np.bool_)
    reached[tree.left[inner]] = limit[inner] >= _LOWEST
    reached[tree.right[inner]] = limit[inner] < _HIGHEST
    scaled, before = reachable(replace(tree, threshold=limit), reached)
    policy = replace(policy, leaves=None, ranks=None, locked=())
    return replace(policy, tree=scaled, actions=policy.actions[before]), before


def largest_integer(threshold: float, scale: float) -> int:
    """Return the largest int32 ``r`` with ``r / scale <= threshold``; one below all if none is."""
    limit = math.floor(Fraction(threshold) * Fraction(scale))
    limit = min(max(limit, _LOWEST - 1), _HIGHEST)
    if limit < _HIGHEST and (limit + 1) / scale <= threshold:
        limit += 1
    if limit >= _LOWEST and limit / scale > threshold:
        limit -= 1
    return limit


def float_below(threshold: float) -> float:
    """Return the largest float32 that is not above ``threshold``, minus infinity if none is."""
    if threshold >= _LARGEST_FLOAT:
        return _LARGEST_FLOAT
    if threshold < -_LARGEST_FLOAT:
        return -math.inf
    nearest = np.float32(threshold)
    if float(nearest) > threshold:
        nearest = np.nextafter(nearest, np.float32(-np.inf))
    return float(nearest)


def hexadecimal(value: float) -> str:
    """Return a finite number as a hexadecimal constant of C, without needless zeros."""
    mantissa, exponent = value.hex().split("p")
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}p{exponent}"


def integer(value: int) -> str:
    """Return an int32 as a constant of C; the lowest one has no literal of its own."""
    return "INT32_MIN" if value == _LOWEST else str(value)


def _scale_of(feature: Feature) -> float | None:
    """Return the largest power of two that fits the feature's bounds into 31 bits, if any."""
    largest = max(abs(feature.low), abs(feature.high))
    if not 0 < largest < math.inf:
        return None if largest else 1.0
    return 2.0 ** min(max(30 - math.frexp(largest)[1], -29), 29)
