"""The unit of a feature: how far one step usually changes it."""

import numpy as np

from eutree.arrays import Floats


def step_scale(observations: Floats, next_observations: Floats) -> Floats:
    """Return the standard deviation of the changes in one step, shape [d]; 1 where there are none.

    Multiplying a feature by a power of two multiplies its scale by the same, to the bit, so the
    regions stay the same.
    """
    changes = (next_observations - observations).std(axis=0)
    return np.where(changes > 0.0, changes, 1.0)
