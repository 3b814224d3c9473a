"""Compiled loops of the model trees: bins, the best cut, linear fits, growing and pruning.

Apart from ``_kernels.py`` because these loops fit a model and those run one.
"""

from typing import NamedTuple

import numpy as np

from eutree import features
from eutree.arrays import Booleans, Floats, Int16s, Integers, Uint32s
from eutree.compiled import compiled, overwrite
from eutree.world_model._kernels import NodeTests

threshold_between = compiled(features.threshold_between)

N_BINS = 256  # a power of two, known when kernels are compiled: searches are unrolled
ONE = np.uint64(1)
MANY_ROWS = 256  # nodes above this look at bin edges only, nodes below at every cut
# Ridge on standardised inputs, as a share of the rows: too small to be seen in a fit, large enough
# for inputs that depend on each other.
RIDGE = 1e-5
TINY = 1e-12


class Design(NamedTuple):
    """Inputs of regression trees, with their bins."""

    X: Floats  # [N, p]
    edges: Floats  # [p, B]
    n_edges: Integers  # [p]
    bins: Int16s  # [p, N] small, because they are read in random order


class ModelTree(NamedTuple):
    """A regression tree with a line at each leaf; feature -1 marks a leaf, node 0 is the root.

    It looks at an observation, a displacement and the action, one column for each action.
    """

    feature: Integers  # [M]
    threshold: Floats  # [M]
    left: Integers  # [M]
    right: Integers  # [M]
    coefficients: Floats  # [M, 2 d + A + 1], the last is the constant
    low: Floats  # [M] least y of the node
    high: Floats  # [M] greatest y of the node
    first: Integers  # [M] first of the rows, or residuals, of the node
    n_rows: Integers  # [M] how many there are
    residuals: Floats  # [K]

    def predict(self, X: Floats) -> Floats:
        """Return the fit at each row of X [N, p], clipped to its leaf's range of targets."""
        node = np.zeros(X.shape[0], dtype=np.int64)
        while (inner := self.feature[node] >= 0).any():
            rows = np.flatnonzero(inner)
            at = node[rows]
            below = X[rows, self.feature[at]] <= self.threshold[at]
            node[rows] = np.where(below, self.left[at], self.right[at])
        lines = self.coefficients[node]
        value = (lines[:, :-1] * X).sum(axis=1) + lines[:, -1]
        clipped: Floats = np.clip(value, self.low[node], self.high[node])
        return clipped


class Unrolled(NamedTuple):
    """The trees of a world model, one after the other, with the tests of the action decided."""

    tests: NodeTests  # room for as many nodes
    rows: Uint32s  # [room] line of each leaf
    lines: Floats  # [room, p + 4] coefficients, constant, the action's constant, low and high
    noise: Integers  # [room, 3] first residual, their number, coefficients up to the last not 0


@compiled
def bin_columns(
    columns: Floats,  # [p, N]
    ordered: Floats,  # [p, N] each of them sorted
    edges: Floats,  # [p, N_BINS] infinite, as the last stays
    n_edges: Integers,  # [p]
    bins: Int16s,  # [p, N]
) -> None:
    """Cut each column at its quantiles, between distinct values; a value at an edge is below it."""
    p, n = columns.shape
    for j in range(p):
        values, mine = ordered[j], edges[j]
        count, i = 0, 0
        for b in range(1, N_BINS):
            # An edge between equal values would separate nothing: go on to the next distinct one.
            # All values from the quantile to where the last edge was sought are equal, too.
            i = max(i, b * n // N_BINS)
            while i > 0 and i < n and values[i] == values[i - 1]:
                i += 1
            if i < 1 or i >= n:
                continue
            edge = threshold_between(values[i - 1], values[i])
            if count == 0 or edge > mine[count - 1]:
                mine[count] = edge
                count += 1
        n_edges[j] = count
        # Halving without a branch, which no processor could foresee: the edges before ``at`` are
        # below x, and those from at + 2 * half on are not. Unsigned: no place can be negative.
        for i in range(n):
            x, at, half = columns[j, i], np.uint64(0), np.uint64(N_BINS // 2)
            while half >= ONE:
                at += half * np.uint64(mine[at + half - ONE] < x)
                half >>= ONE
            bins[j, i] = at


@compiled
def solve_positive(A: Floats, b: Floats, p: int) -> None:
    """Solve A x = b in place for a symmetric positive definite A (lower triangle, Cholesky)."""
    # A = L L^T, row by row, over A; rows before i are done. TINY keeps the root defined where
    # rounding made a diagonal entry negative.
    for i in range(p):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                A[i, i] = np.sqrt(max(total, TINY))
            else:
                A[i, j] = total / A[j, j]
    # Forwards, L z = b.
    for i in range(p):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    # Backwards, L^T x = z.
    for i in range(p - 1, -1, -1):
        for k in range(i + 1, p):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]


@compiled
def fit_leaf(
    X: Floats,  # [N, p]
    y: Floats,  # [N]
    rows: Integers,  # [n]
    scale: Floats,  # [p]
    coefficients: Floats,  # [p + 1], the last is the constant
) -> float:
    """Fit a constant, or a line where it predicts better; return the corrected squared error.

    The correction (n + parameters) / (n - parameters) is Quinlan's for M5.
    """
    n, p = rows.size, X.shape[1]
    # Two passes, mean and then deviations: the sum of squares minus the square of the sum would
    # lose its digits where the spread is small beside the mean.
    mean = 0.0
    for i in range(n):
        mean += y[rows[i]]
    mean /= n
    error = 0.0
    for i in range(n):
        error += (y[rows[i]] - mean) ** 2
    coefficients[:] = 0.0
    coefficients[p] = mean
    constant_error = error * (n + 1) / max(n - 1, 1)
    if error == 0.0:
        return constant_error
    centre, spread = np.zeros(p), np.zeros(p)
    for i in range(n):
        for j in range(p):
            centre[j] += X[rows[i], j]
    centre /= n
    for i in range(n):
        for j in range(p):
            spread[j] += (X[rows[i], j] - centre[j]) ** 2
    used = np.zeros(p, dtype=np.int64)
    q = 0
    for j in range(p):
        spread[j] = np.sqrt(spread[j] / n)
        # An input that hardly varies in the leaf would get a slope from noise.
        if spread[j] > 1e-6 * scale[j]:
            used[q] = j
            q += 1
    # No input varies, or there are too few rows for the correction below to mean anything.
    if q == 0 or n < q + 3:
        return constant_error
    A, b, x = np.zeros((q, q)), np.zeros(q), np.zeros(q)
    # Normal equations of standardised inputs; the lower triangle is all that is read.
    for i in range(n):
        row = rows[i]
        for k in range(q):
            x[k] = (X[row, used[k]] - centre[used[k]]) / spread[used[k]]
        for k in range(q):
            b[k] += x[k] * (y[row] - mean)
            for m in range(k + 1):
                A[k, m] += x[k] * x[m]
    for k in range(q):
        A[k, k] += RIDGE * n + 1e-3
    solve_positive(A, b, q)
    # Back to the units of the inputs.
    line = np.zeros(p + 1)
    line[p] = mean
    for k in range(q):
        line[used[k]] = b[k] / spread[used[k]]
        line[p] -= line[used[k]] * centre[used[k]]
    error = 0.0
    for i in range(n):
        value = line[p]
        for k in range(q):
            value += line[used[k]] * X[rows[i], used[k]]
        error += (y[rows[i]] - value) ** 2
    error *= (n + q + 1) / max(n - q - 1, 1)
    if error >= constant_error:
        return constant_error
    overwrite(coefficients, line)
    return error


@compiled
def best_cut(
    design: Design,
    y: Floats,  # [N]
    rows: Integers,  # [n]
    min_leaf: int,
) -> tuple[int, float]:
    """Return the cut (feature, threshold) that reduces the squared error most; feature -1: none."""
    X, edges, n_edges, bins = design
    n = rows.size
    mean = 0.0
    for i in range(n):
        mean += y[rows[i]]
    mean /= n
    best, feature, threshold = 0.0, -1, 0.0
    # With r the sum of (y - mean) on one side, of n1 rows, cutting lowers the squared error by r^2
    # n / (n1 (n - n1)): one running sum is enough, the other side is its negative.
    if n > MANY_ROWS:
        count, total = np.zeros(edges.shape[1] + 1), np.zeros(edges.shape[1] + 1)
        beyond = np.empty(n)  # each row's y beyond the mean, read in order for every feature
        for i in range(n):
            beyond[i] = y[rows[i]] - mean
        for j in range(X.shape[1]):
            count[:] = 0.0
            total[:] = 0.0
            for i in range(n):
                b = bins[j, rows[i]]
                count[b] += 1.0
                total[b] += beyond[i]
            # below and residual: rows and r of the bins up to b. An empty bin has the cut of the
            # one before it.
            below, residual = 0.0, 0.0
            for b in range(n_edges[j]):
                below += count[b]
                residual += total[b]
                if below < min_leaf or n - below < min_leaf or count[b] == 0.0:
                    continue
                gain = residual * residual * n / (below * (n - below))
                # Better by more than rounding, so that the first of equal cuts wins.
                if gain > best * (1.0 + TINY):
                    best, feature, threshold = gain, j, edges[j, b]
        return feature, threshold
    values = np.empty(n)
    for j in range(X.shape[1]):
        for i in range(n):
            values[i] = X[rows[i], j]
        order = np.argsort(values)
        residual = 0.0
        # residual is r of the rows up to the i-th by this input.
        for i in range(n - 1):
            residual += y[rows[order[i]]] - mean
            low, high = values[order[i]], values[order[i + 1]]
            if i + 1 < min_leaf or n - i - 1 < min_leaf or not low < high:
                continue
            gain = residual * residual * n / ((i + 1.0) * (n - i - 1.0))
            if gain > best * (1.0 + TINY):
                best, feature, threshold = gain, j, threshold_between(low, high)
    return feature, threshold


@compiled
def grow(
    design: Design,
    y: Floats,  # [N]
    rows: Integers,  # [n] rows to fit; reordered so that each leaf's rows are contiguous
    min_leaf: int,
    floor: float,
    out: ModelTree,
) -> int:
    """Grow breadth first while there is room for two more nodes, then prune; return the nodes.

    A node is pruned when its own fit predicts as well as its subtree (M5).
    """
    X = design.X
    feature, threshold, left, right, coefficients, low, high, first, n_rows, _ = out
    n = rows.size
    scale = np.zeros(X.shape[1])
    for j in range(X.shape[1]):
        scale[j] = np.std(X[:, j]) + TINY
    mean, variation = 0.0, 0.0
    for i in range(n):
        mean += y[rows[i]] / n
    for i in range(n):
        variation += (y[rows[i]] - mean) ** 2
    errors = np.zeros(feature.size)
    buffer = np.empty(n, dtype=np.int64)
    first[0], n_rows[0] = 0, n
    n_nodes, node = 1, 0
    while node < n_nodes:  # the nodes before it are fitted, those behind it have their rows
        feature[node] = -1
        start, size = first[node], n_rows[node]
        mine = rows[start : start + size]
        errors[node] = fit_leaf(X, y, mine, scale, coefficients[node])
        low[node], high[node] = y[mine].min(), y[mine].max()
        # A node whose own fit leaves less than ``floor`` of the variation, by its share of rows,
        # has nothing left to explain.
        worth = high[node] > low[node] and errors[node] > floor * variation * size / n
        if worth and size >= 2 * min_leaf and n_nodes + 2 <= feature.size:
            j, cut = best_cut(design, y, mine, min_leaf)
            if j >= 0:
                n_left, n_right = 0, 0
                # A stable partition: the rows that go left close up, n_left <= i, the others wait.
                for i in range(size):
                    row = mine[i]
                    if X[row, j] <= cut:
                        mine[n_left] = row
                        n_left += 1
                    else:
                        buffer[n_right] = row
                        n_right += 1
                for i in range(n_right):
                    mine[n_left + i] = buffer[i]
                feature[node], threshold[node] = j, cut
                left[node], right[node] = n_nodes, n_nodes + 1
                first[n_nodes], n_rows[n_nodes] = start, n_left
                first[n_nodes + 1], n_rows[n_nodes + 1] = start + n_left, n_right
                n_nodes += 2
        node += 1
    for node in range(n_nodes - 1, -1, -1):  # the subtrees below it are pruned, with their errors
        if feature[node] >= 0:
            below = errors[left[node]] + errors[right[node]]
            if errors[node] <= below * 1.0001:
                feature[node] = -1
            else:
                errors[node] = below
    return n_nodes


@compiled
def write_residuals(
    X: Floats,  # [N, p]
    y: Floats,  # [N]
    rows: Integers,  # [n]
    nodes: ModelTree,
    covered: Booleans,  # [n] scratch
    out: Floats,  # [n]
) -> None:
    """Write each row's residual from the fit of its leaf; parents come before their children."""
    p = X.shape[1]
    coefficients, first = nodes.coefficients, nodes.first
    covered[:] = False
    for node in range(nodes.feature.size):  # covered are the rows of the leaves before
        if nodes.feature[node] >= 0 or covered[first[node]]:
            continue
        for i in range(first[node], first[node] + nodes.n_rows[node]):
            covered[i] = True
            value = coefficients[node, p]
            for j in range(p):
                value += coefficients[node, j] * X[rows[i], j]
            out[i] = y[rows[i]] - value


@compiled
def unroll(
    p: int,
    action: int,
    first_residual: int,
    n_nodes: int,
    n_lines: int,
    tree: ModelTree,  # with p + A inputs
    out: Unrolled,  # written to from n_nodes and n_lines on
) -> tuple[int, int, int]:
    """Write one tree as it is for one action; return the nodes and lines so far, and its levels."""
    feature, threshold, left, right, coefficients, low, high, first, n_rows, _ = tree
    (features, thresholds, above), rows, lines, noise = out
    begin = n_nodes
    source = np.zeros(feature.size, dtype=np.int64)  # of each node written
    depth = np.zeros(feature.size, dtype=np.int64)
    n_nodes += 1
    node = begin
    while node < n_nodes:  # the nodes before it are written, those behind it have their source
        at = source[node - begin]
        # A test of the action is decided already: go on to the node that it leads to.
        while feature[at] >= p:
            value = 1.0 if feature[at] == p + action else 0.0
            at = left[at] if value <= threshold[at] else right[at]
        if feature[at] >= 0:
            features[node], thresholds[node] = feature[at], threshold[at]
            above[node] = n_nodes + 1
            source[n_nodes - begin], source[n_nodes + 1 - begin] = left[at], right[at]
            depth[n_nodes - begin] = depth[n_nodes + 1 - begin] = depth[node - begin] + 1
            n_nodes += 2
        else:
            above[node], thresholds[node], rows[node] = node, np.nan, n_lines
            for j in range(p):
                lines[n_lines, j] = coefficients[at, j]
                if coefficients[at, j] != 0.0:
                    noise[n_lines, 2] = j + 1
            lines[n_lines, p] = coefficients[at, coefficients.shape[1] - 1]
            # The action's input is 1: its coefficient is all that it adds.
            lines[n_lines, p + 1] = coefficients[at, p + action]
            lines[n_lines, p + 2], lines[n_lines, p + 3] = low[at], high[at]
            noise[n_lines, 0], noise[n_lines, 1] = first_residual + first[at], n_rows[at]
            n_lines += 1
        node += 1
    # Nodes are written level by level: the last one lies deepest.
    return n_nodes, n_lines, depth[n_nodes - 1 - begin]
