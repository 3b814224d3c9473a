"""The finite box around what was seen, and the regions of a plane through it.

Two features span the plane, the others keep their values. A tree's leaves meet it in rectangles.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.learners import Problem
from eutree.trees import DecisionTree

UNKNOWN = float("nan")
MARGIN = 0.05  # of the range of the data, on either side
LARGEST = 1e6  # a bound beyond is none, such as the largest float32


@dataclass(frozen=True, eq=False)
class Plane:
    """Where one looks: the plane of two features through a point.

    Attributes:
        x: Feature drawn to the right.
        y: Feature drawn upwards, another one.
        at: The point; its values of the two features do not matter.
        low: What of the plane is drawn: lower ends of x and y.
        high: Upper ends.
    """

    x: int
    y: int
    at: Floats  # [d]
    low: Floats  # [2]
    high: Floats  # [2]

    def __post_init__(self) -> None:
        d = len(self.at)
        if self.x == self.y or not (0 <= self.x < d and 0 <= self.y < d):
            raise InvalidArgumentError(
                f"x and y must be two of the features 0..{d - 1}, got {self.x} and {self.y}"
            )

    @property
    def axes(self) -> list[int]:
        """Both features."""
        return [self.x, self.y]


@dataclass(frozen=True, eq=False)
class PlaneRegion:
    """A region in the plane.

    Attributes:
        outline: Its corners in order; it is convex.
        action: What is done in it; None where that is no matter of the region.
        value: What it is worth; NaN where that is not known, infinite where it is lost.
    """

    outline: Floats  # [K, 2]
    action: int | None = None
    value: float = UNKNOWN


@dataclass(frozen=True, eq=False)
class Partition:
    """The regions that a plane meets.

    Attributes:
        plane: Where one looks.
        regions: The regions.
        goals: Outlines of the goal.
    """

    plane: Plane
    regions: tuple[PlaneRegion, ...]
    goals: tuple[Floats, ...] = ()


def rectangles(low: Floats, high: Floats, plane: Plane) -> tuple[Integers, Floats]:
    """Return which boxes meet the plane, and the rectangles in which they do.

    Args:
        low: Exclusive lower corners of boxes, shape [L, d].
        high: Inclusive upper corners, shape [L, d].
        plane: Where one looks.

    Returns:
        Numbers of boxes [R], and outlines [R, 4, 2].
    """
    others = np.delete(np.arange(low.shape[1]), plane.axes)
    meets = (low[:, others] < plane.at[others]) & (plane.at[others] <= high[:, others])
    first = np.maximum(low[:, plane.axes], plane.low)
    last = np.minimum(high[:, plane.axes], plane.high)
    found = np.flatnonzero(meets.all(axis=1) & (first < last).all(axis=1))
    (left, bottom), (right, top) = first[found].T, last[found].T
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    return found, np.stack([np.stack(corner, axis=1) for corner in corners], axis=1)


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
