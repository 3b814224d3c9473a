"""Where a plane meets the boxes of a grid; with two features, their Kuhn triangles."""

from collections.abc import Sequence

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees.boxes import leaf_boxes
from eutree_lab.planes import Plane, PlaneRegion, rectangles
from eutree_lab.vrd.kuhn import Grid


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
