"""The finite box around all observations."""

import numpy as np

from eutree.arrays import Floats
from eutree.learners import Problem
from eutree.trees import DecisionTree

MARGIN = 0.05  # of the range of the data, on either side
LARGEST = 1e6  # a bound beyond is none, such as the largest float32


def root_box(
    problem: Problem, tree: DecisionTree, observations: Floats
) -> tuple[Floats, Floats]:  # [d], [d]
    """Return lower and upper corner: the bounds where finite, else the data's range and 5 %.

    A feature without a range has one of 1. Thresholds of the tree lie inside.

    Args:
        problem: Its features may have bounds.
        tree: A partition that is going to be clipped to the box.
        observations: Where a feature has no bounds, its range is that of these, shape [N, d].
    """
    low, high = problem.low, problem.high
    rows = observations if len(observations) else np.zeros((1, problem.n_features))
    least, greatest = rows.min(axis=0), rows.max(axis=0)
    inner = tree.feature >= 0
    first, last = np.full_like(low, np.inf), np.full_like(low, -np.inf)  # thresholds
    np.minimum.at(first, tree.feature[inner], tree.threshold[inner])
    np.maximum.at(last, tree.feature[inner], tree.threshold[inner])
    bounded = (np.abs(low) < LARGEST) & (np.abs(high) < LARGEST) & (low < high)
    keeps_low = bounded & (low <= least) & (low < first)  # no leaf is left without a volume
    keeps_high = bounded & (high >= greatest) & (high > last)
    least, greatest = np.minimum(least, first), np.maximum(greatest, last)
    margin = np.where(greatest > least, MARGIN * (greatest - least), 0.5)
    return np.where(keeps_low, low, least - margin), np.where(keeps_high, high, greatest + margin)
