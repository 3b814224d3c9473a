"""Observations that tell two trees apart: on every threshold, beside it, and where floats end."""

import math

import numpy as np

from eutree.arrays import Floats
from eutree.trees import DecisionTree
from eutree.trees.boxes import node_boxes

EXTREMES = (math.nan, math.inf, -math.inf, -0.0, 0.0, 5e-324, -5e-324, 1.8e308 / 2, -1.8e308 / 2)


def probes(tree: DecisionTree, *, n_random: int = 0, seed: int = 0) -> Floats:
    """Return observations, shape [N, d], that exercise every test of ``tree``.

    For each inner node: a point of its box with the tested feature on the threshold, one ulp to
    either side, and on each extreme (NaN, infinities, signed zeros, subnormals, huge numbers).
    """
    rng = np.random.default_rng(seed)
    low, high = node_boxes(tree)
    rows = [np.full(tree.n_features, value) for value in EXTREMES]
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE):
        threshold = float(tree.threshold[node])
        inside = _inside(low[node], high[node])
        beside = [math.nextafter(threshold, side) for side in (-math.inf, math.inf)]
        for value in (threshold, *beside, *EXTREMES):
            rows.append(inside.copy())
            rows[-1][tree.feature[node]] = value
    finite = tree.threshold[np.isfinite(tree.threshold)]
    spread = (finite.min() - 1.0, finite.max() + 1.0) if finite.size else (-1.0, 1.0)
    middle, half = spread[0] / 2 + spread[1] / 2, spread[1] / 2 - spread[0] / 2
    random = middle + half * rng.uniform(-1.0, 1.0, size=(n_random, tree.n_features))
    return np.concatenate([np.array(rows), random])


def _inside(low: Floats, high: Floats) -> Floats:
    """Return a point of a box, which may be unbounded."""
    with np.errstate(over="ignore"):
        below = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0, -1.0))
        above = np.where(np.isfinite(high), high, below + 2.0)
        middle = below / 2 + above / 2
    return np.where((middle > below) & (middle <= above), middle, above)
