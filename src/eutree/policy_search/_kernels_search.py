"""Compiled search for the box of a leaf in which another action pays most.

Apart from ``_kernels.py`` because it looks at data and runs nothing.
"""

import numpy as np

from eutree import features
from eutree.arrays import Floats, Integers
from eutree.compiled import compiled

threshold_between = compiled(features.threshold_between)

MAX_CUTS = 6


@compiled
def best_interval(
    values: Floats,  # [n]
    gains: Floats,  # [n]
    order: Integers,  # [n] sorts the values
    min_rows: int,
    open_below: bool,
    open_above: bool,
) -> tuple[float, int, int]:
    """Return the largest sum of gains over an interval of the sorted values, with its two ends.

    Cuts fall between distinct values. An interval open below starts at the first value, one open
    above ends at the last. Kadane's scan, with a delay that keeps ``min_rows`` rows inside.
    """
    n = values.size
    # sums[i]: gains of the first i values, so an interval's gain is a difference of two.
    sums = np.zeros(n + 1)
    for i in range(n):
        sums[i + 1] = sums[i] + gains[order[i]]
    best, begin, end = -np.inf, 0, -1
    least, least_at = np.inf, -1
    # least is the smallest sums[i] of an interval that may start at i and hold min_rows up to j:
    # the best interval that ends at j starts there.
    for j in range(n):
        i = j - min_rows + 1
        starts = i == 0 or (i > 0 and not open_below and values[order[i - 1]] < values[order[i]])
        if starts and sums[i] < least:
            least, least_at = sums[i], i
        ends = j == n - 1 or (not open_above and values[order[j]] < values[order[j + 1]])
        if least_at >= 0 and ends and sums[j + 1] - least > best:
            best, begin, end = sums[j + 1] - least, least_at, j
    return best, begin, end


@compiled
def best_box(
    observations: Floats,  # [N, d]
    gains: Floats,  # [N]
    rows: Integers,  # [n]
    min_rows: int,
    price: float,
    box: Floats,  # [d, 2] out: lower and upper cut, infinite where there is none
) -> tuple[float, int]:
    """Return the sum of gains inside the box, and its cuts.

    Starts from all rows and restricts one feature at a time to the interval that gains most after
    ``price`` for each cut, while that gains anything.
    """
    d = observations.shape[1]
    box[:, 0] = -np.inf
    box[:, 1] = np.inf
    inside = rows.copy()
    total = 0.0
    for i in range(inside.size):
        total += gains[inside[i]]
    cuts = 0
    # inside are the rows in the box so far, in their old order, and total their gains.
    while cuts < MAX_CUTS and inside.size >= 2 * min_rows:
        n = inside.size
        best, feature, low, high, n_cuts = 1e-12, -1, -np.inf, np.inf, 0
        values, mine = np.empty(n), gains[inside]
        for j in range(d):
            for i in range(n):
                values[i] = observations[inside[i], j]
            order = np.argsort(values)
            # Open below, open above, or cut on both sides: each cut has its price.
            for shape in range(3):
                sum_inside, begin, end = best_interval(
                    values, mine, order, min_rows, shape == 0, shape == 1
                )
                new = int(begin > 0) + int(end < n - 1)
                if end < 0 or new == 0:
                    continue
                gain = sum_inside - total - price * new
                if gain > best:
                    best, feature, n_cuts = gain, j, new
                    low, high = -np.inf, np.inf
                    if begin > 0:
                        low = threshold_between(values[order[begin - 1]], values[order[begin]])
                    if end < n - 1:
                        high = threshold_between(values[order[end]], values[order[end + 1]])
        if feature < 0:
            break
        # A feature may be cut twice; the box only ever narrows.
        box[feature, 0] = max(box[feature, 0], low)
        box[feature, 1] = min(box[feature, 1], high)
        cuts += n_cuts
        kept, total = 0, 0.0
        for i in range(n):
            row = inside[i]
            if observations[row, feature] > low and observations[row, feature] <= high:
                inside[kept] = row
                kept += 1
                total += gains[row]
        inside = inside[:kept]
    return total, cuts
