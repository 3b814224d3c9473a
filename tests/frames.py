"""Stand-ins for the frames of other libraries, with no more than eutree asks of them."""

from collections.abc import Iterable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Frame:
    """A frame as pandas and polars have it: ``columns`` are names."""

    def __init__(
        self, rows: Iterable[Sequence[Any]], columns: Iterable[Any], dtypes: Iterable[Any] = ()
    ) -> None:
        self.rows = np.array([*map(list, rows)], dtype=object)
        self.columns = list(columns)
        self.dtypes = list(dtypes) or ["float64"] * len(self.columns)
        self.shape = self.rows.shape

    def __len__(self) -> int:
        return len(self.rows)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return self.rows.astype(dtype or object)

    def __getitem__(self, names: list[Any]) -> "Frame":
        places = [self.columns.index(name) for name in names]
        kinds = [self.dtypes[place] for place in places]
        return Frame(self.rows[:, places], names, kinds)


class Table(Frame):
    """A table as pyarrow has it: ``columns`` are arrays, which no set takes."""

    def __init__(
        self, rows: Iterable[Sequence[Any]], columns: Iterable[Any], dtypes: Iterable[Any] = ()
    ) -> None:
        super().__init__(rows, columns, dtypes)
        self.column_names = self.columns
        self.schema = SimpleNamespace(types=self.dtypes)
        self.columns = [*self.rows.T]
        del self.dtypes

    def select(self, names: list[Any]) -> "Table":
        places = [self.column_names.index(name) for name in names]
        return Table(self.rows[:, places], names, [self.schema.types[place] for place in places])

    def __getitem__(self, place: int) -> NDArray[Any]:  # type: ignore[override]
        return self.columns[int(place)]


class Row:
    """A row of a frame of pandas: ``index`` has the names."""

    def __init__(self, values: Iterable[Any], index: Iterable[Any]) -> None:
        self.index = list(index)
        self.values = dict(zip(self.index, values, strict=True))
        self.shape = (len(self.index),)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array([*self.values.values()], dtype=dtype)

    def __getitem__(self, names: list[Any]) -> "Row":
        return Row([self.values[name] for name in names], names)
