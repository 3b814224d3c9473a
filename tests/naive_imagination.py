"""Slow, obvious twins of the kernels of eutree.imagination."""

import numpy as np


def best_interval(values, gains, min_rows, open_below, open_above):
    """Every interval of the sorted values, cut between distinct ones; the largest sum."""
    order = np.argsort(values, kind="stable")
    x, g = values[order], gains[order]
    n, best = len(x), -np.inf
    for i in range(n):
        if i > 0 and (open_below or x[i - 1] == x[i]):
            continue
        for j in range(i + min_rows - 1, n):
            if j < n - 1 and (open_above or x[j] == x[j + 1]):
                continue
            best = max(best, g[i : j + 1].sum())
    return best


def best_cut(X, y, rows, min_leaf, allowed):
    """The squared error after each cut between distinct values; the least."""
    least = np.inf
    for j in np.flatnonzero(allowed):
        x = X[rows, j]
        for value in np.unique(x)[:-1]:
            below, above = y[rows][x <= value], y[rows][x > value]
            if min(len(below), len(above)) >= min_leaf:
                error = ((below - below.mean()) ** 2).sum() + ((above - above.mean()) ** 2).sum()
                least = min(least, error)
    return least


def act(tree, observation):
    """The action of a nested tree."""
    while isinstance(tree, tuple):
        tree = tree[2] if observation[tree[0]] <= tree[1] else tree[3]
    return tree
