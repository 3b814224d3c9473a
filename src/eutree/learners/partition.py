"""A partition as one sees it: regions of a plane through the space of observations.

Two features span the plane, the others keep their values. A tree's leaves meet it in rectangles.
"""

from dataclasses import dataclass, field

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes

UNKNOWN = float("nan")


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
        values: What the values are, for example "value" or "cost"; "" if there are none.
        points: Points of the plane that matter: corners of a grid, codewords.
        points_are: What the points are, in the plural; "" if there are none.
        goals: Outlines of the goal.
    """

    plane: Plane
    regions: tuple[PlaneRegion, ...]
    values: str = ""
    points: Floats = field(default_factory=lambda: np.empty((0, 2)))  # [P, 2]
    points_are: str = ""
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


def leaves_seen(
    tree: DecisionTree, actions: Integers, values: Floats, plane: Plane
) -> tuple[PlaneRegion, ...]:
    """Return the leaves of a tree that meet the plane.

    Args:
        tree: The tree.
        actions: Action of each leaf, shape [L].
        values: Value of each leaf, NaN where unknown, shape [L].
        plane: Where one looks.
    """
    found, outlines = rectangles(*leaf_boxes(tree), plane)
    return tuple(
        PlaneRegion(outline, int(actions[leaf]), float(values[leaf]))
        for leaf, outline in zip(found.tolist(), outlines, strict=True)
    )
