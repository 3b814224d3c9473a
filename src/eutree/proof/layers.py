"""The states reached from all starts, step by step, in boxes along axes of the plant's own.

A box along the numbers of a state grows at every step that turns it, however finely the starts are
cut, and where every step doubles distances no piece of the starts is ever decided. A plant may say
along which *axes* its steps hardly turn anything: for a linear plant, those of its modes. There the
image of a box is nearly a box. All that is reached after a step is known as boxes, one in each cell
of a grid of these axes that is met: the hull of the states there. A box is cut by the leaves of the
tree, each part moves by the action of its leaf, and the images are joined in the cells that they
meet. Nothing is rounded to cells, so slow changes do not creep.
"""

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError, shown
from eutree.policies import TreePolicy
from eutree.policies.sklearn_tree import float64_thresholds
from eutree.proof import _kernels as kernels
from eutree.proof.intervals import Affine, Doubt, Intervals, Truth, middle
from eutree.proof.plant import Plant, State
from eutree.proof.reach import Acting, first_action
from eutree.trees.boxes import leaf_boxes
from eutree.validation import check_numbers

_AT_ONCE = 1 << 13  # boxes that are cut and moved together: their arrays stay in the cache
_DRAWN, _KEPT, _ROUNDS = 2000, 20, 4  # starts of episodes that are drawn and kept, and how often
_MOST_PLACES = 50_000_000  # cells of the grid that is laid around one layer
_FARTHEST = 2.0**52  # number of a cell: so far each is told from the next
_ROUND = 2.0**-50  # of the terms of a sum of a few


class Layers:
    """The states after each number of steps, in boxes along the axes of a plant that has some.

    The cells are ``refine`` times finer than the plant's own.
    """

    low: Floats  # [N, d] lower bounds of the boxes, along the axes
    high: Floats  # [N, d] upper bounds

    def __init__(self, policy: TreePolicy, plant: Plant, refine: int = 1) -> None:
        self._plant = plant
        self._axes, cells = _axes(plant)
        self._back = _inverse(self._axes)
        n = policy.derivation.n_measured  # no test is about what is derived
        low, high = (
            _thresholds(np.ascontiguousarray(end[:, :n]), plant) for end in leaf_boxes(policy.tree)
        )
        self._leaves = kernels.Parts(low, high)
        self._actions = np.asarray(policy.actions, dtype=np.int64)
        asked = np.isfinite(low).any(axis=0) | np.isfinite(high).any(axis=0)
        matters = (self._back[asked] != 0).any(axis=0)
        # Of the cells along each axis; infinite where no test of the tree depends on it.
        self.width = np.where(matters, cells / refine, np.inf)
        self.box_steps = self.most = 0  # steps of boxes, and most boxes at once, so far
        # Whether finer cells lead no farther: there is no room for them, or only one that is all.
        self.is_finest = bool(np.isinf(self.width).all())
        self._begin()

    def keeps(self, broken: Callable[[State], Truth], horizon: int, most: int) -> int:
        """Return for how many steps nothing that is reached is broken, by so many box steps."""
        for steps in range(horizon):
            if self.box_steps > most or not self.step() or broken(self.state()).maybe.any():
                return steps
            goes_on = ~self._plant.ends(self.state()).surely
            if not goes_on.any():
                break
            self.low, self.high = self.low[goes_on], self.high[goes_on]
        return horizon

    def step(self) -> bool:
        """Go one step; return whether there was room for it."""
        images = [self._moved(*part) for part in self._parts(self._leaves, self.low, self.high)]
        low, high = (np.concatenate(ends) for ends in zip(*images, strict=True))
        self.box_steps += len(low)
        return bool(np.isfinite(low).all() and np.isfinite(high).all()) and self._join(low, high)

    def state(self) -> State:
        """Return the states in the boxes."""
        return self._state(self.low, self.high)

    def _begin(self) -> None:
        """Fill the boxes with the starts, cell by cell."""
        start = np.array(self._plant.start)
        ends = self._axes[:, :, None] * start
        size = np.abs(ends).max(axis=2).sum(axis=1) * _ROUND
        low, high = ends.min(axis=2).sum(axis=1) - size, ends.max(axis=2).sum(axis=1) + size
        self.low, self.high = low[None], high[None]  # all in one box, where there is no room
        self._join(self.low, self.high)
        starts = kernels.Parts(*start.T[:, None])
        found = [part[:2] for part in self._parts(starts, self.low, self.high)]
        self.low, self.high = (np.concatenate(ends) for ends in zip(*found, strict=True))

    def _parts(
        self, parts: kernels.Parts, low: Floats, high: Floats
    ) -> Iterator[tuple[Floats, Floats, Integers]]:
        """Yield boxes around intersections with parts, and the parts' numbers, some at a time."""
        for begin in range(0, len(low), _AT_ONCE):
            some = slice(begin, begin + _AT_ONCE)
            room = len(low[some]) * len(parts.low)
            found = np.empty((2, room, low.shape[1]))
            number = np.empty(room, dtype=np.int64)
            n = kernels.cut(self._back, parts, low[some], high[some], found[0], found[1], number)
            yield found[0, :n], found[1, :n], number[:n]

    def _moved(self, low: Floats, high: Floats, leaf: Integers) -> tuple[Floats, Floats]:
        """Return bounds [N, d] of where parts in leaves lead."""
        later = self._plant.step(self._state(low, high), self._actions[leaf])
        places = [_weighed(row, later) for row in self._axes]
        return np.stack([x.low for x in places], axis=1), np.stack([x.high for x in places], axis=1)

    def _state(self, low: Floats, high: Floats) -> State:
        """Return the states in boxes, as functions of the places in them."""
        none = np.zeros(len(low), dtype=np.int64)
        doubt = Doubt(none, none - 1)
        center = middle(low.T, high.T)
        radius = np.maximum(high.T - center, center - low.T)
        size = np.abs(self._back) @ (np.abs(center) + radius) * _ROUND
        value, slope = self._back @ center, self._back[:, :, None] * radius
        return [Affine(*one, doubt) for one in zip(value, slope, size, strict=True)]

    def _join(self, low: Floats, high: Floats) -> bool:
        """Take boxes together in the cells that they meet; return whether there was room."""
        with np.errstate(over="ignore", invalid="ignore"):  # of cells too narrow to be counted
            first = np.floor(low.min(axis=0) / self.width)
            count = np.floor(high.max(axis=0) / self.width) - first + 1
        if not (count.prod() <= _MOST_PLACES and np.abs(first).max() < _FARTHEST):
            self.is_finest = True
            return False
        places, met, size = int(count.prod()), -1, len(low)
        while met < 0:  # more cells than there was room for
            size *= 2
            cells = kernels.MetCells(
                self.width, first.astype(np.int64), count.astype(np.int64),
                np.full(places, -1, dtype=np.int32), *np.empty((2, size, len(first))),
            )  # fmt: skip
            met = kernels.join(cells, low, high)
        self.low, self.high = cells.low[:met], cells.high[:met]
        self.most = max(self.most, met)
        return True


def worst_starts(
    acting: Acting, plant: Plant, harm: Callable[[Floats], Floats], horizon: int, whole: Booleans
) -> Floats:
    """Return starts [N, d] whose episodes do most harm at their worst step.

    They are drawn, and then drawn again around those that did most, all rounded to whole numbers
    along those that are ``whole`` [d]. Episodes are played in the plant, whose middles are not
    quite the environment: to be replayed in it. ``harm`` says how bad measures [m, N] are, [N].
    """
    generator, bounds = np.random.default_rng(0), np.array(plant.start).T
    width = bounds[1] - bounds[0]
    starts = generator.uniform(bounds[0], bounds[1], (_DRAWN, len(width)))
    for nearer in range(_ROUNDS):
        starts = np.where(whole, np.rint(starts), starts)
        order = np.argsort(-_harm(acting, plant, harm, starts, horizon), kind="stable")
        best = starts[order[:_KEPT]]
        near = np.repeat(best, _DRAWN // _KEPT - 1, axis=0)
        near = near + generator.normal(0.0, 0.1 ** (nearer + 1), near.shape) * width
        starts = np.concatenate([best, np.clip(near, *bounds)])
    return best


def _harm(
    acting: Acting, plant: Plant, harm: Callable[[Floats], Floats], starts: Floats, horizon: int
) -> Floats:
    """Return the most harm of the episodes from starts [N, d], shape [N]."""
    state: State = [Intervals.of(column) for column in starts.T]
    most, over = np.full(len(starts), -np.inf), np.zeros(len(starts), dtype=bool)
    with np.errstate(all="ignore"):  # an episode that has ended long ago may overflow
        for _ in range(horizon):
            later = plant.step(state, first_action(acting(state)))
            state = [Intervals.of(middle(one.low, one.high)) for one in later]
            seen = np.broadcast_arrays(*(Intervals.of(one).low for one in plant.measure(state)))
            most = np.fmax(most, np.where(over, -np.inf, harm(np.stack(seen))))
            over |= plant.ends(state).surely
    return most


def _thresholds(bounds: Floats, plant: Plant) -> Floats:
    """Return bounds of leaves [L, n] as bounds of the doubles that observations round."""
    if np.dtype(plant.precision) != np.float32:
        return bounds
    return np.where(np.isfinite(bounds), float64_thresholds(bounds), bounds)


def _axes(plant: Plant) -> tuple[Floats, Floats]:
    """Return the axes of a plant, shape [d, d], and the width of a cell along each of them."""
    d = len(plant.state)
    axes = check_numbers("axes of a plant", plant.axes, ndim=2)
    cells = check_numbers("cells of a plant", plant.cells, ndim=1)
    if axes.shape != (d, d) or cells.shape != (d,) or not (cells > 0.0).all():
        raise InvalidArgumentError(
            f"axes and cells of a plant must be {d} rows of {d} numbers and {d} widths above 0, "
            f"got {shown(plant.axes)} and {shown(plant.cells)}"
        )
    return axes, cells


def _inverse(axes: Floats) -> Floats:
    regular = bool(np.linalg.det(axes))
    back: Floats = np.linalg.inv(axes).astype(np.float64) if regular else np.zeros_like(axes)
    product = _exact(axes) @ _exact(back)
    if (product != np.eye(len(axes), dtype=int)).any():
        raise InvalidArgumentError(
            f"axes of a plant must have an inverse in doubles, without rounding, got "
            f"{axes.tolist()}"
        )
    return back


def _exact(numbers: Floats) -> Any:
    return np.vectorize(Fraction, otypes=[object])(numbers)


def _weighed(row: Floats, state: State) -> Intervals:
    """Return the place of states along an axis."""
    terms = [weight * one for weight, one in zip(row.tolist(), state, strict=True) if weight]
    found: Intervals = sum(terms[1:], start=terms[0])
    return found
