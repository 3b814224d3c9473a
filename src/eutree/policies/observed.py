"""An observation in the form of its environment, as the numbers that a tree reads.

A policy does not know its environment, so the entries of a dict are found by the names that
``eutree.interaction.describe`` gives them: ``"speed"``, ``"lidar.x0"``, ``"arm.angle"``.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError, shown


def rows_of(observation: Any, names: Sequence[str]) -> Floats:
    """Return one observation as a vector [d], or a batch as a matrix [E, d].

    Args:
        observation: Numbers of shape [d] or [E, d]; one number where d is 1; or what an environment
            with a ``Dict`` or ``Tuple`` space observes, or a batch of that, whose leaves have E
            rows.
        names: Names of the d features of one observation.

    Raises:
        InvalidArgumentError: It is none of these.
    """
    size = len(names)
    if not isinstance(observation, Mapping):
        try:
            array = np.asarray(observation, dtype=np.float64)
        except (TypeError, ValueError):
            array = np.empty((0, 0))  # entries of several sizes
        if array.ndim == 0 and size == 1:
            return array.reshape(1)
        if array.ndim in (1, 2) and array.shape[-1] == size:
            return array
        if not isinstance(observation, tuple):
            shape = np.shape(observation) if array.size else f"of {shown(observation)}"
            raise InvalidArgumentError(
                f"observation must have shape ({size},) or (E, {size}), got {shape}"
            )
    return _joined(observation, names)


def _joined(observation: Any, names: Sequence[str]) -> Floats:
    """Return the entries of a dict or a tuple in the order of their names."""
    size = len(names)
    try:
        total = sum(column.size for _, column in _columns(observation, None))
        copies = None if total == size or total % size else total // size
        columns = _columns(observation, copies)
    except (TypeError, ValueError):
        columns = []
    found = [name for name, _ in columns]
    if isinstance(observation, tuple) and len(found) == size:
        return np.stack([column for _, column in columns], axis=-1)
    if sorted(found) != sorted(names):
        listing = ", ".join(names)
        raise InvalidArgumentError(
            f"observation must have the entries {shown(listing)}, got "
            f"{shown(', '.join(found)) if found else shown(observation)}; eutree.play, "
            "eutree.evaluate and eutree.interaction.GuardedEnv make them of what an environment "
            "observes"
        )
    by_name = dict(columns)
    return np.stack([by_name[name] for name in names], axis=-1)


def _columns(value: Any, copies: int | None) -> list[tuple[str, Floats]]:
    """Return the numbers in a nested value by name: each alone, or those of a batch, [E]."""
    if isinstance(value, Mapping):
        parts = [(str(key), part) for key, part in value.items()]
    elif isinstance(value, tuple):
        parts = [(f"x{i}", part) for i, part in enumerate(value)]
    else:
        array = np.asarray(value, dtype=np.float64)
        rows = array.reshape(-1) if copies is None else array.reshape(copies, -1).T
        return [(f"x{i}", np.asarray(row)) for i, row in enumerate(rows)]
    named = []
    for key, part in parts:
        columns = _columns(part, copies)
        alone = len(columns) == 1
        named += [(key if alone else f"{key}.{name}", column) for name, column in columns]
    return named
