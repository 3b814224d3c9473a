"""Compiled loops over nominal values: their classes, their gain, the values that share a branch."""

import math

import numpy as np

from eutree.arrays import Floats, Int16s, Int32s
from eutree.compiled import compiled_later


@compiled_later
def xlogx_table(size: int) -> Floats:
    """Return x log2 x for x = 0, 1, ..., size - 1."""
    table = np.zeros(size)
    # The limit of x log x at 0 is 0, and so is 1 log 1: both stand there already.
    for x in range(2, size):
        table[x] = x * math.log2(x)
    return table


@compiled_later
def xlogx(x: float, table: Floats) -> float:
    """Return x log2 x, from the table if there is one (then x must be a whole number)."""
    if table.size > 0:
        return float(table[int(x + 0.5)])
    # A weight from which all was subtracted again is 0 up to rounding, and may be negative.
    if x <= 1e-9:
        return 0.0
    return x * math.log2(x)


@compiled_later
def count_values(
    frequency: Floats,  # [V, A] out
    codes: Floats,  # [N, d]
    feature: int,
    cases: Int32s,  # [E] of the node
    row: Int32s,  # [cases]
    label: Int16s,  # [cases]
    weight: Floats,  # [cases]
) -> float:
    """Count the classes of each value of a nominal attribute; return the known weight."""
    for v in range(frequency.shape[0]):
        for c in range(frequency.shape[1]):
            frequency[v, c] = 0.0
    known = 0.0
    for i in range(cases.size):
        case = cases[i]
        code = codes[row[case], feature]
        if not math.isnan(code):
            w = 1.0 if weight.size == 0 else weight[case]
            frequency[int(code), label[case]] += w
            known += w
    return known


@compiled_later
def nominal_gain(
    frequency: Floats,  # [V, A]
    n_blocks: int,
    known: float,
    total: float,
    min_objects: float,
    table: Floats,
) -> tuple[bool, float, float]:
    """Return (whether two blocks are large enough, gain, split information) of the blocks."""
    # base becomes the node's weight times entropy, T(known) - sum over classes of T(class) with
    # T(x) = x log2 x.
    base = xlogx(known, table)
    for c in range(frequency.shape[1]):
        count = 0.0
        for v in range(n_blocks):
            count += frequency[v, c]
        base -= xlogx(count, table)
    info = 0.0
    # Cases of unknown value are one more branch of the split information.
    split = xlogx(total, table) - xlogx(total - known, table)
    reasonable = 0
    # info: weight times entropy within the blocks before v; split: T(total) less their T(size).
    for v in range(n_blocks):
        size = 0.0
        for c in range(frequency.shape[1]):
            size += frequency[v, c]
            info -= xlogx(frequency[v, c], table)
        info += xlogx(size, table)
        split -= xlogx(size, table)
        # C4.5 asks for two branches at least that are no exceptions.
        if size >= min_objects - 1e-9 and size > 0.0:
            reasonable += 1
    return reasonable >= 2, (base - info) / total, split / total


@compiled_later
def merge_values(
    frequency: Floats,  # [V, A] changed in place: its first rows become the blocks
    block: Int32s,  # [V] out: block of each value, -1 for a value that does not occur
    n_values: int,
    known: float,
    total: float,
    min_objects: float,
    table: Floats,
    tolerance: float,
) -> tuple[int, bool, float, float]:
    """Group the values of a nominal attribute; return (blocks, two large enough, gain, info).

    Begins with one block for each value that occurs, joins blocks of one and the same class, then
    joins the pair that gives the greatest gain ratio for as long as the ratio grows (or fewer
    than two blocks are large enough) and more than two blocks are left.
    """
    n_blocks = 0
    # n_blocks <= v: rows move to the front and never onto one that is still to be read.
    for v in range(n_values):
        block[v] = -1
        if frequency[v].sum() > 0.0:
            block[v] = n_blocks
            for c in range(frequency.shape[1]):
                frequency[n_blocks, c] = frequency[v, c]
            n_blocks += 1
    a = 0
    # No block before a shares a pure class with a later one, nor a with those between a and b.
    # Joining blocks of one class loses no information.
    while a < n_blocks - 1 and n_blocks > 2:
        b = a + 1
        while b < n_blocks and n_blocks > 2:
            size, most = 0.0, 0.0
            for c in range(frequency.shape[1]):
                joint = frequency[a, c] + frequency[b, c]
                size += joint
                most = max(most, joint)
            if size - most <= tolerance:
                n_blocks = join_blocks(frequency, block, a, b, n_blocks, n_values)
            else:
                b += 1
        a += 1
    reasonable, gain, split = nominal_gain(frequency, n_blocks, known, total, min_objects, table)
    # reasonable, gain and split are those of the present blocks, one fewer in every round.
    while n_blocks > 2:
        best = -1.0
        best_a, best_b = 0, 1
        for a in range(n_blocks - 1):
            for b in range(a + 1, n_blocks):
                size_a, size_b = frequency[a].sum(), frequency[b].sum()
                joined = xlogx(size_a + size_b, table)
                # Joining changes the terms of these two blocks only: ``lost`` is what it takes from
                # the split information, ``info`` what it takes from the gain.
                lost = joined - xlogx(size_a, table) - xlogx(size_b, table)
                info = lost
                for c in range(frequency.shape[1]):
                    in_a, in_b = frequency[a, c], frequency[b, c]
                    info -= xlogx(in_a + in_b, table) - xlogx(in_a, table) - xlogx(in_b, table)
                new_split = split - lost / total
                ratio = (gain - info / total) / new_split if new_split > 0.0 else 0.0
                if ratio > best + tolerance:
                    best = ratio
                    best_a, best_b = a, b
        if reasonable and (split <= 0.0 or best <= gain / split + tolerance):
            break
        n_blocks = join_blocks(frequency, block, best_a, best_b, n_blocks, n_values)
        reasonable, gain, split = nominal_gain(
            frequency, n_blocks, known, total, min_objects, table
        )
    return n_blocks, reasonable, gain, split


@compiled_later
def join_blocks(
    frequency: Floats, block: Int32s, a: int, b: int, n_blocks: int, n_values: int
) -> int:
    """Add block ``b`` to block ``a``, move later blocks up, and return how many are left."""
    for c in range(frequency.shape[1]):  # a slice takes seconds to compile
        frequency[a, c] += frequency[b, c]
        for later in range(b + 1, n_blocks):
            frequency[later - 1, c] = frequency[later, c]
    # The numbers of blocks stay dense, so those above b go down by one.
    for v in range(n_values):
        if block[v] == b:
            block[v] = a
        elif block[v] > b:
            block[v] -= 1
    return n_blocks - 1
