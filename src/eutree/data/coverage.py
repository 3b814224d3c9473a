"""Between which values the features of demonstrations lie, and in which bin each value falls."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.data.demonstrations import Demonstrations

FILLED = 0.5  # share of a feature's bounds below which the values seen bound a drawing


def bins_of(observations: Floats, low: Floats, high: Floats, n_bins: int) -> Integers:
    """Return the bin of each value, shape [N, d]; a feature without a range has bin 0."""
    # Halves, because high - low may overflow.
    width = high / 2 - low / 2
    zeros = np.zeros_like(observations)
    shares = np.divide(observations / 2 - low / 2, width, out=zeros, where=width > 0)
    return np.clip((shares * n_bins).astype(np.int64), 0, n_bins - 1)


def bounds_of(demonstrations: Demonstrations) -> tuple[Floats, Floats]:
    """Return the schema's bounds where both are finite, else the range seen; each of shape [d]."""
    observations, features = demonstrations.observations, demonstrations.schema.features
    low = np.array([feature.low for feature in features])
    high = np.array([feature.high for feature in features])
    if not len(observations):
        return np.zeros_like(low), np.zeros_like(high)
    bounded = np.isfinite(low) & np.isfinite(high)
    return (
        np.where(bounded, low, observations.min(axis=0)),
        np.where(bounded, high, observations.max(axis=0)),
    )


def drawn_bounds(demonstrations: Demonstrations) -> tuple[Floats, Floats]:
    """Return between which values each feature is drawn; each of shape [d].

    These are its bounds or, where the values seen fill less than half of them, the values seen.
    """
    low, high = bounds_of(demonstrations)
    observations = demonstrations.observations
    if not len(observations):
        return low, high
    seen = observations.min(axis=0), observations.max(axis=0)
    # Halves, because high - low may overflow. A feature that never moved keeps its bounds.
    width, reach = high / 2 - low / 2, seen[1] / 2 - seen[0] / 2
    narrow = (reach > 0) & (reach < FILLED * width)
    # Adding 0 makes a -0 that was recorded, or is a bound, a 0.
    return np.where(narrow, seen[0], low) + 0.0, np.where(narrow, seen[1], high) + 0.0
