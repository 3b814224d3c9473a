"""Compiled loops of pruning: estimated errors, and the cases of a node handed down its subtree.

A *case* is a row with a weight. A row whose tested value is unknown becomes one case in every
branch, with its weight shared out.
"""

import math
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats, Int16s, Int32s, Integers
from eutree.c45._kernels import Nodes, branch_of
from eutree.compiled import compiled_later


@compiled_later
def find_leaves(
    tree: Nodes,
    observations: Floats,  # [N, d]
    out: Int32s,  # [N]
) -> int:
    """Write the leaf (its node) of each row, -1 if a tested value is unknown; count those."""
    feature, threshold, first_child = tree.feature, tree.threshold, tree.first_child
    unknown = 0
    # Until a leaf is reached, ``node`` is a test and ``j`` its attribute; -1 is an unknown value.
    for i in range(observations.shape[0]):
        node = 0
        j = feature[0]
        while j >= 0:
            value = observations[i, j]
            # Both comparisons are false for NaN: an unknown value, or the threshold of a nominal
            # test.
            if value <= threshold[node]:
                node = first_child[node]
            elif value > threshold[node]:
                node = first_child[node] + 1
            elif math.isnan(value):
                node = -1
                break
            else:
                node = first_child[node] + int(value)
            j = feature[node]
        out[i] = node
        if node < 0:
            unknown += 1
    return unknown


@compiled_later
def share_out(
    tree: Nodes,
    size: Floats,  # [M] training weight of each node
    probability: Floats,  # [M, A]
    observations: Floats,  # [N, d]
    rows: Integers,  # [n] rows to predict
    out: Floats,  # [n, A] probabilities; zeros on entry
    leaf: Int32s,  # [n] out: the leaf with the largest share, the first of equal ones
) -> None:
    """Predict fractional cases: a row goes down all branches of a test whose value is unknown."""
    feature, threshold, first_child = tree.feature, tree.threshold, tree.first_child
    # The stack holds the nodes left to visit: its parts and those of the leaves seen add up to 1. A
    # row meets a node once at most, so M places are enough.
    stack = np.empty(feature.size, np.int32)
    parts = np.empty(feature.size)
    for k in range(rows.size):
        i = rows[k]
        stack[0] = 0
        parts[0] = 1.0
        depth = 1
        largest = 0.0
        while depth > 0:
            depth -= 1
            node, part = stack[depth], parts[depth]
            if feature[node] < 0:
                for c in range(out.shape[1]):
                    out[k, c] += part * probability[node, c]
                # Branches are visited in order, so of equal shares the first leaf wins.
                if part > largest:
                    largest = part
                    leaf[k] = node
                continue
            value = observations[i, feature[node]]
            b = branch_of(value, threshold[node])
            first = first_child[node]
            if b >= 0:
                stack[depth] = first + b
                parts[depth] = part
                depth += 1
                continue
            total = 0.0
            for fork in range(tree.n_children[node]):
                total += size[first + fork]
            # In reverse, because the stack turns the order round: sums over leaves go from the
            # first branch to the last, which fixes their last bits.
            for fork in range(tree.n_children[node] - 1, -1, -1):
                if size[first + fork] > 0.0:
                    stack[depth] = first + fork
                    parts[depth] = part * size[first + fork] / total
                    depth += 1


_Number = TypeVar("_Number", np.int32, np.float64)


class TrainingCases(NamedTuple):
    """The training set."""

    observations: Floats  # [N, d]
    label: Int16s  # [N]
    weight: Floats  # [N]


class ErrorEstimate(NamedTuple):
    """How errors beyond those seen are estimated."""

    confidence: float
    z: float
    normal: bool  # J48's variant


class CaseRoom(NamedTuple):
    """Where the cases of the nodes under work stand, one node's after the other's."""

    rows: Int32s  # [room]
    weights: Floats  # [room]
    scratch_rows: Int32s  # [room of one node]
    scratch_weights: Floats  # [room of one node]


class Place(NamedTuple):
    """The cases of a node in the arena, and where it is free from on."""

    start: int
    stop: int
    top: int


class WalkRoom(NamedTuple):
    """Scratch arrays of the walk through a branch."""

    bounds: Int32s  # [forks + 1]
    stack: Integers  # [M + 1, 3]
    counts: Floats  # [A]


@compiled_later
def add_errors(n: float, e: float, confidence: float, z: float, normal: bool) -> float:
    """Return the errors expected beyond the ``e`` seen among ``n`` cases (release 8's AddErrs).

    ``normal`` selects J48's variant: no addition for a confidence above one half, interpolation
    from e = 0, and n - e in place of 0.67 (n - e) at the upper end.
    """
    if normal and confidence > 0.5:
        return 0.0
    # Between no error and one the addition is interpolated. Without errors it is n times the rate
    # at which n cases go without one with probability ``confidence``: (1 - p)^n.
    if e < (1.0 if normal else 0.9999):
        base: float = n * (1.0 - confidence ** (1.0 / n))
        if e < (1e-300 if normal else 1e-6):
            return base
        return base + e * (add_errors_from_one(n, 1.0, z, normal) - base)
    return add_errors_from_one(n, e, z, normal)


@compiled_later
def add_errors_from_one(n: float, e: float, z: float, normal: bool) -> float:
    """Return ``add_errors`` for at least one error seen."""
    if e + 0.5 >= n:
        rest = n - e if normal else 0.67 * (n - e)
        return float(rest) if rest > 0.0 else 0.0
    # Upper end of Wilson's interval of a binomial rate, with half an error for continuity.
    e += 0.5
    z2 = z * z
    rate = (e + z2 / 2.0 + math.sqrt(z2 * (e * (1.0 - e / n) + z2 / 4.0))) / (n + z2)
    return n * rate - (e - 0.5)


@compiled_later
def estimated_errors(distribution: Floats, estimate: ErrorEstimate) -> float:
    """Return the pessimistic number of errors of a leaf with these classes [A]."""
    total = float(distribution.sum())
    e = total - float(distribution.max())
    if total <= 1e-9:
        return 0.0
    # Fractional weights leave rounding behind: a pure leaf has no errors.
    if e < 1e-9:
        e = 0.0
    return e + add_errors(total, e, estimate.confidence, estimate.z, estimate.normal)


@compiled_later
def room(array: NDArray[_Number], needed: int) -> NDArray[_Number]:
    """Return the array, or a longer copy if it has fewer than ``needed`` entries."""
    if array.size >= needed:
        return array
    # Doubling: however often it grows, an entry is copied about once on average.
    longer = np.empty(max(needed, 2 * array.size), array.dtype)
    for i in range(array.size):
        longer[i] = array[i]
    return longer


@compiled_later
def with_room(arena: CaseRoom, size: int, own: int) -> CaseRoom:
    """Return the arena with room for ``size`` cases in all, and ``own`` of one node."""
    return CaseRoom(
        room(arena.rows, size),
        room(arena.weights, size),
        room(arena.scratch_rows, own),
        room(arena.scratch_weights, own),
    )


@compiled_later
def hand_down(
    node: int,
    place: Place,
    arena: CaseRoom,
    tree: Nodes,
    observations: Floats,  # [N, d]
    bounds: Int32s,  # [forks + 1] out, relative to the returned place
) -> tuple[int, int]:
    """Divide the cases of a node; return where its first branch begins and the new arena top.

    Without unknown values the cases are permuted in place. Otherwise the branches are written
    to the arena from ``top`` on, which must have room for ``forks`` copies of the cases.
    """
    start, stop, top = place
    rows, weights, scratch_rows, scratch_weights = arena
    forks, j, t = tree.n_children[node], tree.feature[node], tree.threshold[node]
    bounds[: forks + 1] = 0
    unknown = 0
    known_weight = 0.0
    # bounds[b + 1] counts the known cases of branch b; summed up, bounds[b] is where b begins.
    for i in range(start, stop):
        b = branch_of(observations[rows[i], j], t)
        if b < 0:
            unknown += 1
        else:
            bounds[b + 1] += 1
            known_weight += weights[i]
    if unknown == 0:
        for b in range(forks):
            bounds[b + 1] += bounds[b]
        cursor = bounds[:forks].copy()  # where the next case of each branch goes
        for i in range(start, stop):
            b = branch_of(observations[rows[i], j], t)
            scratch_rows[cursor[b]] = rows[i]
            scratch_weights[cursor[b]] = weights[i]
            cursor[b] += 1
        # Back in place, in the order of the branches and within each in that of before.
        for i in range(stop - start):
            rows[start + i] = scratch_rows[i]
            weights[start + i] = scratch_weights[i]
        return start, top
    share = np.zeros(forks)
    for i in range(start, stop):
        b = branch_of(observations[rows[i], j], t)
        if b >= 0:
            share[b] += weights[i]
    # Cases of unknown value are shared out as the known weight is; evenly if nothing is known.
    if known_weight > 0.0:
        share /= known_weight
    else:
        share[:] = 1.0 / forks
    out = top
    for b in range(forks):  # the cases of the branches before stand from top to out
        bounds[b] = out - top
        for i in range(start, stop):
            where = branch_of(observations[rows[i], j], t)
            if where == b or (where < 0 and share[b] > 0.0):
                rows[out] = rows[i]
                weights[out] = weights[i] if where == b else weights[i] * share[b]
                out += 1
    bounds[forks] = out - top
    return top, out


@compiled_later
def prune(
    tree: Nodes,  # changed in place
    training: TrainingCases,
    estimate: ErrorEstimate,
    raising: bool,
) -> None:
    """Prune by estimated errors: a node may become a leaf or be replaced by its largest branch.

    The stack holds (node, cases, phase): in phase 0 the classes of a node are counted and its
    cases handed down, in phase 1 its branches are finished and the node is decided on. A raised
    branch is counted and pruned again with all cases of the node.
    """
    feature, threshold, first_child = tree.feature, tree.threshold, tree.first_child
    n_children, distribution = tree.n_children, tree.distribution
    label = training.label
    n_rows, n_nodes = training.observations.shape[0], feature.size
    rows = np.arange(n_rows).astype(np.int32)
    weights = training.weight.copy()
    arena = CaseRoom(rows, weights, rows.copy(), weights.copy())
    error = np.zeros(n_nodes)
    bounds = np.zeros(n_children.max() + 1, np.int32)
    # Columns: node, first and last of its cases in the arena, phase, where the arena is free. Nodes
    # below a node in phase 1 are finished when it comes up: their classes and errors are final.
    stack = np.zeros((2 * n_nodes + 2, 5), np.int64)
    stack[0, 2] = n_rows
    stack[0, 4] = n_rows
    depth = 1
    counts = np.zeros(distribution.shape[1])
    scratch = WalkRoom(bounds, np.zeros((n_nodes + 1, 3), np.int64), counts)
    while depth > 0:
        depth -= 1
        node, start, stop = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        phase, top = stack[depth, 3], stack[depth, 4]
        if phase == 0:
            distribution[node, :] = 0.0
            for i in range(start, stop):
                distribution[node, label[arena.rows[i]]] += arena.weights[i]
            if feature[node] < 0:
                error[node] = estimated_errors(distribution[node], estimate)
                continue
            forks = n_children[node]
            arena = with_room(arena, top + forks * (stop - start), stop - start)
            place, new_top = hand_down(
                node, Place(start, stop, top), arena, tree, training.observations, bounds
            )
            stack[depth, 3] = 1
            depth += 1
            for b in range(forks):
                stack[depth, 0] = first_child[node] + b
                stack[depth, 1] = place + bounds[b]
                stack[depth, 2] = place + bounds[b + 1]
                stack[depth, 3] = 0
                stack[depth, 4] = new_top
                depth += 1
            continue
        first, forks = first_child[node], n_children[node]
        largest = first
        most = 0.0
        tree_error = 0.0
        for b in range(forks):
            size = distribution[first + b].sum()
            # Of equally heavy branches the last is kept; 1e-9 is for sums of fractional weights.
            if size >= most - 1e-9:
                largest = first + b
                most = size
            tree_error += error[first + b]
        leaf_error = estimated_errors(distribution[node], estimate)
        branch_error = math.inf
        if raising:
            # A branch with more errors than this is raised in no case, and errors only add up.
            limit = max(leaf_error, tree_error) + 0.1
            branch_error, arena = errors_of_branch(
                largest, Place(start, stop, top), limit, arena, tree, training, estimate, scratch
            )
        # The smaller tree wins unless it costs more than 0.1 error, as in release 8.
        if leaf_error <= branch_error + 0.1 + 1e-9 and leaf_error <= tree_error + 0.1 + 1e-9:
            feature[node] = -1
            n_children[node] = 0
            error[node] = leaf_error
        elif branch_error <= tree_error + 0.1 + 1e-9:
            # The node becomes a copy of its largest branch, and begins again at phase 0.
            feature[node] = feature[largest]
            threshold[node] = threshold[largest]
            first_child[node] = first_child[largest]
            n_children[node] = n_children[largest]
            stack[depth, 3] = 0
            depth += 1
        else:
            error[node] = tree_error


@compiled_later
def errors_of_branch(
    branch: int,
    place: Place,
    limit: float,
    arena: CaseRoom,
    tree: Nodes,
    training: TrainingCases,
    estimate: ErrorEstimate,
    scratch: WalkRoom,
) -> tuple[float, CaseRoom]:
    """Return the estimated errors of a branch on all cases of its parent, and the arena.

    Stops early once the sum exceeds ``limit``, where it no longer changes any decision.
    """
    bounds, stack, counts = scratch
    stack[0, 0], stack[0, 1], stack[0, 2] = branch, place.start, place.stop
    depth = 1
    errors = 0.0
    # The leaves met so far make ``errors``; the nodes on the stack are those still to be met.
    while depth > 0 and errors <= limit + 1e-6:
        depth -= 1
        node, first, last = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        if tree.feature[node] < 0:
            counts[:] = 0.0
            for i in range(first, last):
                counts[training.label[arena.rows[i]]] += arena.weights[i]
            errors += estimated_errors(counts, estimate)
            continue
        forks = tree.n_children[node]
        here = max(place.top, last)  # the rows above belong to branches already counted
        arena = with_room(arena, here + forks * (last - first), last - first)
        begin, _ = hand_down(
            node, Place(first, last, here), arena, tree, training.observations, bounds
        )
        for b in range(forks):
            stack[depth, 0] = tree.first_child[node] + b
            stack[depth, 1] = begin + bounds[b]
            stack[depth, 2] = begin + bounds[b + 1]
            depth += 1
    return errors, arena
