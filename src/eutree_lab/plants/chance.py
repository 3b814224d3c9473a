"""Numbers that move by chance, from cell to cell: bounds of means, and for every single state.

A state's number is in a cell, and within it as a *reference* density says. One noisy step later it
is in cell j with probability ``mean[j]``, but not quite as that cell's own reference says. The
value after the step is known as a mean over each cell and between two bounds within it; so a value
computed from the means is off by at most the width between these bounds times half of the distance
of the two densities, ``blur[j]``: an error of second order. An adversary who chooses the worst
place of each cell again at every step, as interval Markov chains have one, is off by a cell after
each.

The same for one fixed state in place of the reference has ``most`` and ``spread``; its mean part is
summed by parts, since the probability to end beyond an edge grows with the number itself.
"""

import math
from dataclasses import dataclass, fields

import numpy as np

from eutree.arrays import Floats, frozen
from eutree.proof.intervals import middle

REACH = 5.5  # standard deviations that are followed
TAIL = math.erfc(REACH / math.sqrt(2.0))  # the chance of more, to both sides together
_PEAK = 1.0 / math.sqrt(2.0 * math.pi)  # of the normal density
_STEEPEST = math.exp(-0.5) * _PEAK  # slope of it
_PLACES = 65  # of starts in a cell
_AROUND, _ALONG = 384, 96  # of ends in a cell of a circle, and of a line


@dataclass(frozen=True, eq=False)
class Moves:
    """One step from each of I cells to J cells.

    Attributes:
        mean: Probability to end in a cell, of a start that the reference density draws.
        blur: Half of the distance of the end's density there from the cell's reference density
            times that probability.
        low: Least probability to end in this cell or above, over the starts of a cell.
        high: Greatest.
        most: Greatest probability to end in a cell.
        spread: As ``blur``, of a single start; the greatest.
    """

    mean: Floats  # [I, J]
    blur: Floats  # [I, J]
    low: Floats  # [I, J]
    high: Floats  # [I, J]
    most: Floats  # [I, J]
    spread: Floats  # [I, J]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = np.ascontiguousarray(getattr(self, field.name))
            object.__setattr__(self, field.name, frozen(value))


@dataclass(frozen=True, kw_only=True)
class Normal:
    """A normal distribution; one of deviation 0 is a number."""

    center: float
    deviation: float

    def below(self, x: Floats) -> Floats:
        """Return the probability of less than x, of any shape."""
        scale = -1.0 / (self.deviation * math.sqrt(2.0))
        values = [0.5 * math.erfc(one) for one in ((x - self.center) * scale).ravel().tolist()]
        return np.array(values).reshape(np.shape(x))

    def density(self, x: Floats) -> Floats:
        """Return the density, of any shape."""
        z = (x - self.center) / self.deviation
        found: Floats = np.exp(-0.5 * z * z) * (_PEAK / self.deviation)
        return found

    def after(self, steps: int) -> "Normal":
        """Return the sum of so many independent ones."""
        return Normal(center=steps * self.center, deviation=math.sqrt(steps) * self.deviation)


@dataclass(frozen=True, eq=False)
class _Target:
    """The cells in which a step ends."""

    edges: Floats  # [J + 1]
    reference: Floats  # [J, P] density at ``points``
    variation: Floats  # [J] how much it rises and falls in a cell
    points: Floats  # [J, P] middles of equal parts of each cell

    def half_distance(self, density: Floats, variation: Floats, share: Floats) -> Floats:
        """Return a bound of half of the distance of a density from shares of the reference.

        Args:
            density: At the points, shape [..., J, P].
            variation: How much it rises and falls in each cell, at most, shape [..., J].
            share: Probability of each cell, shape [..., J].
        """
        part = np.diff(self.edges) / self.points.shape[1]
        off = np.abs(density - share[..., None] * self.reference).sum(axis=-1)
        # Between two points a function changes by no more than it rises and falls.
        found: Floats = np.minimum(0.5 * part * (off + variation + share * self.variation), share)
        return found

    def from_place(self, low: float, high: float, step: Normal) -> tuple[Floats, Floats]:
        """Return ``most`` and ``spread`` of steps from places between two, shapes [J]."""
        places = np.linspace(low, high, _PLACES if high > low else 1)[:, None]
        below = step.below(self.edges - places)
        share = np.diff(below)
        density = step.density(self.points - places[..., None])
        at_edges = step.density(self.edges - places)
        top = step.density(np.clip(places + step.center, self.edges[:-1], self.edges[1:]) - places)
        found = self.half_distance(density, 2 * top - at_edges[:, :-1] - at_edges[:, 1:], share)
        width, deviation = np.diff(self.edges), step.deviation
        steep = np.minimum(2 * _PEAK / deviation, width * _STEEPEST / deviation**2)
        between = (high - low) / (2 * (_PLACES - 1))
        best = np.clip(middle(self.edges[:-1], self.edges[1:]) - step.center, low, high)
        most = step.below(self.edges[1:] - best) - step.below(self.edges[:-1] - best)
        return most, np.minimum(found.max(axis=0) + steep * between, most)


def circle_moves(width: float, step: Normal) -> tuple[int, Moves]:
    """Return the offset of the first cell that is reached on a circle of equal cells, and the step.

    The reference density is uniform, and the step is the same from every cell, so I is 1. The
    probability beyond ``REACH`` counts to the last cells.

    Args:
        width: Of a cell.
        step: How far a state moves.
    """
    reach = REACH * step.deviation
    first = math.floor((step.center - reach) / width)
    last = math.ceil((step.center + width + reach) / width)
    edges = width * np.arange(first, last + 1, dtype=np.float64)
    points = _middles(edges, _AROUND)
    target = _Target(edges, np.full(points.shape, 1 / width), np.zeros(last - first), points)
    inner = edges[1:-1]
    below = (_summed_below(inner, step) - _summed_below(inner - width, step)) / width
    mean = np.diff(np.concatenate([[0.0], below, [1.0]]))
    box = (step.below(points) - step.below(points - width)) / width
    peak = np.clip(step.center + width / 2, edges[:-1], edges[1:])
    top = (step.below(peak) - step.below(peak - width)) / width
    blur = target.half_distance(box, 2 * top, mean)
    most, spread = target.from_place(0.0, width, step)
    low, high = (np.concatenate([[1.0], 1.0 - step.below(inner - x)]) for x in (0.0, width))
    return first, Moves(*(row[None] for row in (mean, blur, low, high, most, spread)))


def line_moves(source: Floats, target: Floats, steps: int, step: Normal) -> Moves:
    """Return one step more on a line, after some that began at 0.

    The reference density is that of the sum of the steps.

    Args:
        source: Edges of the I cells, shape [I + 1]; after 0 steps, two that are 0.
        target: Edges of the cells one step later, shape [J + 1].
        steps: How many steps were taken before.
        step: How far a state moves.
    """
    then = step.after(steps + 1)
    mass = np.diff(then.below(target))
    points = _middles(target, _ALONG)
    at_edges = then.density(target)
    top = then.density(np.clip(then.center, target[:-1], target[1:]))
    variation = (2 * top - at_edges[:-1] - at_edges[1:]) / mass
    cells = _Target(target, then.density(points) / mass[:, None], variation, points)
    far = np.concatenate(
        [target[:1] - 5 * then.deviation, target, target[-1:] + 5 * then.deviation]
    )
    nodes, weights = _gauss(far)  # the first and the last of these are beyond the cells
    rows = []
    for low, high in zip(source[:-1].tolist(), source[1:].tolist(), strict=True):
        back = _Backward(low, high, steps, step)
        mean = (weights * then.density(nodes) * back(nodes)).sum(axis=1)
        joint = then.density(points) * back(points)
        blur = cells.half_distance(joint, 2 * top * back.most(target), mean[1:-1])
        most, spread = cells.from_place(low, high, step)
        # The probability beyond the cells counts to the last ones; where in them is unknown.
        outside, mean = mean[[0, -1]], mean[1:-1]
        beyond = np.zeros((2, mean.size))
        beyond[0, [0, -1]] = outside
        beyond[1, 0] = step.below(target[:1] - low)[0]
        beyond[1, -1] = 1.0 - step.below(target[-1:] - high)[0]
        tails = (np.concatenate([[1.0], 1.0 - step.below(target[1:-1] - x)]) for x in (low, high))
        mean, blur = mean + beyond[0], blur + beyond[0]
        most, spread = most + beyond[1], spread + beyond[1]
        rows.append((mean, blur, *tails, most, spread))
    return Moves(*(np.stack(column) for column in zip(*rows, strict=True)))


class _Backward:
    """How much likelier a start in a cell is, given where the step ended.

    Of normal numbers the start, given the end, is normal too.
    """

    def __init__(self, low: float, high: float, steps: int, step: Normal) -> None:
        self._low, self._high, self._steps, self._step = low, high, steps, step
        self._share = 1.0
        if steps > 0:
            self._share = float(np.diff(step.after(steps).below(np.array([low, high])))[0])

    def __call__(self, x: Floats) -> Floats:
        if self._steps == 0:
            return np.ones(np.shape(x))
        ratio = self._steps / (self._steps + 1)
        start = Normal(center=0.0, deviation=self._step.deviation * math.sqrt(ratio))
        center = x * ratio  # steps * center + (x - (steps + 1) * center) * ratio
        found: Floats = start.below(self._high - center) - start.below(self._low - center)
        found /= self._share
        return found

    def most(self, edges: Floats) -> Floats:
        """Return the greatest value in each cell, shape [J]."""
        if self._steps == 0:
            return np.ones(edges.size - 1)
        best = (self._low + self._high) * (self._steps + 1) / (2 * self._steps)
        return self(np.clip(best, edges[:-1], edges[1:]))


def _summed_below(x: Floats, step: Normal) -> Floats:
    """Return the integral of ``step.below`` up to x."""
    found: Floats = (x - step.center) * step.below(x) + step.deviation**2 * step.density(x)
    return found


def _middles(edges: Floats, count: int) -> Floats:
    parts = (np.arange(count) + 0.5) / count
    found: Floats = edges[:-1, None] + np.diff(edges)[:, None] * parts
    return found


def _gauss(edges: Floats) -> tuple[Floats, Floats]:
    """Return places and weights of an integral over each cell, shapes [J, 40]."""
    x, w = np.polynomial.legendre.leggauss(40)
    half = np.diff(edges)[:, None] / 2
    return middle(edges[:-1], edges[1:])[:, None] + half * x, half * w
