"""Compiled loops of growing: the best test of each node, and the division of its cases.

A *case* is a row with a weight. A row whose tested value is unknown becomes one case in every
branch, with its weight shared out. While a tree grows, each continuous attribute keeps the cases
of a level sorted by value, node after node; dividing a node is a stable partition of every list,
so nothing is sorted twice. Unknown values are NaN and stand last.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int16s, Int32s
from eutree.compiled import compiled_later


class Nodes(NamedTuple):
    """A tree while it grows and is pruned; the children of a node stand together, after it."""

    feature: Int32s  # [M] attribute tested, -1 at a leaf
    threshold: Floats  # [M] NaN at a leaf, and where a nominal attribute is tested
    first_child: Int32s  # [M] -1 at a leaf
    n_children: Int32s  # [M] 0 at a leaf; of a nominal test one for each value
    distribution: Floats  # [M, A] weight of each class


class Lists(NamedTuple):
    """The cases of a level in the order of each continuous attribute, those of a node together."""

    starts: Int32s  # [n + 1] segments of the nodes
    values: Floats  # [lists, E] sorted within each node; NaN last
    order: Int32s  # [lists, E] the cases they belong to


class Cases(NamedTuple):
    """Rows, or parts of rows."""

    row: Int32s  # [cases]
    label: Int16s  # [cases]
    weight: Floats  # [cases]; empty if every weight is 1


class Attributes(NamedTuple):
    """The attributes that tests may use."""

    codes: Floats  # [N, d] numbers, and codes of nominal values
    n_values: Int32s  # [d] values of a nominal attribute, 0 for a continuous one
    counted: Booleans  # [d] whether its gain counts in the average
    list_of: Int32s  # [d] the list of each attribute


class Rules(NamedTuple):
    """The least that a test must reach; numbers, so that all settings are compiled once."""

    min_objects: float
    gap: float  # between two values that a cut can separate
    tolerance: float
    epsilon: float  # least split information
    start_value: float  # gain ratio to be exceeded
    use_min_split: float
    use_penalty: float
    use_filter: float
    greedy: float  # accept the best cut even if it gains nothing
    least: float  # least weight of a side even if min_split is capped below it


class Chosen(NamedTuple):
    """The test of each node."""

    feature: Int32s  # [n] attribute tested, -1 for a leaf
    cut: Floats  # [n, 2] the values on both sides of the best cut


class Tests(NamedTuple):
    """The tests of a level as cases meet them."""

    feature: Int32s  # [n] -1 for a leaf
    threshold: Floats  # [n] NaN if nominal
    offset: Int32s  # [n] first child of each node, counted within the level


class Branches(NamedTuple):
    """How the cases of a level part."""

    branch: Int32s  # [cases] -1 if unknown
    sizes: Int32s  # [children] cases with a known value
    distribution: Floats  # [children, A] their classes
    unknown_sizes: Int32s  # [n] cases with unknown value
    unknown: Floats  # [n, A] their classes


class Children(NamedTuple):
    """Where the cases of a level go."""

    forks: Int32s  # [n] branches of each node
    copy: Int32s  # [cases] first of the new cases of a case with unknown value
    opened: Booleans  # [children] whether the child may be divided again
    shared: Booleans  # [children] whether it takes part of the cases with unknown value
    starts: Int32s  # [children] where each open child's segment begins


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
    n_values: int,
    known: float,
    total: float,
    min_objects: float,
    table: Floats,
) -> tuple[bool, float, float]:
    """Return (whether two values are frequent enough, gain, split information)."""
    # base becomes the node's weight times entropy, T(known) - sum over classes of T(class) with
    # T(x) = x log2 x.
    base = xlogx(known, table)
    for c in range(frequency.shape[1]):
        count = 0.0
        for v in range(n_values):
            count += frequency[v, c]
        base -= xlogx(count, table)
    info = 0.0
    # Cases of unknown value are one more branch of the split information.
    split = xlogx(total, table) - xlogx(total - known, table)
    reasonable = 0
    # info: weight times entropy within the values before v; split: T(total) less their T(size).
    for v in range(n_values):
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
def best_cut(
    values: Floats,  # [E] of one attribute and node, sorted
    order: Int32s,  # [E] the cases they belong to
    cases: Cases,
    table: Floats,
    counts: Floats,  # [4, A] scratch: left, right, and x log x of both
    total: float,
    rules: Rules,
) -> tuple[int, float, float, float, int]:
    """Return (position, reduction, weight on the left, known weight, tries) of the best cut.

    The cut is between ``position`` and ``position + 1``; -1 if there is none. The reduction is
    the known weight times the decrease of entropy. Of equal cuts the first wins.
    """
    label, weight = cases.label, cases.weight
    tolerance = rules.tolerance
    end = values.size
    while end > 0 and math.isnan(values[end - 1]):
        end -= 1
    n_classes = counts.shape[1]
    # Unit weights are not stored: sums of them are whole numbers, at which the table of x log x is
    # read.
    unit = weight.size == 0
    left, right, left_term, right_term = counts[0], counts[1], counts[2], counts[3]
    for c in range(n_classes):
        left[c] = 0.0
        left_term[c] = 0.0
        right[c] = 0.0
    for i in range(end):
        case = order[i]
        right[label[case]] += 1.0 if unit else weight[case]
    known = 0.0
    terms = 0.0  # sum over classes and sides of x log x
    for c in range(n_classes):
        known += right[c]
        right_term[c] = xlogx(right[c], table)
        terms += right_term[c]
    # Weight times entropy of a part is T(weight) - sum over classes of T(class), T(x) = x log2 x.
    # base is that of the node, so base minus that of both sides is the reduction (Quinlan 1993,
    # 2.2).
    base = xlogx(known, table) - terms
    # A side needs a tenth of the mean weight of a class, at least min_objects and at most 25
    # (release 8).
    minimum = rules.min_objects
    if rules.use_min_split > 0:
        share = 0.1 * known / n_classes
        if share > rules.min_objects:
            minimum = 25.0 if share > 25.0 else share
    # Reductions are sums of rounded terms. A later cut has to be better by more than their error,
    # or the winner among equal cuts would be rounding.
    margin = tolerance * total
    best = -math.inf if rules.greedy > 0 else 0.0
    position = -1
    best_low = 0.0
    tries = 0
    low = 0.0
    # left and right are the classes of the cases before i and from i on, terms the sum of their
    # x log x, low the weight on the left.
    for i in range(end - 1):
        case = order[i]
        c = label[case]
        w = 1.0 if unit else weight[case]
        left[c] += w
        right[c] -= w
        low += w
        new_left = xlogx(left[c], table)
        new_right = xlogx(right[c], table)
        # Only class c has changed: its two terms are exchanged. The order of these operations
        # decides the last bits of the reduction, so it is part of the result.
        terms += (new_left - left_term[c]) + (new_right - right_term[c])
        left_term[c] = new_left
        right_term[c] = new_right
        if low < minimum - tolerance:
            continue
        # The weight on the right can only shrink from here on.
        if low > known - minimum + tolerance:
            break
        if values[i] < values[i + 1] - rules.gap:
            tries += 1
            high = known - low
            reduction = base - (xlogx(low, table) + xlogx(high, table) - terms)
            if reduction > best + margin and min(low, high) >= rules.least - tolerance:
                best = reduction
                position = i
                best_low = low
    return position, best, best_low, known, tries


@compiled_later
def choose_tests(
    lists: Lists,
    weights: Floats,  # [n] of the nodes
    attributes: Attributes,
    cases: Cases,
    table: Floats,
    n_classes: int,
    rules: Rules,
    out: Chosen,
) -> None:
    """Choose the test of each node: the best gain ratio among those of at least average gain."""
    starts, values, order = lists
    codes, n_values, counted, list_of = attributes
    feature, cut = out
    tolerance, greedy = rules.tolerance, rules.greedy
    d = n_values.size
    gain = np.empty(d)
    split = np.empty(d)
    valid = np.empty(d, np.bool_)
    cuts = np.empty((d, 2))
    counts = np.empty((4, n_classes))
    frequency = np.empty((max(1, int(n_values.max())), n_classes))
    for node in range(starts.size - 1):
        start, stop = starts[node], starts[node + 1]
        total = weights[node]
        sum_of_gains = 0.0
        n_counted = 0
        for j in range(d):
            at = list_of[j]
            valid[j] = False
            if n_values[j] == 0:
                position, reduction, low, known, tries = best_cut(
                    values[at, start:stop], order[at, start:stop], cases, table, counts, total,
                    rules,
                )  # fmt: skip
                if position < 0:
                    continue
                gain[j] = reduction / total
                if rules.use_penalty > 0:
                    # Which of the cuts tried was chosen has to be said as well (Quinlan 1996).
                    gain[j] -= math.log2(tries) / total
                if greedy == 0 and gain[j] <= tolerance:
                    continue
                # The cases of unknown value count as a branch of their own in the split
                # information.
                terms = xlogx(low, table) + xlogx(known - low, table)
                terms += xlogx(total - known, table)
                split[j] = (xlogx(total, table) - terms) / total
                cuts[j, 0] = values[at, start + position]
                cuts[j, 1] = values[at, start + position + 1]
            else:
                known = count_values(
                    frequency, codes, j, order[at, start:stop], cases.row, cases.label, cases.weight
                )
                if known <= 0.0:
                    continue
                reasonable, gain[j], split[j] = nominal_gain(
                    frequency, n_values[j], known, total, rules.min_objects, table
                )
                if not reasonable:
                    continue
            valid[j] = True
            if counted[j]:
                sum_of_gains += gain[j]
                n_counted += 1
        # The gain ratio favours lopsided tests of little gain, so attributes below the average gain
        # are no candidates; 1e-3 is the slack that C4.5 and J48 leave.
        average = -math.inf
        if rules.use_filter > 0:
            average = sum_of_gains / n_counted if n_counted > 0 else math.inf
        feature[node] = -1
        best = rules.start_value
        for j in range(d):
            if valid[j] and gain[j] >= average - 1e-3 and split[j] > rules.epsilon:
                # best is the largest ratio of the attributes before j; equal ones leave the first.
                ratio = gain[j] / split[j]
                if ratio > best + tolerance:
                    best = ratio
                    feature[node] = j
                    cut[node, 0], cut[node, 1] = cuts[j, 0], cuts[j, 1]


@compiled_later
def assign_branches(
    lists: Lists, tests: Tests, attributes: Attributes, cases: Cases, out: Branches
) -> None:
    """Find the branch of each case, and count the cases and classes of each branch."""
    starts, values, order = lists
    feature, threshold, offset = tests
    for node in range(starts.size - 1):
        j = feature[node]
        if j < 0:
            continue
        # A nominal attribute may be read in any list: every list holds all cases of the node.
        at = attributes.list_of[j]
        for i in range(starts[node], starts[node + 1]):
            case = order[at, i]
            w = 1.0 if cases.weight.size == 0 else cases.weight[case]
            value = values[at, i]
            if attributes.n_values[j] > 0:
                value = attributes.codes[cases.row[case], j]
            b = branch_of(value, threshold[node])
            out.branch[case] = b
            if b < 0:
                out.unknown_sizes[node] += 1
                out.unknown[node, cases.label[case]] += w
            else:
                out.sizes[offset[node] + b] += 1
                out.distribution[offset[node] + b, cases.label[case]] += w


@compiled_later
def branch_of(value: float, threshold: float) -> int:
    """Return the branch that a value takes, -1 if it is unknown; a code is its own branch."""
    if math.isnan(value):
        return -1
    if math.isnan(threshold):
        return int(value)
    return 0 if value <= threshold else 1


@compiled_later
def divide(
    lists: Lists,
    tests: Tests,
    branch: Int32s,  # [cases]
    children: Children,
    new_values: Floats,  # [lists, E'] out
    new_order: Int32s,  # [lists, E'] out
) -> None:
    """Hand every sorted list down to the children by stable partition."""
    starts, values, order = lists
    forks, copy, opened, shared, child_starts = children
    cursor = np.empty(forks.max(), np.int32)  # where the next case of each branch goes
    for node in range(starts.size - 1):  # node by node: the branches of its cases stay in cache
        if tests.feature[node] < 0:
            continue
        first = tests.offset[node]
        for at in range(order.shape[0]):
            for fork in range(forks[node]):
                cursor[fork] = child_starts[first + fork]
            # Cases are taken in the order of the parent, so the list of each child is sorted as
            # well.
            for i in range(starts[node], starts[node + 1]):
                case = order[at, i]
                b = branch[case]
                if b >= 0:
                    if opened[first + b]:
                        new_order[at, cursor[b]] = case
                        new_values[at, cursor[b]] = values[at, i]
                        cursor[b] += 1
                else:
                    for fork in range(forks[node]):
                        if opened[first + fork] and shared[first + fork]:
                            new_order[at, cursor[fork]] = copy[case] + fork
                            new_values[at, cursor[fork]] = values[at, i]
                            cursor[fork] += 1
