"""Columns of one length that grow together, by appending rows."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans

_FIRST_ROOM = 64
_GROWTH = 1.25


class Columns:
    """Arrays with one entry, or one row, for each of N items; there is room for more.

    Args:
        kinds: Shape of an entry and dtype of each column.

    Attributes:
        size: Number of items N.
        whole: Each column with its spare room, shape [C, ...]; other arrays after ``reserve``.
    """

    def __init__(self, kinds: Mapping[str, tuple[tuple[int, ...], type]]) -> None:
        self.size = 0
        self.whole: dict[str, NDArray[Any]] = {
            name: np.empty((_FIRST_ROOM, *shape), dtype) for name, (shape, dtype) in kinds.items()
        }
        self._room = _FIRST_ROOM

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column, shape [N, ...]; a view."""
        return self.whole[name][: self.size]

    def reserve(self, size: int, most: int | None = None) -> bool:
        """Make room for so many items and some more, ``most`` in all; return if there was none."""
        if size <= self._room:
            return False
        spare = int(self._room * _GROWTH) + 1
        self._room = max(size, spare if most is None else min(spare, most))
        for name, column in self.whole.items():
            grown = np.empty((self._room, *column.shape[1:]), dtype=column.dtype)
            grown[: self.size] = column[: self.size]
            self.whole[name] = grown
        return True

    def keep(self, stay: Booleans) -> None:
        """Keep the items for which ``stay`` [N] is True, in order."""
        size = int(stay.sum())
        for column in self.whole.values():
            column[:size] = column[: self.size][stay]
        self.size = size

    @property
    def nbytes(self) -> int:
        """Bytes held, spare room included."""
        return sum(column.nbytes for column in self.whole.values())
