"""The partition of any learner, seen in the plane of two of its features."""

import numpy as np

from eutree.arrays import Floats
from eutree.learners.learner import HasPartition, Learner, Problem
from eutree.learners.partition import Partition, Plane, leaves_seen
from eutree.policies import LeafStatistics
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.validation import check_choice

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


def plane_of(learner: Learner, schema: Schema, x: str, y: str) -> Plane:
    """Return the plane of two features through the medians of what a learner has observed.

    Args:
        learner: The learner.
        schema: Names and bounds of its features, the remembered ones included.
        x: Feature drawn to the right.
        y: Feature drawn upwards, another one.

    Raises:
        UnknownNameError: There is no such feature.
        InvalidArgumentError: Both are the same.
    """
    names = schema.feature_names
    axes = [names.index(check_choice("feature", name, names)) for name in (x, y)]
    observations = learner.history.observations
    nothing = DecisionTree.single_leaf(schema.n_features)
    low, high = root_box(Problem(schema), nothing, observations)
    at = np.median(observations, axis=0) if len(observations) else 0.5 * (low + high)
    return Plane(axes[0], axes[1], at, low[axes], high[axes])


def partition_of(learner: Learner, plane: Plane) -> Partition:
    """Return a learner's partition: its own, or the leaves of its tree with their best values."""
    if isinstance(learner, HasPartition):
        return learner.partition(plane)
    decisions = learner.decisions()
    values = _best(decisions.statistics, decisions.tree.n_leaves)
    known = "value" if np.isfinite(values).any() else ""
    return Partition(plane, leaves_seen(decisions.tree, decisions.actions, values, plane), known)


def _best(statistics: LeafStatistics | None, n_leaves: int) -> Floats:
    """Return the best value of each leaf, NaN where none is known, shape [L]."""
    if statistics is None:
        return np.full(n_leaves, np.nan)
    known = ~np.isnan(statistics.values)
    best = np.where(known, statistics.values, -np.inf).max(axis=1)
    return np.where(known.any(axis=1), best, np.nan)
