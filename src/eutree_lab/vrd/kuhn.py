"""A grid of boxes of any sizes whose corners are the states, with Kuhn interpolation between.

The states of variable resolution discretization are the corners of the leaf boxes, not the leaves.
Inside a box, values are linear on each simplex of Kuhn's triangulation: d + 1 corners instead of
multilinear interpolation's 2^d (R. Munos and A. Moore, *Variable Resolution Discretization in
Optimal Control*, Machine Learning 49, 2002). A corner of a small box in the middle of a large
box's face is no corner of the large one, so values may jump there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers, frozen
from eutree.errors import InvalidArgumentError
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from eutree.validation import check_vector
from eutree_lab.vrd import _kernels_corners as kernels

MOST_FEATURES = 6  # 64 corners of a box


@dataclass(frozen=True, eq=False)
class Grid:
    """Boxes and their corners; a value.

    Attributes:
        tree: The partition; leaf l is box l.
        low: Lower corner of each box.
        high: Upper corner of each box.
        corners: The distinct corners of all boxes.
        corner_of: Number of each corner of each box; bit i of the column: upper end in axis i.
        span: Sides of the whole, the unit of lengths.
    """

    tree: DecisionTree
    low: Floats  # [L, d]
    high: Floats  # [L, d]
    corners: Floats  # [C, d]
    corner_of: Integers  # [L, 2^d]
    span: Floats  # [d]

    @classmethod
    def of(cls, tree: DecisionTree, low: ArrayLike, high: ArrayLike) -> "Grid":
        """Return the leaves of a tree inside the box from ``low`` to ``high``.

        Raises:
            InvalidArgumentError: The box is not finite, a leaf lies outside of it, or there are
                more than six features.
        """
        d = tree.n_features
        if d > MOST_FEATURES:
            raise InvalidArgumentError(
                f"a grid must have at most {MOST_FEATURES} features (2^d corners a box), got {d}"
            )
        low = check_vector("low", low, size=d)
        high = check_vector("high", high, size=d)
        if not (low < high).all():
            raise InvalidArgumentError(f"low must be below high in every axis, got {low}, {high}")
        leaf_low, leaf_high = leaf_boxes(tree)
        leaf_low, leaf_high = np.clip(leaf_low, low, high), np.clip(leaf_high, low, high)
        if not (leaf_low < leaf_high).all():
            raise InvalidArgumentError("every leaf of the tree must meet the inside of the box")
        upper = (np.arange(2**d)[:, np.newaxis] >> np.arange(d)) & 1  # [2^d, d]
        ends = np.where(upper[np.newaxis], leaf_high[:, np.newaxis], leaf_low[:, np.newaxis])
        corners, number = np.unique(ends.reshape(-1, d), axis=0, return_inverse=True)
        return cls(
            tree, frozen(leaf_low), frozen(leaf_high), frozen(corners),
            frozen(number.reshape(-1, 2**d).astype(np.int64)), frozen(high - low),
        )  # fmt: skip

    @classmethod
    def uniform(cls, low: ArrayLike, high: ArrayLike, halvings: Sequence[int]) -> "Grid":
        """Return the grid whose axis i was halved ``halvings[i]`` times everywhere."""
        low = check_vector("low", low, size=len(halvings))
        high = check_vector("high", high, size=len(halvings))
        tree = DecisionTree.single_leaf(len(halvings))
        bottom, top = low[np.newaxis], high[np.newaxis]  # [L, d]
        for axis, n in enumerate(halvings):
            for _ in range(n):
                middle = 0.5 * (bottom[:, axis] + top[:, axis])
                tree = tree.split_each([(i, axis, float(m)) for i, m in enumerate(middle)])
                above, below = bottom.copy(), top.copy()
                above[:, axis] = below[:, axis] = middle
                bottom, top = np.concatenate([bottom, above]), np.concatenate([below, top])
        return cls.of(tree, low, high)

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lower and upper corner of the whole, each [d]."""
        return self.low.min(axis=0), self.high.max(axis=0)

    @property
    def n_corners(self) -> int:
        """Number of corners C: of states."""
        return int(self.corners.shape[0])

    def weights(self, points: ArrayLike) -> tuple[Integers, Floats]:
        """Return corners and Kuhn weights of points, each of shape [N, d + 1].

        The weights are not negative and sum to 1; a point outside counts as the nearest inside.
        """
        points = np.clip(np.ascontiguousarray(points, dtype=np.float64), *self.box)
        shape = (points.shape[0], self.tree.n_features + 1)
        successor, weight = np.empty(shape, np.int64), np.empty(shape)
        leaf = self.tree.leaf_index(points)
        kernels.interpolate(points, leaf, self.low, self.high, self.corner_of, successor, weight)
        return successor, weight

    def interpolate(self, values: Floats, points: ArrayLike) -> Floats:
        """Return the values at points, from those at the corners, shape [N]."""
        successor, weight = self.weights(points)
        between: Floats = (weight * values[successor]).sum(axis=1)
        return between

    def halve(self, cuts: Sequence[tuple[int, int]]) -> "Grid":
        """Return the grid after halving boxes, each (box, axis), at most once each."""
        middles = [0.5 * float(self.low[i, axis] + self.high[i, axis]) for i, axis in cuts]
        tree = self.tree.split_each(
            [(i, axis, middle) for (i, axis), middle in zip(cuts, middles, strict=True)]
        )
        return Grid.of(tree, *self.box)

    def edges(self, axis: int) -> tuple[Integers, Integers]:
        """Return lower and upper corners of the edges along an axis, each [L, 2^(d-1)]."""
        columns = np.arange(self.corner_of.shape[1])
        lower = columns[(columns >> axis) & 1 == 0]
        return self.corner_of[:, lower], self.corner_of[:, lower | (1 << axis)]
