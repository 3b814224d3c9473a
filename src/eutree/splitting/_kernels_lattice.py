"""Compiled exact law of the two-sample Kolmogorov-Smirnov distance."""

import numpy as np

from eutree.compiled import compiled


@compiled
def chance_of_leaving(n_left: int, n_right: int, bound: int) -> float:
    """Return P(max |i n_right - j n_left| >= bound) over random orders of two samples.

    A random order is a lattice path from (0, 0) to (n_left, n_right); ``inside[j]`` is the chance
    that it reaches (i, j) without having left. What leaves is summed as it leaves: no difference
    of nearly equal numbers is taken, so that small probabilities keep their digits.
    """
    if bound <= 0:
        return 1.0
    inside = np.zeros(n_right + 1)
    inside[0] = 1.0
    left = 0.0
    for i in range(n_left + 1):
        for j in range(n_right + 1):
            here = 0.0
            if i == 0 and j == 0:
                here = 1.0
            if i > 0:  # inside[j] still belongs to row i - 1
                # The next of the tuples left is of the first sample with chance (those left of it)
                # / all left.
                remaining = float(n_left + n_right - i - j + 1)
                here += inside[j] * (float(n_left - i + 1) / remaining)
            if j > 0:
                remaining = float(n_left + n_right - i - j + 1)
                here += inside[j - 1] * (float(n_right - j + 1) / remaining)
            # Paths that have left are not followed: each is counted once, where it first leaves.
            if abs(i * n_right - j * n_left) >= bound:
                left += here
                here = 0.0
            inside[j] = here
    return left
