"""Nominal columns: which they are, which values they have, and their codes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError, UnknownNameError


def nominal_mask(table: Any, nominal: Any) -> Booleans:
    """Return which columns are nominal, shape [d]; an empty mask if there is nothing to choose.

    Args:
        table: The training set, an array or a data frame.
        nominal: Indices, column names, a mask, ``"auto"`` (columns of dtype ``category``) or None.
    """
    dtypes: Any = getattr(table, "dtypes", None)
    framed = dtypes is not None and hasattr(table, "columns")
    if nominal is None or (isinstance(nominal, str) and nominal == "auto" and not framed):
        return np.zeros(0, dtype=bool)
    if isinstance(nominal, str):
        if nominal != "auto":
            raise InvalidArgumentError(
                "nominal_features must be 'auto', None, indices, column names or a mask, "
                f"got {nominal!r}"
            )
        return np.array([str(dtype) == "category" for dtype in dtypes], dtype=np.bool_)
    shape = np.shape(table)
    if len(shape) != 2:
        raise InvalidArgumentError(f"X must have shape (N, d) and be 2D, got shape {shape}")
    columns = [str(name) for name in table.columns] if framed else []
    return _chosen(list(nominal), shape[1], columns)


def text_columns(table: Any, nominal: Booleans) -> list[str] | list[int]:
    """Return the columns that would be nominal if all that hold strings were, and those that are.

    Args:
        table: The training set; its columns are named where it is a data frame, else numbered.
        nominal: Which columns are nominal already, shape [d], or empty.
    """
    rows = np.asarray(table, dtype=object)
    wanted = [
        column
        for column in range(rows.shape[1])
        if (nominal.size and nominal[column]) or any(_is_text(v) for v in rows[:, column])
    ]
    if hasattr(table, "columns"):
        return [str(table.columns[column]) for column in wanted]
    return wanted


def _is_text(value: Any) -> bool:
    """Return whether a value is a string that is no number."""
    if not isinstance(value, str):
        return False
    try:
        float(value)
    except ValueError:
        return True
    return False


def _chosen(nominal: list[Any], n_features: int, columns: Sequence[str]) -> Booleans:
    mask = np.zeros(n_features, dtype=bool)
    if nominal and all(isinstance(entry, bool | np.bool_) for entry in nominal):
        if len(nominal) != n_features:
            raise InvalidArgumentError(
                f"nominal_features must have {n_features} entries as a mask, got {len(nominal)}"
            )
        return np.array(nominal, dtype=bool)
    for entry in nominal:
        if isinstance(entry, str):
            if entry not in columns:
                raise UnknownNameError("column in nominal_features", entry, columns)
            mask[columns.index(entry)] = True
        elif isinstance(entry, int | np.integer) and 0 <= entry < n_features:
            mask[entry] = True
        else:
            raise InvalidArgumentError(
                f"nominal_features must hold indices in 0..{n_features - 1} or names, got {entry!r}"
            )
    return mask


def values_of(frame: Any, table: NDArray[Any], column: int) -> NDArray[Any]:
    """Return the values of a nominal column: those its dtype declares, else those that occur."""
    declared = getattr(getattr(frame, "dtypes", None), "iloc", {column: None})[column]
    if hasattr(declared, "categories"):
        return np.asarray(declared.categories, dtype=object)
    known = [value for value in table[:, column] if not is_missing(value)]
    found = sorted(set(known), key=lambda value: (str(type(value)), value))
    return np.array([*found, None], dtype=object)[:-1]  # one-dimensional whatever they are


def is_missing(value: object) -> bool:
    """Return whether a value stands for an unknown one: None, NaN or pandas.NA."""
    return value is None or type(value).__name__ == "NAType" or value != value


def encode(
    table: NDArray[Any], categories: Sequence[NDArray[Any] | None], handle_unknown: str
) -> Floats:
    """Return the table as numbers: codes in nominal columns, NaN for what is unknown.

    Raises:
        InvalidArgumentError: If a continuous column does not hold finite numbers (or NaN), or a
            nominal one holds a new value and ``handle_unknown`` is ``"error"``.
    """
    numbers = np.empty(table.shape)
    for j, values in enumerate(categories):
        column = table[:, j]
        if values is None:
            numbers[:, j] = _numbers(column, j)
            continue
        code_of = {value: code for code, value in enumerate(values)}
        codes = [np.nan if is_missing(value) else code_of.get(value, -1) for value in column]
        numbers[:, j] = codes
        new = numbers[:, j] < 0
        if new.any() and handle_unknown == "error":
            listing = sorted({repr(value) for value in column[new]})
            raise InvalidArgumentError(
                f"found unknown categories [{', '.join(listing)}] in column {j}; "
                "handle_unknown='missing' would treat them as unknown values"
            )
        numbers[new, j] = np.nan
    return numbers


def _numbers(column: NDArray[Any], j: int) -> Floats:
    known = [np.nan if is_missing(value) else value for value in column]
    try:
        numbers = np.array(known, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"column {j} must hold numbers: {error}") from None
    if np.isinf(numbers).any():
        raise InvalidArgumentError(f"column {j} must not hold infinity")
    return numbers
