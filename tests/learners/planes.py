"""Planes through the unit cube, and checks that regions tile them."""

import numpy as np
import pytest

from eutree.learners.partition import Plane
from eutree.trees import DecisionTree


def area(outline):
    """Return the area of a polygon, by the shoelace formula."""
    x, y = outline.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def holds(outline, point):
    """Return whether a convex polygon holds a point."""
    along, to = np.roll(outline, -1, axis=0) - outline, point - outline
    turns = along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]
    return bool((turns >= -1e-12).all() or (turns <= 1e-12).all())


def random_tree(generator, d, cuts=12):
    tree = DecisionTree.single_leaf(d)
    for _ in range(cuts):
        leaf = int(generator.integers(tree.n_leaves))
        tree = tree.split(leaf, int(generator.integers(d)), float(generator.random()))
    return tree


def unit_plane(generator, d):
    x, y = generator.permutation(d)[:2].tolist()
    return Plane(x, y, generator.random(d), np.zeros(2), np.ones(2))


def check_regions(regions, plane, number_of, generator):
    """Tiling by area, and the region of each of some points of the plane by what it says."""
    assert sum(area(region.outline) for region in regions) == pytest.approx(1.0)
    for _ in range(60):
        point = plane.at.copy()
        point[plane.axes] = generator.random(2)
        mine = [region for region in regions if holds(region.outline, point[plane.axes])]
        assert number_of(point) in [region.value for region in mine]
        assert len(mine) == 1  # a point on a cut has no chance
