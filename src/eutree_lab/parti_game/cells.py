"""A partition of a finite box into cells that know their neighbours, and a goal region.

Cells are the leaves of a tree, clipped to the box. The goal is a union of boxes that lies inside
the cells, has precedence over them and is never split (Moore and Atkeson 1995, section 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Integers, frozen
from eutree.c45 import C45Settings, grow
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.learner import reached
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from eutree.validation import check_vector
from eutree_lab.parti_game import _kernels

GOAL = -1
"""The aim, and the outcome, of reaching the goal."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a finite box; a value, never changed in place.

    Attributes:
        tree: The partition; leaf i is cell i.
        low: Lower corner of each cell.
        high: Upper corner of each cell.
        goals: Lower and upper corners of the boxes that make up the goal.
        span: Sides of the box, the unit of lengths.
        neighbours: Cells that share a face with each cell, ascending.
    """

    tree: DecisionTree
    low: Floats  # [L, d]
    high: Floats  # [L, d]
    goals: Floats  # [G, 2, d]
    span: Floats  # [d]
    neighbours: tuple[Integers, ...]

    @classmethod
    def of(cls, tree: DecisionTree, low: ArrayLike, high: ArrayLike, goals: ArrayLike) -> "Cells":
        """Return the leaves of a tree inside the box from ``low`` to ``high``.

        A leaf that lies outside of the box becomes a cell of no volume and has no neighbours.

        Args:
            tree: Tree whose leaves become cells.
            low: Lower corner of the box, shape [d], finite.
            high: Upper corner, shape [d], above the lower one in every axis.
            goals: Lower and upper corners of the goal's boxes, shape [G, 2, d].
        """
        low = check_vector("low", low, size=tree.n_features)
        high = check_vector("high", high, size=tree.n_features)
        if not (low < high).all():
            raise InvalidArgumentError(f"low must be below high in every axis, got {low}, {high}")
        regions = np.asarray(goals, dtype=np.float64)
        if regions.ndim != 3 or regions.shape[1:] != (2, tree.n_features) or not len(regions):
            raise InvalidArgumentError(
                f"goals must have shape (G, 2, {tree.n_features}) with G >= 1, got {regions.shape}"
            )
        leaf_low, leaf_high = leaf_boxes(tree)
        cells = cls(
            tree, frozen(np.clip(leaf_low, low, high)), frozen(np.clip(leaf_high, low, high)),
            frozen(np.clip(regions, low, high)), frozen(high - low), (),
        )  # fmt: skip
        return replace(cells, neighbours=tuple(cells._touching(i) for i in range(len(cells))))

    def __len__(self) -> int:
        return self.tree.n_leaves

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lower and upper corner of the whole, each [d]."""
        return self.low.min(axis=0), self.high.max(axis=0)

    @property
    def volumes(self) -> Floats:
        """Volume of each cell as a share of the box, shape [L]."""
        shares: Floats = ((self.high - self.low) / self.span).prod(axis=1)
        return shares

    @property
    def beside_goal(self) -> Booleans:
        """Whether each cell's box meets the goal, shape [L]."""
        meets = (self.low[:, np.newaxis] <= self.goals[:, 1]) & (
            self.high[:, np.newaxis] >= self.goals[:, 0]
        )
        inside: Booleans = np.any(np.all(meets, axis=2), axis=1) & (self.volumes > 0.0)
        return inside

    def longest_axis(self, cell: int) -> int:
        """Return the axis of a cell's longest side in units of the box; the first one on ties."""
        return int(np.argmax((self.high[cell] - self.low[cell]) / self.span))

    def halve(self, chosen: Sequence[int]) -> "Cells":
        """Return the cells with some of them cut in the middle of their longest sides."""
        axes = [self.longest_axis(cell) for cell in chosen]
        middles = [
            0.5 * float(self.low[cell, axis] + self.high[cell, axis])
            for cell, axis in zip(chosen, axes, strict=True)
        ]
        return self.split(list(zip(chosen, axes, middles, strict=True)))

    def split(self, cuts: Sequence[tuple[int, int, float]]) -> "Cells":
        """Return the cells after cuts (cell, axis, threshold), at most one for each cell.

        The lower part keeps the cell's number, the upper part gets the next free one.
        """
        low, high = list(self.low), list(self.high)
        for cell, axis, threshold in cuts:
            if not self.low[cell, axis] < threshold < self.high[cell, axis]:
                raise InvalidArgumentError(
                    f"a cut of cell {cell} must lie between {self.low[cell, axis]} and "
                    f"{self.high[cell, axis]} in axis {axis}, got {threshold}"
                )
            below, above = high[cell].copy(), low[cell].copy()
            below[axis] = above[axis] = threshold
            high.append(high[cell])
            low.append(above)
            high[cell] = below
        tree = self.tree.split_each(cuts)
        cells = replace(self, tree=tree, low=frozen(np.array(low)), high=frozen(np.array(high)))
        changed = {cell for cell, _, _ in cuts} | set(range(len(self), len(cells)))
        affected = changed.union(*(self.neighbours[cell].tolist() for cell, _, _ in cuts))
        kept = [*self.neighbours, *[np.empty(0, np.int64)] * len(cuts)]
        return replace(
            cells,
            neighbours=tuple(
                cells._touching(i) if i in affected else old for i, old in enumerate(kept)
            ),
        )

    def goal_point(self, cell: int) -> Floats:
        """Return the middle of the part of the goal that lies in a cell, shape [d]."""
        low = np.maximum(self.goals[:, 0], self.low[cell])
        high = np.minimum(self.goals[:, 1], self.high[cell])
        inside = (low <= high).all(axis=1)
        which = int(np.argmax(inside))
        middle: Floats = 0.5 * (low[which] + high[which])
        return middle

    def face_point(self, cell: int, neighbour: int, offset: float) -> Floats:
        """Return the point of ``neighbour`` just beyond the middle of the face it shares, [d].

        Args:
            cell: Where one comes from.
            neighbour: Where one wants to go.
            offset: How far beyond, as a share of the neighbour's smallest side.
        """
        low = np.maximum(self.low[cell], self.low[neighbour])
        high = np.minimum(self.high[cell], self.high[neighbour])
        point: Floats = 0.5 * (low + high)
        axis = int(np.argmin(high - low))
        sides = (self.high[neighbour] - self.low[neighbour]) / self.span
        towards = 1.0 if self.low[neighbour, axis] == self.high[cell, axis] else -1.0
        point[axis] += towards * offset * float(sides.min()) * self.span[axis]
        return point

    def centre(self, cell: int) -> Floats:
        """Return the middle of a cell, shape [d]."""
        middle: Floats = 0.5 * (self.low[cell] + self.high[cell])
        return middle

    def _touching(self, cell: int) -> Integers:
        touches = np.empty(len(self.low), np.bool_)
        _kernels.touching(self.low, self.high, cell, touches)
        if not (self.high[cell] > self.low[cell]).all():
            touches[:] = False
        return np.flatnonzero(touches & (self.high > self.low).all(axis=1))


MARGIN = 1e-3  # around final observations where no test tells the goal, as a share of the box


def goal_boxes(episodes: Sequence[Episode], low: Floats, high: Floats) -> Floats:  # [G, 2, d]
    """Return where episodes reached the goal: the leaves of C4.5's tree of o' that say so.

    Args:
        episodes: Episodes, some of which reached it.
        low: Lower corner of the box, shape [d].
        high: Upper corner, shape [d].
    """
    good = [e for e, is_good in zip(episodes, reached(episodes), strict=True) if is_good]
    places = np.concatenate([episode.observations[1:] for episode in episodes])
    ends = np.concatenate(
        [(np.arange(len(e)) == len(e) - 1) & any(e is g for g in good) for e in episodes]
    ).astype(np.int64)
    grown = grow(places, ends, n_classes=2, settings=C45Settings.lossless())
    tree, labels = grown.to_decision_tree()
    leaf_low, leaf_high = (np.clip(x, low, high) for x in leaf_boxes(tree))
    positive = (labels == 1) & (leaf_low <= leaf_high).all(axis=1)
    if positive.any():
        return np.stack([leaf_low[positive], leaf_high[positive]], axis=1)
    final = places[ends == 1]
    wide = MARGIN * (high - low)
    bottom, top = final.min(axis=0) - wide, final.max(axis=0) + wide
    around: Floats = np.clip(np.stack([bottom, top])[np.newaxis], low, high)
    return around
