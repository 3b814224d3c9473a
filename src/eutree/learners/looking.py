"""The partition of any learner, seen in the plane of two of its features."""

import numpy as np

from eutree.arrays import Floats
from eutree.learners.learner import HasPartition, Learner, Problem
from eutree.learners.partition import Partition, Plane, leaves_seen
from eutree.learners.root_box import root_box
from eutree.policies import LeafStatistics
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.validation import check_choice


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
