"""Ways to damage arrays."""

import numpy as np


def damages(array):
    """Yield what may become of an array."""
    yield "missing", None
    yield "an axis more", array[np.newaxis]
    yield "no axis", array.reshape(-1)[:1].reshape(()) if array.size else np.zeros(())
    yield "complex", array.astype(complex)
    yield "text", np.full(array.shape, "x")
    for axis in range(array.ndim):
        if array.shape[axis]:
            yield f"shorter along {axis}", np.delete(array, -1, axis)
            yield f"twice along {axis}", np.repeat(array, 2, axis)
        yield f"empty along {axis}", np.take(array, [], axis)
        first = np.zeros_like(np.take(array, [0], axis)) if array.size else array
        yield f"longer along {axis}", np.concatenate([array, first], axis)
    if array.size:
        for value in extremes(array.dtype):
            for place in (0, -1):
                changed = array.copy()
                changed.reshape(-1)[place] = value
                yield f"{value} at {place}", changed


def extremes(dtype):
    if dtype.kind == "f":
        return (np.nan, np.inf, -np.inf, np.finfo(dtype).max, np.finfo(dtype).min, -1.0, 0.5)
    if dtype.kind == "b":
        return (True, False)
    return (np.iinfo(dtype).max, np.iinfo(dtype).min, np.iinfo(dtype).max // 2, 0, 1, 7)
