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


def exact_p(statistic, n_left, n_right):
    """The chance that two samples of one distribution are at least so far apart, by lattice paths.

    A random order of both is a path from (0, 0) to (n_left, n_right): what leaves the band around
    the diagonal is summed where it leaves.
    """
    lattice = np.lcm(n_left, n_right)
    bound = round(statistic * lattice) * (n_left * n_right // lattice)
    if bound <= 0:
        return 1.0
    inside, left = np.zeros(n_right + 1), 0.0
    for i in range(n_left + 1):
        for j in range(n_right + 1):
            remaining = n_left + n_right - i - j + 1
            here = 1.0 if i == j == 0 else 0.0
            here += inside[j] * (n_left - i + 1) / remaining if i else 0.0
            here += inside[j - 1] * (n_right - j + 1) / remaining if j else 0.0
            if abs(i * n_right - j * n_left) >= bound:
                left, here = left + here, 0.0
            inside[j] = here
    return left
