"""Slow, obvious twins of eutree.splitting: everything from the definition, cut by cut."""

from fractions import Fraction

import numpy as np


def distance(left, right):
    """D times len(left) * len(right), an integer, from the definition of the two-sample test."""
    return max(
        abs(
            sum(1 for u in left if u <= q) * len(right)
            - sum(1 for u in right if u <= q) * len(left)
        )
        for q in [*left, *right]
    )


def best_cut(x, q, *, min_leaf, score):
    """(squared or plain score as a Fraction, feature, left value, right value, W, n_left)."""
    best = None
    n = len(q)
    for feature in range(x.shape[1]):
        order = np.argsort(x[:, feature], kind="stable")
        values, returns = x[order, feature].tolist(), q[order].tolist()
        for i in range(min_leaf, n - min_leaf + 1):
            if not 0 < i < n or values[i - 1] == values[i]:
                continue
            W = distance(returns[:i], returns[i:])
            value = Fraction(W if score == "distance" else W * W, i * (n - i))
            if value > (best[0] if best else 0):
                best = (value, feature, values[i - 1], values[i], W, i)
    return best


def integer_best_cut(x, q, *, min_leaf, score):
    """The same by a running sum over columns: exact integers, for larger samples."""
    best = None
    n = len(q)
    _, rank, counts = np.unique(q, return_inverse=True, return_counts=True)
    cumulative = np.cumsum(counts)
    for feature in range(x.shape[1]):
        order = np.argsort(x[:, feature], kind="stable")
        values = x[order, feature]
        running = np.zeros(len(counts), dtype=np.int64)
        for i in range(1, n - min_leaf + 1):
            running -= cumulative
            running[rank[order[i - 1]] :] += n
            if i < min_leaf or values[i - 1] == values[i]:
                continue
            W = int(np.abs(running).max())
            value = float(W if score == "distance" else W * W) / float(i * (n - i))
            if value > (best[0] if best else 0.0):
                best = (value, feature, values[i - 1], values[i], W, i)
    return best
