"""Boxes of observations: their points and their description in words.

A box holds the observations with ``low < x <= high`` in every feature, like a node's. Bounds that
are given as >= or < are moved to the neighbouring double, so that every statement about boxes is
exact for every observation of doubles. NaN is in no box.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Frozen, Integers, freeze
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes, left_of_group, meetings, possible, whole_bounds
from eutree.trees.text import Digits, choice, printable, whole

_FLIPPED = {">": "<", ">=": "<="}
LARGEST = float(np.finfo(np.float64).max)


@dataclass(frozen=True, eq=False)
class Region(Frozen):
    """A box of observations.

    Attributes:
        low: Exclusive lower bounds.
        high: Inclusive upper bounds.
    """

    low: Floats  # [d]
    high: Floats  # [d]

    def __post_init__(self) -> None:
        freeze(self, "low", "high", dtype=np.float64)

    def contains(self, observation: Floats) -> bool:
        """Return whether an observation is inside."""
        return bool(((self.low < observation) & (observation <= self.high)).all())

    def meet(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """Return the part of each of some boxes [..., d] that lies in this one."""
        return np.maximum(low, self.low), np.minimum(high, self.high)

    def point(self, schema: Schema) -> Floats:
        """Return an observation inside, in the middle where the box is bounded.

        Whole where features are, if the bounds are whole; of a group the first possible category.
        """
        sides = zip(self.low.tolist(), self.high.tolist(), schema.features, strict=True)
        found = np.array([_between(low, high, one.is_integer) for low, high, one in sides])
        for group in map(list, schema.groups.values()):
            found[group] = np.arange(len(group)) == (self.high[group] >= 1.0).argmax()
        return found

    def words(
        self, schema: Schema, within: "Region | None" = None, *, digits: Digits | None = None
    ) -> str:
        """Return the box in words; bounds that ``within`` implies are left out.

        Args:
            schema: Names and units of the features.
            within: A box that is known to hold this one.
            digits: Which digits of the bounds are shown; by default those that tell them apart.
        """
        digits = Digits(schema, others=self._bounds(within)) if digits is None else digits
        parts: list[str] = []
        for number, feature in enumerate(schema.features):
            if feature.group:
                parts += self._choice(schema, feature.group, number, within)
                continue
            low, high = float(self.low[number]), float(self.high[number])
            if within is not None and low <= within.low[number]:
                low = -np.inf
            if within is not None and high >= within.high[number]:
                high = np.inf
            if feature.is_integer and np.floor(low) < np.floor(high):
                parts += filter(None, [whole(feature, low, high)])
                continue
            text = _in_words(printable(feature.name), (number, low, high), digits)
            if text:
                parts.append(text + (f" {printable(feature.unit)}" if feature.unit else ""))
        return " and ".join(parts) or "everywhere"

    def where(self, schema: Schema, within: "Region", digits: Digits | None = None) -> str:
        """Return ``words`` as they follow what is done there: "where ...", or "everywhere"."""
        words = self.words(schema, within, digits=digits)
        return words if words == "everywhere" else f"where {words}"

    def _choice(
        self, schema: Schema, name: str, number: int, within: "Region | None"
    ) -> Iterator[str]:
        """Yield which categories of a group are left, at the first of its features."""
        group = schema.groups[name]
        if number != group[0]:
            return
        named = [schema.features[member].category for member in group]
        left, known = (
            np.ones(len(group), bool)
            if region is None
            else left_of_group(region.low, region.high, group)
            for region in (self, within)
        )
        if not np.array_equal(left, known):
            told, others = (
                [category for category, one in zip(named, mask, strict=True) if one]
                for mask in (left, known & ~left)
            )
            yield choice(name, told, others=others) if told else f"{printable(name)} is nothing"

    def _bounds(self, within: "Region | None") -> Iterator[tuple[int, float]]:
        """Yield feature and value of each finite bound that ``within`` does not imply."""
        for side, bounds in (("low", self.low), ("high", self.high)):
            known = np.isinf(bounds) | (within is not None and bounds == getattr(within, side))
            for number in np.flatnonzero(~known).tolist():
                yield number, float(bounds[number])


def domain(schema: Schema) -> Region:
    """Return the observations within the schema's bounds, both included."""
    low = np.array([feature.low for feature in schema.features])
    high = np.array([feature.high for feature in schema.features])
    return Region(*possible(before(low), high, schema))


def leaf_parts(tree: DecisionTree, schema: Schema) -> tuple[Floats, Floats]:
    """Return the part of each leaf's box that lies within the schema's bounds, [L, d] each."""
    return possible(*domain(schema).meet(*leaf_boxes(tree)), schema)


def finite_box(
    schema: Schema, *trees: DecisionTree, seen: Floats | None = None
) -> tuple[Floats, Floats]:
    """Return the box that shares are of: the schema's bounds.

    An infinite bound is replaced by the outermost of the trees' thresholds on the feature and of
    the observations ``seen`` of it [N, d], moved outwards by a tenth of their span (by 1 where that
    is nothing).
    """
    low = np.array([feature.low for feature in schema.features])
    high = np.array([feature.high for feature in schema.features])
    for j in range(low.size):
        cuts = [tree.threshold[tree.feature == j] for tree in trees]
        known = np.concatenate([*cuts, [] if seen is None else seen[:, j], [low[j], high[j]]])
        known = known[np.isfinite(known)]
        least, most = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        beyond = (most / 10 - least / 10) or 1.0
        low[j] = low[j] if np.isfinite(low[j]) else least - min(beyond, LARGEST + least)
        high[j] = high[j] if np.isfinite(high[j]) else most + min(beyond, LARGEST - most)
    return whole_bounds(low, high, schema)


def ways(
    tree: DecisionTree, low: Floats, high: Floats, leaves: Integers, feature: int, *, falls: bool
) -> Iterator[tuple[Integers, Integers]]:
    """Yield pairs of leaves: raising a feature, or lowering it, leads from the first to the second.

    The first is one of ``leaves``; nothing but the feature changes. ``low`` and ``high`` bound the
    part of each leaf that is asked about, shape [L, d].
    """
    begin, end = low[leaves], high[leaves]
    if falls:
        begin[:, feature], end[:, feature] = -np.inf, low[leaves, feature]
    else:
        begin[:, feature], end[:, feature] = high[leaves, feature], np.inf
    for number, two in meetings(begin, end, tree):
        one = leaves[number]
        beyond = high[two, feature] <= low[one, feature]
        if not falls:
            beyond = low[two, feature] >= high[one, feature]
        yield one[beyond], two[beyond]


def is_box(low: Floats, high: Floats) -> Booleans:
    """Return which boxes [..., d] hold an observation."""
    return np.asarray((low < high).all(axis=-1))


def before(values: Floats) -> Floats:
    """Return the next smaller doubles; infinities stay."""
    with np.errstate(over="ignore"):  # before the least double lies minus infinity
        smaller: Floats = np.where(np.isinf(values), values, np.nextafter(values, -np.inf))
    return smaller


def _between(low: float, high: float, is_whole: bool) -> float:
    if np.isinf(low) and np.isinf(high):
        return 0.0
    if np.isinf(low):
        return float(high)
    if np.isinf(high):
        return max(float(low) + 1.0, float(np.nextafter(low, np.inf)))
    middle = float(low / 2 + high / 2)
    middle = np.ceil(middle) if is_whole and float(low).is_integer() else middle
    return middle if low < middle <= high else float(high)


def _in_words(name: str, interval: tuple[int, float, float], digits: Digits) -> str:
    """Return the interval (low, high] of a feature; nothing where it has no end."""
    feature, low, high = interval
    if np.isinf(low) and np.isinf(high):
        return ""
    if np.isinf(low):
        return f"{name} {digits.at_most(feature, high)}"
    if np.isinf(high):
        return f"{name} {digits.above(feature, low)}"
    sign, number = digits.above(feature, low).split()
    return f"{number} {_FLIPPED[sign]} {name} {digits.at_most(feature, high)}"
