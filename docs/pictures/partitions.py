"""The regions of a plane through what was seen: where it meets boxes, cells, and Kuhn triangles.

Two features span the plane, the others keep their values. A tree's leaves meet it in rectangles.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.trees.boxes import leaf_boxes
from eutree_lab.parti_game.game import PartiGame
from eutree_lab.vrd.kuhn import Grid

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


def corners_seen(
    grid: Grid, actions: Integers, values: Floats, plane: Plane
) -> tuple[PlaneRegion, ...]:
    """Return the boxes of a grid that meet the plane; with two features, their Kuhn triangles.

    A region has the mean of its corners' values and the action of most.

    Args:
        grid: The grid.
        actions: Action of each corner, shape [C].
        values: Value of each corner, shape [C].
        plane: Where one looks.
    """
    if grid.tree.n_features == 2:
        parts = grid.corner_of[:, [[0, 1, 3], [0, 2, 3]]].reshape(-1, 3)  # [2L, 3]
        outlines: Sequence[Floats] = list(grid.corners[parts][:, :, plane.axes])
    else:
        found, boxes = rectangles(*leaf_boxes(grid.tree), plane)
        parts, outlines = grid.corner_of[found], list(boxes)
    return tuple(
        PlaneRegion(outline, int(np.bincount(actions[part]).argmax()), float(values[part].mean()))
        for part, outline in zip(parts, outlines, strict=True)
    )


def cells_seen(game: PartiGame, plane: Plane) -> Partition:
    """Return the cells of a game that a plane meets, with their costs, and the goal."""
    found, outlines = rectangles(*leaf_boxes(game.cells.tree), plane)
    first, last = game.cells.goals[:, 0], game.cells.goals[:, 1]
    _, goals = rectangles(np.nextafter(first, -np.inf), last, plane)
    costs = game.plan().cost
    regions = tuple(
        PlaneRegion(outline, value=float(costs[cell]))
        for cell, outline in zip(found.tolist(), outlines, strict=True)
    )
    return Partition(plane, regions, tuple(goals))
