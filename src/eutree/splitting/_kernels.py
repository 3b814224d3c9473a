"""Compiled search for the best cut of a sample, in exact integer arithmetic.

The tuples are sorted by an attribute; ``rank`` is the dense rank of their returns (equal returns,
equal rank) and ``C(v)`` the number of tuples with rank <= v. With ``c_i(v)`` for the same number
among the first i tuples, every cut i has the integers

    W_i(v) = n c_i(v) - i C(v),    max_v |W_i(v)| = i (n - i) D_i,

where D_i is the two-sample Kolmogorov-Smirnov distance. Scores are W / (i (n - i)) = D_i and
W * W / (i (n - i)) = n K_i^2: one correctly rounded division each, so that they are monotone in W.
Larger scores win, then the lower attribute, then the lower i. All sums are integers; where they
are kept as float64 they stay below 2^53 for every n up to ``LARGEST`` tuples.
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import compiled
from eutree.splitting._kernels_sorting import dense_ranks, sorted_labels

LARGEST = 1 << 26  # n^2 <= 2^52
BRUTE = 192  # from here on the blocks pay
SAFE = 1.0 - 1e-12  # bounds this much below the best score cannot reach it in any rounding
BLOCK_SHARE = 0.3  # of sqrt(n): tuples in a block
SMALLEST_STRIP = 4


class Ordered(NamedTuple):
    """The tuples in the order of an attribute, and the conditions of a cut."""

    rank: Int32s  # [n]
    legal: Booleans  # [n] legal[i]: a threshold separates the first i tuples from the rest
    side: int  # least number of tuples on either side
    distance: bool  # whether the score is D, not n K^2


class Blocks(NamedTuple):
    """The blocks of columns, and how many tuples of each the search has consumed."""

    Cl: Floats  # [n_blocks] tuples before the block; up to its end if it is a single column
    Ch: Floats  # [n_blocks] tuples up to the end of the block
    reached: Floats  # [n_blocks] consumed ones with a rank up to the end of the block
    inside: Floats  # [n_blocks] those of them that lie in it; 0 if it is a single column
    hc: Floats  # [n_blocks] rows of the strip up to the end of the block
    mx: Floats  # [n_blocks] rows of the strip before the block; hc if it is a single column
    bound: Floats  # [n_blocks] most that |W| can be in the strip


class Cell(NamedTuple):
    """A block in a strip (a, b]."""

    a: int
    b: int
    start: int  # first column of the block
    before: float  # consumed tuples below the block
    Cl: float
    Ch: float
    hc: float
    mx: float


class Best(NamedTuple):
    """The best cut so far: its score, i (0: none) and max |W_i|."""

    score: float
    cut: int
    weight: float


@compiled
def best_of_sample(
    x: Floats,  # [N, d]
    returns: Floats,  # [N]
    rows: Integers,  # [n] the tested tuples
    side: int,
    distance: bool,
    floor: float,
    block: int,  # columns of a block; 0: chosen by n
    brute: int,  # samples up to this size are searched by brute force
) -> tuple[int, int, float, float, float, float]:
    """Return (attribute, i, max |W_i|, score, left value, right value) of the best cut.

    The attribute is -1 if no legal cut of any attribute has a score above ``floor``.
    """
    n, d = rows.size, x.shape[1]
    found, cut, weight, best, left, right = -1, 0, 0.0, floor, 0.0, 0.0
    column, label = np.empty(n), np.arange(n)
    keys, spare = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    differs, rank = np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.int32)
    for j in range(n):
        column[j] = returns[rows[j]]
    by_return = sorted_labels(column, label, label.copy(), keys, spare, differs).copy()
    rank_at, cumulative = dense_ranks(differs)  # by place: position in the order of the returns
    # All returns are equal: no cut has a distance.
    if cumulative.size == 1:
        return found, cut, weight, best, left, right
    for p in range(n):
        label[by_return[p]] = p  # from here on a tuple is known by its place
    for feature in range(d):
        for j in range(n):
            column[j] = x[rows[j], feature]
        places = sorted_labels(column, label, by_return, keys, spare, differs)
        for i in range(n):
            rank[i] = rank_at[places[i]]
        # The best score so far is the floor of the next attribute, so ties keep the lower one.
        i, w, score = best_cut(rank, differs, cumulative, side, distance, best, block, brute)
        if i > 0:
            found, cut, weight, best = feature, i, w, score
            left, right = column[by_return[places[i - 1]]], column[by_return[places[i]]]
    return found, cut, weight, best, left, right


# Searching the cuts of one attribute


@compiled
def best_cut(
    rank: Int32s,  # [n] in the order of the attribute
    legal: Booleans,  # [n] legal[i]: a threshold separates the first i tuples from the rest
    cumulative: Floats,  # [m] C(v)
    side: int,
    distance: bool,
    floor: float,
    block: int,
    brute: int,
) -> tuple[int, float, float]:
    """Return (i, max |W_i|, score) of the best cut above ``floor``; i = 0 if there is none."""
    n = rank.size
    if n <= brute:
        return brute_force(rank, legal, cumulative, side, distance, floor)
    if block == 0:
        block = max(4, int(BLOCK_SHARE * np.sqrt(float(n))))
    return search_strips(rank, legal, cumulative, side, distance, floor, block)


@compiled
def brute_force(
    rank: Int32s, legal: Booleans, cumulative: Floats, side: int, distance: bool, floor: float
) -> tuple[int, float, float]:
    """Search by following W over all columns. For n <= 2^15: |W| + n < 2^31."""
    n, m = rank.size, cumulative.size
    falls, rises = np.empty(m, dtype=np.int32), np.empty(m, dtype=np.int32)
    W = np.zeros(m, dtype=np.int32)
    for v in range(m):
        falls[v] = np.int32(cumulative[v])
        rises[v] = np.int32(n - cumulative[v])
    best, cut, weight = floor, 0, 0.0
    # W[v] = n c_i(v) - i C(v): tuple i adds n - C(v) from its rank on and takes C(v) before.
    for i in range(1, n - side + 1):
        start = rank[i - 1]
        below, above = W[:start], W[start:]  # slices keep the loops free of index checks
        falls_below, rises_above = falls[:start], rises[start:]
        for v in range(below.size):
            below[v] -= falls_below[v]
        for v in range(above.size):
            above[v] += rises_above[v]
        if i < side or not legal[i]:
            continue
        largest = np.int32(0)
        # Without branches, so that the compiler takes several columns at once.
        for v in range(m):
            size = W[v] if W[v] > 0 else -W[v]
            largest = size if size > largest else largest
        score = score_of(float(largest), n, i, distance)
        if score > best:
            best, cut, weight = score, i, float(largest)
    return cut, weight, best


@compiled
def score_of(weight: float, n: int, i: int, distance: bool) -> float:
    """Return D_i or n K_i^2 of the largest |W_i|."""
    # Rounding is monotone: of two cuts at one i, a larger |W| never has a smaller score.
    product = float(i) * float(n - i)
    return weight / product if distance else weight * weight / product


@compiled
def harmless(best: float, n: int, first: int, last: int, distance: bool) -> float:
    """Return a |W| that does not beat ``best`` at any cut from ``first`` to ``last``.

    i (n - i) is concave in i, so its minimum is at an end.
    """
    # The score inverted for |W|, less a margin for the rounding of it all.
    product = min(float(first) * float(n - first), float(last) * float(n - last))
    return best * product * SAFE if distance else np.sqrt(best * product) * SAFE


@compiled
def cut_into_blocks(cumulative: Floats, block: int) -> Integers:
    """Return the first column of each block of about ``block`` tuples, and m at the end.

    A column as heavy as a block is a block by itself: its W is then followed exactly.
    """
    m = cumulative.size
    first = np.empty(m + 1, dtype=np.int64)
    n_blocks, mass, before = 0, 0.0, 0.0
    for v in range(m):
        # mass: tuples of the block under way, before column v.
        own = cumulative[v] - before
        before = cumulative[v]
        if v == 0 or mass >= block or own >= block:
            first[n_blocks] = v
            n_blocks += 1
            mass = 0.0
        mass += own
    first[n_blocks] = m
    return first[: n_blocks + 1].copy()


@compiled
def extremes(
    consumed: Int32s,  # [L] consumed tuples of each column of the block
    cumulative: Floats,  # [L]
    before: float,
    n: float,
    row: float,
) -> tuple[float, float]:
    """Return the largest and the smallest W of a block at a row, ``before`` tuples lying below."""
    count = before
    high, low = -np.inf, np.inf
    for v in range(consumed.size):
        count += consumed[v]
        w = n * count - row * cumulative[v]
        high = w if w > high else high
        low = w if w < low else low
    return high, low


@compiled
def search_strips(
    rank: Int32s,
    legal: Booleans,
    cumulative: Floats,
    side: int,
    distance: bool,
    floor: float,
    block: int,
) -> tuple[int, float, float]:
    """Search strips of rows against blocks of columns, dropping those that bounds exclude.

    Invariant at row a: ``reached[k]`` consumed tuples have a rank up to the end of block k,
    ``inside[k]`` of them lie in it (0 if it is a single column) and ``consumed[v]`` in column v.
    A strip (a, b] is halved while so many blocks survive its bounds that looking into them would
    cost more than bounding again. Its survivors are searched one by one, so a later block may tie
    with the best cut at an earlier row: ``search_cell`` resolves that.
    """
    n, m = rank.size, cumulative.size
    first = cut_into_blocks(cumulative, block)
    n_blocks = first.size - 1
    row_block, Cl, Ch, multiple = describe_blocks(rank, cumulative, first)
    cut, weight, best = coarse_cut(row_block, legal, Ch, side, distance, floor)

    consumed, scratch = np.zeros(m, dtype=np.int32), np.empty(m, dtype=np.int32)
    reached, inside = np.zeros(n_blocks), np.zeros(n_blocks)
    hc, mx, bound = np.empty(n_blocks), np.empty(n_blocks), np.empty(n_blocks)
    ordered = Ordered(rank, legal, side, distance)
    blocks = Blocks(Cl, Ch, reached, inside, hc, mx, bound)
    counts = np.zeros(n_blocks, dtype=np.int32)
    # A first guess: doubled or halved below, as the work of searching compares with bounding.
    height = max(SMALLEST_STRIP, int(0.5 * np.sqrt(float(n))))
    a, last = 0, n - side  # the last row that can be a cut
    while a < last:
        if distance and best >= 1.0 and a >= cut:
            break  # no distance is larger, and no tie is earlier
        next_cut = max(a + 1, side)
        while next_cut <= last and not legal[next_cut]:
            next_cut += 1
        if next_cut > last:
            break
        if next_cut > a + 1:  # rows before the next legal cut are consumed unseen
            b = next_cut - 1
            count_strip(row_block[a:b], multiple, counts, mx, hc)
        else:
            b = min(last, a + height)
            while True:
                count_strip(row_block[a:b], multiple, counts, mx, hc)
                limit = harmless(best, n, a + 1, b, distance)
                n_left = bound_strip(n, a, b, limit, blocks)
                look = n_left * (block + b - a)
                if look <= 4 * (n_blocks + b - a) or b - a <= SMALLEST_STRIP:
                    break
                b = a + (b - a) // 2
            work, k = 0, 0
            while n_left > 0:
                if bound[k] > limit:
                    n_left -= 1
                    start, end = first[k], first[k + 1]
                    own, columns = consumed[start:end], cumulative[start:end]
                    # Consumed tuples below the block. A single column has none ``inside``; its own
                    # are taken out.
                    before = reached[k] - inside[k]
                    if end - start == 1:
                        before -= own[0]
                    cell = Cell(a, b, start, before, Cl[k], Ch[k], hc[k], mx[k])
                    (best, cut, weight), cell_work = search_cell(
                        ordered, cell, own, columns, scratch[: end - start], Best(best, cut, weight)
                    )
                    work += cell_work
                k += 1
            cheap = n_blocks + b - a
            height = b - a
            if work > 2 * cheap:
                height = max(SMALLEST_STRIP, height // 2)
            elif work < cheap // 2:
                height *= 2
        # The invariant at row b.
        for j in range(a, b):
            consumed[rank[j]] += 1
        for k in range(n_blocks):
            reached[k] += hc[k]
            inside[k] += hc[k] - mx[k]
        a = b
    return cut, weight, best


@compiled
def describe_blocks(
    rank: Int32s, cumulative: Floats, first: Integers
) -> tuple[Int32s, Floats, Floats, Booleans]:
    """Return the block of each row, and Cl, Ch and "several columns" of each block.

    Cl is the number of tuples before the block and Ch up to its end; for a block of a single
    column, whose W is known exactly, Cl = Ch.
    """
    n_blocks = first.size - 1
    block_of = np.empty(cumulative.size, dtype=np.int32)
    Cl, Ch = np.empty(n_blocks), np.empty(n_blocks)
    multiple = np.empty(n_blocks, dtype=np.bool_)
    # before = C of the last column of the block before k.
    before = 0.0
    for k in range(n_blocks):
        for v in range(first[k], first[k + 1]):
            block_of[v] = k
        multiple[k] = first[k + 1] - first[k] > 1
        Ch[k] = cumulative[first[k + 1] - 1]
        Cl[k] = before if multiple[k] else Ch[k]
        before = Ch[k]
    row_block = np.empty(rank.size, dtype=np.int32)
    for j in range(rank.size):
        row_block[j] = block_of[rank[j]]
    return row_block, Cl, Ch, multiple


@compiled
def count_strip(
    row_block: Int32s,  # [B]
    multiple: Booleans,  # [n_blocks]
    counts: Int32s,  # [n_blocks] zeros, left as zeros
    mx: Floats,  # [n_blocks] out: strip rows before the block; hc if it is a single column
    hc: Floats,  # [n_blocks] out: strip rows up to the end of the block
) -> None:
    """Count the rows of a strip by block."""
    for j in range(row_block.size):
        counts[row_block[j]] += 1
    run = 0
    for k in range(counts.size):
        before = run
        run += counts[k]
        counts[k] = 0
        hc[k] = run
        mx[k] = before if multiple[k] else run


@compiled
def bound_strip(n: int, a: int, b: int, limit: float, blocks: Blocks) -> int:
    """Bound |W| over the strip (a, b] and each block; return how many bounds exceed ``limit``.

    For every row of the strip and every column of the block,

         W <= n reached - a (Cl + inside) + hc (n - Cl)
        -W <= (b - a - mx) Ch + a (Ch - inside) - n (reached - inside).

    At row a a column with t of the block's consumed tuples has c = reached - inside + t and
    Cl + t <= C <= Ch - inside + t, and both bounds are monotone in t because a <= n; a later row
    adds at most n - Cl to W if its rank is not beyond the block and nothing otherwise, and adds
    at most Ch to -W if its rank is not before the block and nothing otherwise.
    """
    Cl, Ch, reached, inside, hc, mx, bound = blocks
    rows, row, end = float(n), float(a), float(b)
    n_left = 0
    for k in range(Cl.size):
        up = rows * reached[k] - row * (Cl[k] + inside[k]) + hc[k] * (rows - Cl[k])
        down = (end - mx[k]) * Ch[k] - rows * (reached[k] - inside[k]) - row * inside[k]
        bound[k] = up if up > down else down
        n_left += 1 if bound[k] > limit else 0
    return n_left


@compiled
def search_cell(
    ordered: Ordered,
    cell: Cell,
    consumed: Int32s,  # [L] of each column of the block, at row a
    cumulative: Floats,  # [L]
    scratch: Int32s,  # [L]
    best: Best,
) -> tuple[Best, int]:
    """Search one block in one strip; return the best cut, and the work done.

    From exact extremes at row a the bounds are carried row by row: a row adds n - Cl to the bound
    of W if its rank is not beyond the block, else -Cl; it adds Ch - n to the bound of -W if its
    rank is before the block, else Ch. Only where a bound beats the best score is the block
    evaluated again. An equal score at an earlier cut replaces a later one.
    """
    rank, legal, side, distance = ordered
    a, b, start, before, Cl, Ch, hc, mx = cell
    score, cut, weight = best
    n, width = rank.size, consumed.size
    rows, limit = float(n), harmless(score, n, a + 1, b, distance)
    high, low = extremes(consumed, cumulative, before, rows, float(a))
    # The gain of the whole strip does not reach the limit: nothing to look for.
    if high + hc * (rows - Cl) <= limit and (float(b - a) - mx) * Ch - low <= limit:
        return best, width
    work = width + b - a
    for v in range(width):
        scratch[v] = consumed[v]
    up, down = high, -low
    exact = width == 1  # then a row in the block moves -W exactly too
    for j in range(a, b):  # up and down bound W and -W over the block at row j
        column = rank[j] - start
        up -= Cl
        down += Ch
        if column < 0:
            before += 1.0
            up += rows
            down -= rows
        elif column < width:
            scratch[column] += 1
            up += rows
            if exact:
                down -= rows
        i = j + 1
        if (up > limit or down > limit) and i >= side and legal[i]:
            up, low = extremes(scratch, cumulative, before, rows, float(i))
            down = -low
            work += width
            w = up if up > down else down
            reached = score_of(w, n, i, distance)
            if reached > score or (reached == score and 0 < i < cut):
                score, cut, weight = reached, i, w
                limit = harmless(score, n, a + 1, b, distance)
    return Best(score, cut, weight), work


@compiled
def coarse_cut(
    row_block: Int32s,  # [n]
    legal: Booleans,
    Ch: Floats,  # [n_blocks]
    side: int,
    distance: bool,
    floor: float,
) -> tuple[int, float, float]:
    """Return a good cut above ``floor``: every 2 sqrt(n) rows, at the last columns of blocks."""
    n, n_blocks = row_block.size, Ch.size
    rows, step = float(n), int(2 * np.sqrt(float(n)))
    counts = np.zeros(n_blocks, dtype=np.int32)
    best, cut, weight = floor, 0, 0.0
    due = side
    for i in range(1, n - side + 1):
        counts[row_block[i - 1]] += 1
        if i < due or not legal[i]:
            continue
        due = i + step
        # A good score early lets bounds exclude most strips; that it is the best is not needed.
        run, high, low = 0.0, 0.0, 0.0
        for k in range(n_blocks):
            run += counts[k]
            w = rows * run - float(i) * Ch[k]
            high = w if w > high else high
            low = w if w < low else low
        w = high if high > -low else -low
        score = score_of(w, n, i, distance)
        if score > best:
            best, cut, weight = score, i, w
    return cut, weight, best
