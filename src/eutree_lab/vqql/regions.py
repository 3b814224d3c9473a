"""Where a plane meets the regions of a codebook: polygons, each leaf cut by nearness."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.learners.partition import Plane, PlaneRegion, rectangles
from eutree.trees.boxes import leaf_boxes
from eutree_lab.vqql.codebook import Codebook


def codewords_seen(
    book: Codebook, actions: Integers, values: Floats, plane: Plane
) -> tuple[PlaneRegion, ...]:
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
                regions.append(PlaneRegion(outline, int(actions[region]), float(values[region])))
    return tuple(regions)


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
