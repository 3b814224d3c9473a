"""Compiled sorting and ranking for the search of splits."""

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import compiled

LABEL_BITS = 31  # low bits of a key; the 32 bits above hold an image of the value
LABEL_MASK = (1 << LABEL_BITS) - 1


@compiled
def sorted_labels(
    column: Floats,  # [n]
    label: Integers,  # [n] label of each entry, a permutation of 0..n-1
    entry: Integers,  # [n] entry of each label
    keys: Integers,  # [n] scratch
    spare: Integers,  # [n] scratch
    differs: Booleans,  # [n] out: entry i of the sorted column differs from entry i - 1
) -> Integers:
    """Return the labels in the order of the column (in ``keys`` or ``spare``).

    A key is a coarse, monotone image of the value above the label. Radix sorting the images and
    then repairing the few neighbours with equal images is exact, however much the image loses;
    where it loses too much (far outliers) the values themselves are compared.
    """
    n = column.size
    # Two passes of 8 bits for small samples: 2^11 counters would cost more than they sort.
    digit = 8 if n <= 2000 else 11
    n_digits = 2 if n <= 200_000 else 3
    low = high = column[0]
    for j in range(n):
        low = column[j] if column[j] < low else low
        high = column[j] if column[j] > high else high
    n_bits = min(32, digit * n_digits)
    scale = 0.0
    if low < high:
        if not 1e-290 < 0.5 * high - 0.5 * low < 1e290:
            return sorted_exactly(column, label, keys, differs)
        # Two less than all values of the image, so that rounding up stays inside.
        scale = (float(1 << n_bits) - 2.0) / (high - low)
    for j in range(n):  # differences, products and truncation are monotone: so is the image
        keys[j] = (int((column[j] - low) * scale) << LABEL_BITS) | label[j]
    order = radix_sorted(keys, spare, digit, n_digits)
    if not repaired(order, column, entry, differs):
        return sorted_exactly(column, label, keys, differs)
    for i in range(n):
        order[i] &= LABEL_MASK
    return order


@compiled
def radix_sorted(keys: Integers, spare: Integers, digit: int, n_digits: int) -> Integers:
    """Sort by the digits above the label, lowest first; return the array that holds the result."""
    n, size = keys.size, 1 << digit
    mask = size - 1
    starts = np.zeros((n_digits, size), dtype=np.int64)
    # All digits are counted in one pass: sorting by one does not change the counts of another.
    for j in range(n):
        for k in range(n_digits):
            starts[k, (keys[j] >> (LABEL_BITS + k * digit)) & mask] += 1
    source, target = keys, spare
    for k in range(n_digits):
        start = starts[k]
        total = 0
        # Counts become places: the next key with this digit goes to start[value]. Stable, so the
        # order by lower digits stays within equal ones.
        for value in range(size):
            count = start[value]
            start[value] = total
            total += count
        shift = LABEL_BITS + k * digit
        for j in range(n):
            value = (source[j] >> shift) & mask
            target[start[value]] = source[j]
            start[value] += 1
        source, target = target, source
    return source


@compiled
def repaired(order: Integers, column: Floats, entry: Integers, differs: Booleans) -> bool:
    """Sort runs of equal images by value, by insertion; return False if that is too much work."""
    n = order.size
    # Insertion is quadratic in a run; beyond this the exact sort costs less.
    budget = 4 * n
    known, before = -1, 0.0  # the value at place ``known``: loads are the cost of long runs of ties
    differs[0] = False
    for i in range(1, n):
        key, k = order[i], i
        image = key >> LABEL_BITS
        differs[i] = order[i - 1] >> LABEL_BITS != image
        if differs[i]:
            continue
        value = column[entry[key & LABEL_MASK]]
        if known != i - 1:
            before = column[entry[order[i - 1] & LABEL_MASK]]
        if before <= value:
            differs[i] = before < value
            known, before = i, value
            continue
        while (
            k > 0
            and order[k - 1] >> LABEL_BITS == image
            and value < column[entry[order[k - 1] & LABEL_MASK]]
        ):
            order[k] = order[k - 1]
            k -= 1
        order[k] = key
        budget -= i - k
        if budget < 0:
            return False
    if budget < 4 * n:
        mark_differences(order, column, entry, differs)
    return True


@compiled
def mark_differences(order: Integers, column: Floats, entry: Integers, differs: Booleans) -> None:
    """Set ``differs`` of keys in their final order."""
    for i in range(1, order.size):
        differs[i] = order[i - 1] >> LABEL_BITS != order[i] >> LABEL_BITS or (
            column[entry[order[i - 1] & LABEL_MASK]] < column[entry[order[i] & LABEL_MASK]]
        )


@compiled
def sorted_exactly(column: Floats, label: Integers, keys: Integers, differs: Booleans) -> Integers:
    """Write the labels in the order of the column to ``keys``, by comparison; return them."""
    order = np.argsort(column)
    differs[0] = False
    for i in range(1, column.size):
        differs[i] = column[order[i - 1]] < column[order[i]]
    for i in range(column.size):
        keys[i] = label[order[i]]
    return keys


@compiled
def dense_ranks(differs: Booleans) -> tuple[Int32s, Floats]:
    """Return the dense rank of each place and, for each rank, the number of places up to it."""
    n = differs.size
    rank_at = np.empty(n, dtype=np.int32)
    cumulative = np.empty(n)
    rank = 0
    for p in range(n):
        if differs[p]:
            rank += 1
        rank_at[p] = rank
        cumulative[rank] = p + 1
    return rank_at, cumulative[: rank + 1].copy()
