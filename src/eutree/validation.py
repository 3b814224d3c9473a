"""The shared argument checks: each message names the argument, its rule and the value given."""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError, UnknownNameError, needed, shown

MAX_SEED = 2**63 - 1

_Value = TypeVar("_Value")


def check_number(
    name: str,
    value: object,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    low_open: bool = False,
    high_open: bool = False,
) -> float:
    """Return ``value`` as a finite float inside the interval, or raise InvalidArgumentError."""
    ends = "[("[low_open or low == -math.inf], "])"[high_open or high == math.inf]
    interval = f"{ends[0]}{low:g}, {high:g}{ends[1]}"
    number = math.nan
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
        with suppress(OverflowError):  # of an integer beyond all floats
            number = float(value)
    too_low = number <= low if low_open else number < low
    too_high = number >= high if high_open else number > high
    if not math.isfinite(number) or too_low or too_high:
        raise InvalidArgumentError(f"{name} must be a number in {interval}, got {shown(value)}")
    return number


def check_integer(name: str, value: object, *, low: int = 0, high: int | None = None) -> int:
    """Return ``value`` as an int of at least ``low`` (and at most ``high``), or raise."""
    bounds = f"an integer >= {low}" if high is None else f"an integer from {low} to {high}"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InvalidArgumentError(f"{name} must be {bounds}, got {shown(value)}")
    number = int(value)
    if number < low or (high is not None and number > high):
        raise InvalidArgumentError(f"{name} must be {bounds}, got {shown(value)}")
    return number


def check_kind(name: str, value: object, kind: type[_Value]) -> _Value:
    """Return ``value`` if it is of a class, a text plain, or raise InvalidArgumentError."""
    if isinstance(value, np.str_):  # as scikit-learn has the names of classes
        value = str(value)
    if isinstance(value, kind):
        return value
    reads = hasattr(kind, "load") and isinstance(value, str | Path)
    raise InvalidArgumentError(
        f"{name} must be {'' if kind.__name__.endswith('s') else 'a '}{kind.__name__}, "
        f"got {shown(value)}{f'; {kind.__name__}.load reads that' if reads else ''}"
    )


def check_truth(name: str, value: object) -> bool:
    """Return ``value`` if it is a truth value, NumPy's too, or raise InvalidArgumentError."""
    return check_kind(name, bool(value) if isinstance(value, np.bool_) else value, bool)


def check_function(name: str, value: _Value) -> _Value:
    """Return ``value`` if it can be called, or raise InvalidArgumentError."""
    if not callable(value):
        raise InvalidArgumentError(f"{name} must be a function, got {shown(value)}")
    return value


def check_offered(kind: str, points: Iterable[EntryPoint]) -> Any:
    """Return the object that entry points of one name offer, or raise InvalidArgumentError."""
    offers = {point.value: point for point in points}
    value, point = min(offers.items())
    if len(offers) > 1:
        several = ", ".join(sorted(offers))
        raise InvalidArgumentError(f"{kind} {point.name!r} is offered by several: {several}")
    try:
        return point.load()
    except (Exception, SystemExit) as error:  # whatever a package's author lets happen
        where = "" if value == point.name else f", {value},"
        raise InvalidArgumentError(
            f"{kind} {point.name!r}{where} cannot be imported: {error}"
        ) from error


def check_listed(name: str, values: Iterable[_Value]) -> tuple[_Value, ...]:
    """Return ``values``, or raise: a text would be taken for its letters."""
    if isinstance(values, str) or not np.iterable(values):
        what = "the text " * isinstance(values, str) + shown(values)
        raise InvalidArgumentError(f"{name} must be a list, got {what}")
    return tuple(values)


def check_amounts(value: object, **least: int) -> None:
    """Raise unless each attribute is an integer of at least so much, or its usual None."""
    for name, low in least.items():
        amount = getattr(value, name)
        if amount is not None or getattr(type(value), name, low) is not None:
            check_integer(name, amount, low=low)


def check_measures(value: object, names: str, **bounds: Any) -> None:
    """Raise unless each attribute, in words apart, is such a number, or its usual None."""
    for name in names.split():
        number = getattr(value, name)
        if number is not None or getattr(type(value), name, 0.0) is not None:
            check_number(name, number, **bounds)


def check_choice(name: str, value: _Value, choices: Iterable[_Value]) -> _Value:
    """Return ``value`` if it is among ``choices``, or raise UnknownNameError with the nearest."""
    choices = list(choices)
    if value not in choices:
        raise UnknownNameError(name, str(value), map(str, choices))
    return value


def check_numbers(name: str, value: ArrayLike, *, ndim: int) -> Floats:
    """Return ``value`` as a C-contiguous float64 matrix or vector, which may hold NaN."""
    what, shape = ("a matrix", "(N, d)") if ndim == 2 else ("a vector", "(N,)")
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"{name} must be {what} of numbers: {error}") from None
    if array.ndim != ndim:
        raise InvalidArgumentError(f"{name} must have shape {shape}, got shape {array.shape}")
    return array


def elsewhere(names: Sequence[str], known: Sequence[str]) -> bool:
    """Return whether a name stands at another place than it has among those that are known."""
    return any(one != own and one in known for one, own in zip(names, known, strict=False))


def has_own(value: Any, name: str) -> bool:
    """Return whether a value has an attribute of that name, and not a column or an entry."""
    return hasattr(type(value), name) or name in getattr(value, "__dict__", ())


def columns_of(value: Any) -> list[Any]:
    """Return the names of the columns of a frame, or of the entries of a row of it; else none."""
    for names in ("column_names", "columns", "index"):  # the columns of pyarrow are arrays
        if has_own(value, names):
            labels = getattr(value, names)
            return list(labels) if isinstance(labels, Iterable) else []
    return []


def in_order(name: str, value: Any, names: Sequence[str]) -> Any:
    """Return a frame, or a row of one, in the order of ``names``; what names no column as it is."""
    labels = columns_of(value)
    if labels == list(names) or set(labels).isdisjoint(names):
        return value
    if len(labels) != len(names) or set(labels) != set(names):
        raise InvalidArgumentError(f"{name} must have the columns {list(names)}, got {labels}")
    return value.select(list(names)) if has_own(value, "column_names") else value[list(names)]


def check_observations(
    name: str, value: ArrayLike, *, n_features: int | None = None, names: Sequence[str] = ()
) -> Floats:
    """Return ``value`` as a C-contiguous float64 array of shape [N, d] with finite values.

    The columns of a frame are taken by name, where ``names`` has those of the d features.
    """
    array = check_numbers(name, in_order(name, value, names), ndim=2)
    n_features = len(names) or n_features
    if n_features is not None and array.shape[1] != n_features:
        raise InvalidArgumentError(f"{name} must have {n_features} columns, got {array.shape[1]}")
    check_finite(name, array)
    return array


def check_vector(name: str, value: ArrayLike, *, size: int | None = None) -> Floats:
    """Return ``value`` as a C-contiguous float64 vector with finite values."""
    array = check_numbers(name, value, ndim=1)
    if size is not None and array.size != size:
        raise InvalidArgumentError(f"{name} must have {size} entries, got {array.size}")
    check_finite(name, array)
    return array


def check_range(name: str, value: object) -> tuple[float, float]:
    """Return ``value`` as the two ends of a range whose width is finite too, or raise."""
    try:
        low, high = (float(end) for end in value)  # type: ignore[attr-defined]  # refused below
    except (TypeError, ValueError, OverflowError):
        low, high = math.nan, math.nan
    if not (low <= high and math.isfinite(high - low)):
        raise InvalidArgumentError(
            f"{name} must be the lowest and the highest of a finite range, got {shown(value)}"
        )
    return low, high


def check_actions(name: str, value: ArrayLike, *, size: int | None = None) -> Integers:
    """Return ``value`` as a vector of action indices (int64, none negative)."""
    array = np.asarray(value)
    if array.ndim != 1:
        raise InvalidArgumentError(f"{name} must have shape (N,), got shape {array.shape}")
    if size is not None and array.size != size:
        raise InvalidArgumentError(f"{name} must have {size} entries, got {array.size}")
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise InvalidArgumentError(f"{name} must hold integers, got {array.dtype}")
    if array.size and array.min() < 0:
        raise InvalidArgumentError(f"{name} must hold integers >= 0, got {array.min()}")
    return np.ascontiguousarray(array, dtype=np.int64)


def check_whole(name: str, value: ArrayLike) -> None:
    """Raise InvalidArgumentError unless all entries are integers, of whatever type."""
    array = np.asarray(value)
    if array.dtype.kind not in "iubf" or (array.dtype.kind == "f" and (array % 1 != 0).any()):
        raise InvalidArgumentError(f"{name} must hold integers, got {shown(value)}")


def check_finite(name: str, array: Floats) -> None:
    """Raise InvalidArgumentError naming the first entry that is NaN or infinite."""
    finite = np.isfinite(array)
    if not finite.all():
        place = tuple(int(i) for i in np.argwhere(~finite)[0])
        where = ", ".join(map(str, place))
        raise InvalidArgumentError(f"{name} must be finite, got {array[place]} at [{where}]")


def check_seed(seed: object) -> int:
    """Return ``seed`` as an int from 0 to ``MAX_SEED``, or raise InvalidArgumentError."""
    return check_integer("seed", seed, low=0, high=MAX_SEED)


def data_frame(columns: Mapping[str, Any], *, index: Mapping[str, Any]) -> Any:
    """Return a ``pandas.DataFrame`` of columns, and of levels of its index, by name, each [N].

    Raises:
        MissingExtraError: pandas is not installed.
    """
    with needed("pandas", ""):
        import pandas  # type: ignore[import-untyped]  # has no types
    levels = pandas.MultiIndex.from_arrays(list(index.values()), names=list(index))
    if len(index) == 1:
        levels = levels.get_level_values(0)
    return pandas.DataFrame(dict(columns), index=levels)
