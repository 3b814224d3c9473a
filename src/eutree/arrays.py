"""Array aliases. Shapes are written behind each use, as in ``x: Floats  # [N, d]``.

Letters used for shapes throughout: N transitions or rows, d features, A actions, L leaves
(states of the leaf MDP), M nodes of a tree, T steps of an episode, E episodes or environments.
"""

import math
from dataclasses import fields
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Float32s = NDArray[np.float32]
Integers = NDArray[np.int64]
Int16s = NDArray[np.int16]  # read in random order: small ones stay in the cache
Int32s = NDArray[np.int32]
Uint32s = NDArray[np.uint32]
Unsigned = NDArray[np.uint64]
Booleans = NDArray[np.bool_]

_Scalar = TypeVar("_Scalar", bound=np.generic)


def frozen(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return the array itself if nobody can write to it, else a read-only C-ordered copy of it."""
    is_shared = isinstance(array.base, np.ndarray) and array.base.flags.writeable
    if not (array.flags.writeable or is_shared) and array.flags.c_contiguous:
        return array
    copy = np.array(array, order="C", copy=True)
    copy.setflags(write=False)
    return copy


def read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return a read-only view: kernels are compiled again for arrays that differ in this."""
    view = array.view()
    view.setflags(write=False)
    return view


def grown(array: NDArray[_Scalar], size: int, fill: float = 0) -> NDArray[_Scalar]:
    """Return an array of another length that begins with the entries of this one."""
    new = np.empty((size, *array.shape[1:]), dtype=array.dtype)
    new[: len(array)], new[len(array) :] = array, fill
    return new


def freeze(one: object, *names: str, dtype: Any = None) -> None:
    """Make arrays of a frozen dataclass read-only, and of this type if one is named."""
    for name in names:
        object.__setattr__(one, name, frozen(np.asarray(getattr(one, name), dtype=dtype)))


class Frozen:
    """A frozen dataclass whose arrays stay read-only in a copy and in another process.

    Kernels are compiled again for arrays that differ in this. What was computed of its fields is
    not copied.
    """

    def __getstate__(self) -> dict[str, Any]:
        """Return its fields alone."""
        return {one.name: getattr(self, one.name) for one in fields(cast(Any, self))}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take them back."""
        arrays = {k: frozen(v) for k, v in state.items() if isinstance(v, np.ndarray)}
        vars(self).update(state | arrays)


def plain(value: Any) -> Any:
    """Return ``value`` in JSON's own types; a number that is not finite becomes null."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
