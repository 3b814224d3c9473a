"""Compiled loops of proofs about chance: steps around circles, and the values of cells."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled, overwrite
from eutree.proof import ActingNodes

Spans = tuple[float, float, float, float]  # lowest and highest of one action, then of another


class Values(NamedTuple):
    """Bounds of the value in each cell: of its mean, of the mean at each place, of each state.

    A place is the agent's, on its path; the mean at a place is over the opponents.
    """

    low_mean: Floats  # [...]
    high_mean: Floats  # [...]
    low_place: Floats  # [...]
    high_place: Floats  # [...]
    low: Floats  # [...]
    high: Floats  # [...]


class Ends(NamedTuple):
    """Which share of each cell is a collision: on average, and at each place."""

    least: Floats  # [N, R]
    most: Floats  # [N, R]
    least_place: Floats  # [N, R]
    most_place: Floats  # [N, R]


@compiled
def turn(
    field: Floats,  # [P, n, S]
    weights: Floats,  # [J]
    first: int,
    out: Floats,  # [P, n, S] added to
) -> None:
    """Add the weighted sum of the cells that a step around a circle reaches from each cell."""
    before, n, after = field.shape
    for p in range(before):
        for c in range(n):
            for j in range(weights.size):
                weight, k = weights[j], (c + first + j) % n
                for s in range(after):
                    out[p, c, s] += weight * field[p, k, s]


@compiled
def turn_bound(
    field: Floats,  # [P, n, S]
    rising: Floats,  # [J] probability to end in cell j or above, where the field grows there
    falling: Floats,  # [J] where it shrinks
    first: int,
    out: Floats,  # [P, n, S]
) -> None:
    """Write a bound of the expected value after a step, from any place in each cell."""
    before, n, after = field.shape
    for p in range(before):
        for c in range(n):
            k = (c + first) % n
            for s in range(after):
                out[p, c, s] = field[p, k, s]
            for j in range(1, rising.size):
                last, k = k, (c + first + j) % n
                up, down = rising[j], falling[j]
                for s in range(after):
                    change = field[p, k, s] - field[p, last, s]
                    out[p, c, s] += change * (up if change > 0 else down)


@compiled
def weigh(
    field: Floats,  # [N, J]
    weights: Floats,  # [I, J]
    out: Floats,  # [N, I]
) -> None:
    """Write weighted sums over the last axis: a small product, without threads of a library."""
    columns = weights.T.copy()
    for n in range(field.shape[0]):
        for i in range(out.shape[1]):
            out[n, i] = 0.0
        for j in range(field.shape[1]):
            value = field[n, j]
            for i in range(out.shape[1]):
                out[n, i] += value * columns[j, i]


@compiled
def shares(
    policy: ActingNodes,
    action: int,
    low: Floats,  # [N, d]
    high: Floats,  # [N, d]
    out: Floats,  # [N]
) -> None:
    """Write the share of each box in which a tree takes an action."""
    feature, threshold, left, right, leaf = policy.nodes
    d = low.shape[1]
    stack = np.empty(feature.size + 1, dtype=np.int64)
    lows = np.empty((feature.size + 1, d))
    highs = np.empty((feature.size + 1, d))
    parts = np.empty(feature.size + 1)
    for i in range(low.shape[0]):
        stack[0], parts[0], size = 0, 1.0, 1
        overwrite(lows[0], low[i])
        overwrite(highs[0], high[i])
        found = 0.0
        while size > 0:
            size -= 1
            node, part = stack[size], parts[size]
            j = feature[node]
            if j < 0:
                if policy.actions[leaf[node]] == action:
                    found += part
                continue
            a, b, t = lows[size, j], highs[size, j], threshold[node]
            if b <= t:
                stack[size] = left[node]
                size += 1
            elif a >= t:
                stack[size] = right[node]
                size += 1
            else:
                overwrite(lows[size + 1], lows[size])
                overwrite(highs[size + 1], highs[size])
                stack[size], highs[size, j] = left[node], t
                parts[size] = part * (t - a) / (b - a)
                stack[size + 1], lows[size + 1, j] = right[node], t
                parts[size + 1] = part * (b - t) / (b - a)
                size += 2
        out[i] = found


@compiled
def mixed_low(a: float, b: float, f: float, spans: Spans) -> float:
    """Return a lower bound of a mean over a cell, of two means and the second's share.

    Either is the mean over the whole cell; on the other's share it is replaced.
    """
    a_low, a_high, b_low, b_high = spans
    one, other = a + f * (b_low - a_high), b + (1 - f) * (a_low - b_high)
    lowest: float = max(one, other, f * b_low + (1 - f) * a_low)
    return lowest


@compiled
def choose(
    stop: Values,  # each [N, R]
    go: Values,  # each [N, R]
    share: Floats,  # [N, Q] of each cell in which it goes; negative: whichever is better
    kind: Integers,  # [R] which column of ``share``; negative: an end, which stays as it is
    limits: Floats,  # [3] greatest error of doubles, and lowest and highest value of all
    out: Values,  # each [N, R]
) -> None:
    """Write the values of cells in which one of two actions is taken."""
    slack, lowest, highest = limits
    for i in range(share.shape[0]):
        for r in range(kind.size):
            if kind[r] < 0:
                continue
            f = share[i, kind[r]]
            bounds = (stop.low[i, r], stop.high[i, r], go.low[i, r], go.high[i, r])
            if f < 0:
                least, most = max(bounds[0], bounds[2]), max(bounds[1], bounds[3])
                more, less = max(bounds[3] - bounds[0], 0.0), max(bounds[1] - bounds[2], 0.0)
                low = max(stop.low_mean[i, r], go.low_mean[i, r])
                high = min(stop.high_mean[i, r] + more, go.high_mean[i, r] + less)
                low_place = max(stop.low_place[i, r], go.low_place[i, r])
                high_place = min(stop.high_place[i, r] + more, go.high_place[i, r] + less)
            elif f <= 0:
                least, most = bounds[0], bounds[1]
                low, high = stop.low_mean[i, r], stop.high_mean[i, r]
                low_place, high_place = stop.low_place[i, r], stop.high_place[i, r]
            elif f >= 1:
                least, most = bounds[2], bounds[3]
                low, high = go.low_mean[i, r], go.high_mean[i, r]
                low_place, high_place = go.low_place[i, r], go.high_place[i, r]
            else:
                least, most = min(bounds[0], bounds[2]), max(bounds[1], bounds[3])
                upper = (-bounds[1], -bounds[0], -bounds[3], -bounds[2])
                low = mixed_low(stop.low_mean[i, r], go.low_mean[i, r], f, bounds)
                high = -mixed_low(-stop.high_mean[i, r], -go.high_mean[i, r], f, upper)
                low_place = mixed_low(stop.low_place[i, r], go.low_place[i, r], f, bounds)
                high_place = -mixed_low(-stop.high_place[i, r], -go.high_place[i, r], f, upper)
            out.low[i, r] = least = max(least - slack, lowest)
            out.high[i, r] = most = min(most + slack, highest)
            out.low_place[i, r] = low_place = max(low_place - slack, least)
            out.high_place[i, r] = high_place = min(high_place + slack, most)
            out.low_mean[i, r] = max(low - slack, low_place)
            out.high_mean[i, r] = min(high + slack, high_place)


@compiled
def ended_low(mean: float, low: float, high: float, value: float, f: float, g: float) -> float:
    """Return a lower bound of a mean over a cell of which a share from f to g has a value."""
    rest = value - high
    mixed = min(low + f * (value - low), low + g * (value - low))
    lowest: float = max(min(mean + f * rest, mean + g * rest), mixed)
    return lowest


@compiled
def end(
    ends: Ends,
    value: float,  # of the end
    out: Values,  # each [N, R], changed
) -> None:
    """Give the states of cells that have ended the value of the end."""
    for i in range(ends.most.shape[0]):
        for r in range(ends.most.shape[1]):
            if ends.most_place[i, r] <= 0:
                continue
            low, high = out.low[i, r], out.high[i, r]
            f, g = ends.least[i, r], ends.most[i, r]
            out.low_mean[i, r] = ended_low(out.low_mean[i, r], low, high, value, f, g)
            out.high_mean[i, r] = -ended_low(-out.high_mean[i, r], -high, -low, -value, f, g)
            f, g = ends.least_place[i, r], ends.most_place[i, r]
            out.low_place[i, r] = ended_low(out.low_place[i, r], low, high, value, f, g)
            out.high_place[i, r] = -ended_low(-out.high_place[i, r], -high, -low, -value, f, g)
            if f >= 1:
                low = high = value
            out.low[i, r], out.high[i, r] = min(low, value), max(high, value)
