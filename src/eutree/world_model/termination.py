"""Where a task ends: a logistic model tree over o' (Landwehr, Hall and Frank 2005).

An end is seldom seen, and where it lies is usually a simple set: beyond a threshold, within a
distance. Each leaf's log-odds of an end are a constant, linear, or linear in o' and its squares
(a ball, an ellipse, a slab), whichever is the shortest description: deviance plus a price for each
parameter and each test. A dozen ends describe a ball that axis-parallel tests would have to pave.
"""

from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.thresholds import threshold_between
from eutree.world_model import _kernels_termination
from eutree.world_model._kernels_regression import move_towards_better

PRICE = 4.0  # of a parameter or a test, in units of deviance
SURE = 14.0  # log-odds of a leaf all of whose rows agree
FEW = 3  # rows of either kind below which no boundary is fitted
SLACK = 1e-6  # more than rounding does to a sum of costs
MOST_TESTS = 40
MOST_ROWS = 8000


@dataclass(frozen=True, eq=False)
class _Leaf:
    """The best single description of some rows."""

    rows: Integers  # [n] of the data
    cost: float
    line: Floats  # [2 d + 1]


@dataclass(frozen=True, eq=False)
class TerminationTree:
    """A logistic model tree; feature -1 marks a leaf, node 0 is the root, parents come first."""

    feature: Integers  # [M]
    threshold: Floats  # [M]
    left: Integers  # [M]
    right: Integers  # [M]
    lines: Floats  # [M, 2 d + 1]
    rows: tuple[Integers, ...]  # of the data, for each node

    def seen(self, X: Floats, outcome: Floats, gap: float, sign: float) -> "TerminationTree":
        """Return how the tree looks if ``gap`` of what is unknown counts as the worse.

        Thresholds move inside their gaps, and the log-odds by those of ``gap``: a place counts as
        an end where the fitted chance exceeds 1 - gap (``sign`` -1, for good ends: where it
        exceeds gap).

        Args:
            X: o' of the rows, shape [N, d].
            outcome: What kind of end each row is, shape [N].
            gap: Share of the unknown that counts as the worse.
            sign: 1 if these ends are bad, -1 if they are good.
        """
        threshold, lines = self.threshold.copy(), self.lines.copy()
        for node in np.flatnonzero(self.feature >= 0):
            x: Floats = np.ascontiguousarray(X[:, self.feature[node]])
            threshold[node] = move_towards_better(x, outcome, self.rows[node], threshold[node], gap)
        lines[:, -1] += sign * np.log(gap / (1.0 - gap))
        return replace(self, threshold=threshold, lines=lines)


def fit_termination(X: Floats, y: Booleans) -> TerminationTree:
    """Grow the tree of the shortest description found.

    Args:
        X: o' of all transitions, shape [N, d].
        y: Whether each ended, shape [N].
    """
    kept = _thinned(y)
    correction = np.log((~y[kept]).sum() / (~y).sum()) if (~y).any() else 0.0
    leaves = [_described(X, y, kept)]
    tests: list[tuple[int, float, int, int] | None] = [None]
    node = 0
    while node < len(leaves):
        found = None
        if leaves[node].cost > 3 * PRICE and len(leaves) < 2 * MOST_TESTS:
            found = _best_test(X, y, leaves[node])
        if found is not None:
            feature, threshold, *sides = found
            tests[node] = feature, threshold, len(leaves), len(leaves) + 1
            leaves += sides
            tests += [None, None]
        node += 1
    return _pruned(leaves, tests, float(correction))


def _thinned(y: Booleans) -> Integers:
    """Return all rows, or if they are too many all ends and some others, evenly spaced."""
    if y.size <= MOST_ROWS:
        return np.arange(y.size)
    others = np.flatnonzero(~y)
    n = max(MOST_ROWS - int(y.sum()), MOST_ROWS // 2)
    some = others[np.linspace(0, others.size - 1, min(n, others.size)).astype(np.int64)]
    return np.sort(np.concatenate([np.flatnonzero(y)[-MOST_ROWS:], some]))


def _described(X: Floats, y: Booleans, rows: Integers, limit: float = np.inf) -> _Leaf:
    """Return the best description of some rows without a test.

    Above ``limit`` it need not be the best: a boundary whose price alone is above it is not fitted.
    """
    d = X.shape[1]
    mine = y[rows]
    n, n_ends = rows.size, int(mine.sum())
    line = np.zeros(2 * d + 1)
    if n_ends in (0, n):
        line[-1] = SURE if n_ends else -SURE
        return _Leaf(rows, PRICE, line)
    share = n_ends / n
    line[-1] = np.log(share / (1 - share))
    cost = PRICE - 2.0 * (n_ends * np.log(share) + (n - n_ends) * np.log(1 - share))
    if min(n_ends, n - n_ends) >= FEW:
        places = np.ascontiguousarray(X[rows])
        for squares in (False, True):
            price = PRICE * (2 * d + 1 if squares else d + 1)
            if price >= cost or price > limit:
                break
            fit = np.empty(2 * d + 1)
            deviance = _kernels_termination.fit_log_odds(places, mine, squares, fit)
            if deviance + price < cost:
                cost, line = deviance + price, fit
    return _Leaf(rows, float(cost), line)


def _best_test(X: Floats, y: Booleans, leaf: _Leaf) -> tuple[int, float, _Leaf, _Leaf] | None:
    """Return the test whose two sides have the shortest descriptions, with them."""
    found = None
    least = np.inf
    for feature, threshold in _tests(X, y, leaf.rows):
        below = X[leaf.rows, feature] <= threshold
        if below.all() or not below.any():
            continue
        sides = leaf.rows[below], leaf.rows[~below]
        first = int(sides[1].size < sides[0].size)  # the smaller one is described at less cost
        near = _described(X, y, sides[first], least - PRICE + SLACK)
        if near.cost + PRICE >= least:  # no description is shorter than a constant's price
            continue
        far = _described(X, y, sides[1 - first], least - near.cost + SLACK)
        if near.cost + far.cost < least:
            least = near.cost + far.cost
            found = (feature, threshold, *((far, near) if first else (near, far)))
    return found


def _tests(X: Floats, y: Booleans, rows: Integers) -> list[tuple[int, float]]:
    """Return tests worth a look: the purest, and for each feature the widest gap among ends."""
    mine = y[rows]
    if mine.all() or not mine.any():
        return []
    tests = []
    most, purest = 0.0, None
    for feature in range(X.shape[1]):
        x = X[rows, feature]
        order = np.argsort(x, kind="stable")
        values, n = x[order], np.arange(1, rows.size)
        surplus = np.cumsum(mine[order] - mine.mean())[:-1]
        gain = np.where(values[1:] > values[:-1], surplus**2 / (n * (rows.size - n)), 0.0)
        at = int(gain.argmax())
        if gain[at] > most * (1.0 + 1e-9):
            most, purest = (
                float(gain[at]),
                (feature, threshold_between(*values[at : at + 2].tolist())),
            )
        ends = values[mine[order]]
        inner = np.diff(ends)[1:-1]
        if inner.size and inner.max() > 0:
            at = int(inner.argmax()) + 1
            tests.append((feature, threshold_between(*ends[at : at + 2].tolist())))
    return tests if purest is None else [purest, *tests]


def _pruned(
    leaves: list[_Leaf], tests: list[tuple[int, float, int, int] | None], correction: float
) -> TerminationTree:
    """Keep a test where its sides are a shorter description than the node itself."""
    costs = [leaf.cost for leaf in leaves]
    for node in range(len(leaves) - 1, -1, -1):
        test = tests[node]
        if test is not None:
            below = costs[test[2]] + costs[test[3]] + PRICE
            if below < costs[node]:
                costs[node] = below
            else:
                tests[node] = None
    m = len(leaves)
    feature, left, right = np.full(m, -1), np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    threshold = np.zeros(m)
    for node, test in enumerate(tests):
        if test is not None:
            feature[node], threshold[node], left[node], right[node] = test
    lines = np.array([leaf.line for leaf in leaves])
    lines[:, -1] += correction
    return TerminationTree(
        feature, threshold, left, right, lines, tuple(leaf.rows for leaf in leaves)
    )
