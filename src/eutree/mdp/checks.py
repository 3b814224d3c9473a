"""What transitions must be before compiled loops count with them."""

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Int32s
from eutree.errors import InvalidArgumentError


def labels(name: str, value: ArrayLike, low: int, stop: int) -> Int32s:
    """Return the value as a new int32 vector with entries in low..stop - 1, or raise."""
    array = np.asarray(value)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise InvalidArgumentError(
            f"{name} must be a vector of integers, got shape {array.shape} of {array.dtype}"
        )
    if array.size and not low <= array.min() <= array.max() < stop:
        raise InvalidArgumentError(
            f"{name} must be in {low}..{stop - 1}, got {array.min()}..{array.max()}"
        )
    return np.array(array, dtype=np.int32)


def never_counted(row: int, state: int, action: int, next_state: int) -> InvalidArgumentError:
    """Return the error for a transition that cannot be taken back."""
    return InvalidArgumentError(
        f"row {row} must be a transition that was counted before, got state {state}, "
        f"action {action}, next state {next_state}"
    )
