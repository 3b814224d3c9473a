"""Whether a box of features holds an observation, where some features are derived of others.

A leaf of a tree that asks for ``lead = distance_1 - distance_2`` is a box of all three numbers, and
no observation has a lead of 5 with both distances in [0, 2]. So a box is halved along the features
that are not derived, until a part has an observation whose derived features lie in the box, too, or
no part is left where they could. What formulas are in a part is bounded as it is computed
(``eutree.formulas.ON_RANGES_OR_NAN``), so both answers are exact, for all finite doubles.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.features import formulas_of, parts_of
from eutree.formulas import ON_RANGES_OR_NAN, Formula
from eutree.inspection.regions import LARGEST, Region, is_box
from eutree.schema import Schema
from eutree.trees.boxes import possible

MOST_PARTS = 20_000
_AT_ONCE = 256  # the latest ones, so that a first observation is found soon
_WIDE = 16.0  # so many times as large: halved by magnitude


class Occurrence(NamedTuple):
    """A point that was found in a box.

    Where it is no observation, derived features included, none was found, and it is not known that
    there is none.
    """

    point: Floats  # [d]
    is_real: bool  # whether it is an observation

    @property
    def caution(self) -> str:
        """What to say behind a box; nothing where an observation was found."""
        return "" if self.is_real else "; no such observation was found, nor that there is none"


@dataclass(frozen=True)
class Occurring:
    """Looks for observations in boxes.

    A derived feature that asks for a step which is unknown may be anything, like one measured.
    """

    schema: Schema  # the d features, and how some of them are derived
    # Of these features nothing is asked: a derived one may be NaN, which is in no box, but takes
    # the right branch of every test
    free: frozenset[int] = frozenset()
    most: int | None = None  # parts of a box that are looked at; None for ``MOST_PARTS``

    def within(self, box: Region) -> Occurrence | None:
        """Look for an observation in a box; None where there is none."""
        if not self._formulas:  # any point is one
            return Occurrence(box.point(self.schema), True)
        bounded = set(np.flatnonzero(np.isfinite(box.low) | np.isfinite(box.high)).tolist())
        bounded |= parts_of(bounded, self._formulas)
        asked = {j: formula for j, formula in self._formulas.items() if j in bounded}
        parts = np.stack([box.low, box.high])[:, np.newaxis]
        left = MOST_PARTS if self.most is None else self.most
        parts[1] = np.minimum(parts[1], LARGEST)
        while parts.shape[1]:
            if left <= 0:
                return Occurrence(box.point(self.schema), False)
            parts, latest = parts[:, :-_AT_ONCE], parts[:, -_AT_ONCE:]
            left -= latest.shape[1]
            latest = latest[:, self._reached(latest, box, asked)[0]]
            rows = self._points(latest)
            is_right = np.isnan(rows) & self._is_right(box)
            fits = is_right | (rows > box.low) & (rows <= box.high)
            if fits.all(axis=1).any():
                return Occurrence(rows[fits.all(axis=1).argmax()], True)
            if fits[:, sorted(bounded)].all(axis=1).any():  # but others are NaN, or -inf
                asked = self._formulas
            parts = np.concatenate([parts, self._halves(latest, box, asked)], axis=1)
        return None

    @cached_property
    def _formulas(self) -> dict[int, Formula]:
        """The formulas of those features that others determine."""
        return {j: one for j, one in formulas_of(self.schema).items() if not one.remembers}

    def _reached(
        self, parts: Floats, box: Region, formulas: Mapping[int, Formula]
    ) -> tuple[Booleans, Floats]:
        """Return whether derived features of parts may be in a box, and how far they reach beyond.

        The parts are exclusive lower and inclusive upper bounds, shape [2, N, d].
        """
        low, high = parts
        first = np.where(self._is_whole, np.floor(low) + 1.0, np.nextafter(low, np.inf))
        may_be, beyond = np.ones(len(low), dtype=bool), np.zeros(len(low))
        measured = [(*ends, False) for ends in zip(first.T, high.T, strict=True)]
        ranges, is_right = _derived(measured, formulas, ON_RANGES_OR_NAN), self._is_right(box)
        with np.errstate(invalid="ignore", over="ignore"):
            for j in formulas:
                least, most, may_be_nan = ranges[j]
                inside = (least <= box.high[j]) & (most > box.low[j])
                may_be &= inside | (may_be_nan & is_right[j])
                for reach in (box.low[j] - least, most - box.high[j]):
                    beyond += np.clip(np.nan_to_num(reach, nan=0.0), 0.0, LARGEST / 1e4)
        return may_be, beyond

    def _is_right(self, box: Region) -> Booleans:
        """Return of which features [d] the box takes a NaN."""
        return np.isin(np.arange(self.schema.n_features), list(self.free)) & np.isinf(box.high)

    @cached_property
    def _is_whole(self) -> Booleans:
        return np.array([one.is_integer for one in self.schema.features])

    def _cuts(self, parts: Floats) -> Floats:
        """Return where each side of parts is halved, shape [N, d]; at its end where it cannot be.

        That is in the middle or, of numbers of unlike magnitudes, at 0 or the middle magnitude.
        """
        low, high = np.clip(parts, -LARGEST, LARGEST)
        ends = np.abs([low, high])
        least, most = np.maximum(ends.min(axis=0), 1.0), ends.max(axis=0)
        magnitude = np.where(high > 0.0, 1.0, -1.0) * np.sqrt(least) * np.sqrt(most)
        magnitude = np.where((low < 0.0) & (high > 0.0), 0.0, magnitude)
        cut = np.where(most / _WIDE > least, magnitude, low / 2 + high / 2)
        cut = np.where(self._is_whole, np.floor(cut), cut)
        return np.where((low < cut) & (cut < high), cut, high)

    def _points(self, parts: Floats) -> Floats:
        """Return a row of each part, as it would be observed and derived, shape [N, d]."""
        found = self._cuts(parts)
        for group in map(list, self.schema.groups.values()):
            found[:, group] = np.eye(len(group))[(parts[1][:, group] >= 1.0).argmax(axis=1)]
        columns = _derived(list(found.T), self._formulas)
        return np.stack([np.broadcast_to(one, len(found)) for one in columns], axis=1)

    def _halves(self, parts: Floats, box: Region, formulas: Mapping[int, Formula]) -> Floats:
        """Return both halves of each part, along the feature that bounds the derived ones best.

        A part with one value of each feature in formulas has none.
        """
        cuts, high = self._cuts(parts), parts[1]
        score = np.full(cuts.shape, np.inf)
        for j in sorted(parts_of(formulas, formulas) - formulas.keys()):
            thin = parts.copy()
            thin[0, :, j], thin[1, :, j] = np.nextafter(cuts[:, j], -np.inf), cuts[:, j]
            _, beyond = self._reached(thin, box, formulas)
            score[:, j] = np.where(cuts[:, j] < high[:, j], beyond, np.inf)
        has = np.isfinite(score.min(axis=1))
        lower, upper = parts[:, has], parts[:, has]
        rows, along = np.arange(has.sum()), score[has].argmin(axis=1)
        lower[1, rows, along] = upper[0, rows, along] = cuts[has][rows, along]
        low, high = np.concatenate([lower, upper], axis=1)
        low, high = possible(low, high, self.schema)
        return np.stack([low, high])[:, is_box(low, high)]


def _derived(
    columns: list[Any], formulas: Mapping[int, Formula], operations: Mapping[str, Any] | None = None
) -> list[Any]:
    """Return columns, numbers or ranges of them, with those that formulas determine."""
    for j, formula in formulas.items():
        columns[j] = formula.compute(columns, columns.__getitem__, operations)
    return columns
