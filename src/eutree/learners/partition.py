"""A partition as one sees it: regions of a plane through the space of observations.

Two features span the plane, the others keep their values. A tree's leaves meet it in rectangles,
the codewords of a leaf in polygons, the simplices of a grid in triangles where there are just two
features.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.discretization.codebook import Codebook
from eutree.discretization.kuhn import Grid
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
class Region:
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
    regions: tuple[Region, ...]
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
) -> tuple[Region, ...]:
    """Return the leaves of a tree that meet the plane.

    Args:
        tree: The tree.
        actions: Action of each leaf, shape [L].
        values: Value of each leaf, NaN where unknown, shape [L].
        plane: Where one looks.
    """
    found, outlines = rectangles(*leaf_boxes(tree), plane)
    return tuple(
        Region(outline, int(actions[leaf]), float(values[leaf]))
        for leaf, outline in zip(found.tolist(), outlines, strict=True)
    )


def codewords_seen(
    book: Codebook, actions: Integers, values: Floats, plane: Plane
) -> tuple[Region, ...]:
    """Return the regions of a codebook that meet the plane: each leaf cut by nearness.

    Args:
        book: The codebook.
        actions: Action of each region, shape [R].
        values: Value of each region, NaN where unknown, shape [R].
        plane: Where one looks.
    """
    regions = []
    leaves, outlines = rectangles(*leaf_boxes(book.tree), plane)
    offset = np.where(np.isin(np.arange(len(plane.at)), plane.axes), 0.0, plane.at / book.scale)
    for leaf, whole in zip(leaves.tolist(), outlines, strict=True):
        mine = range(int(book.first[leaf]), int(book.first[leaf + 1]))
        for region in mine:
            outline, word = whole, book.codewords[region]
            for other in mine:  # nearer than the other: 2 (c' - c) p <= c'^2 - c^2
                towards = 2.0 * (book.codewords[other] - word)
                limit = (book.codewords[other] ** 2 - word**2).sum() - towards @ offset
                outline = _cut(outline, (towards / book.scale)[plane.axes], float(limit))
            if len(outline):
                regions.append(Region(outline, int(actions[region]), float(values[region])))
    return tuple(regions)


def corners_seen(grid: Grid, actions: Integers, values: Floats, plane: Plane) -> tuple[Region, ...]:
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
        Region(outline, int(np.bincount(actions[part]).argmax()), float(values[part].mean()))
        for part, outline in zip(parts, outlines, strict=True)
    )


def _cut(outline: Floats, normal: Floats, limit: float) -> Floats:
    """Return the part of a convex polygon in which normal . p <= limit (Sutherland, Hodgman)."""
    if not len(outline):
        return outline
    excess = outline @ normal - limit
    kept: list[Floats] = []
    for i in range(len(outline)):
        here, there = excess[i - 1], excess[i]
        if (here > 0.0) != (there > 0.0):
            share = here / (here - there)
            kept.append(outline[i - 1] + share * (outline[i] - outline[i - 1]))
        if there <= 0.0:
            kept.append(outline[i])
    return np.array(kept).reshape(-1, 2)
