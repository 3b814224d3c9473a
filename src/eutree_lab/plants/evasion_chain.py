"""Bounds of a policy's return in N-Evasion: backwards over the steps, over cells of the states.

An opponent and its hidden direction are one number on a circle, which turns by a noisy step; at
the start it is uniform there, and so it stays at all times. The agent has moved k times or not at
all, so its place is a normal number around k steps, in rows of its own *level*.

An opponent is carried only between the first level and the last at which a decision or a collision
depends upon it. Before, nothing has looked at it, so it is uniform and independent of all that
happened, and is summed out; behind, it no longer matters. The agent never goes back.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.envs.evasion import EvasionParameters
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.proof import ActingNodes
from eutree.proof.intervals import middle
from eutree_lab.plants import _kernels_chance as kernels
from eutree_lab.plants.chance import REACH, TAIL, Moves, Normal, circle_moves, line_moves

MOST_CELLS = 4_000_000
_GO = 1  # the action, as the environment counts
_INNER = 3.0  # deviations within which rows are narrow
_SLICES = 32  # of a cell along the main path, for its share of collisions
_ROUNDING = 1e-11  # of the values, a step: rounding of doubles, in the program and here


@dataclass(frozen=True, kw_only=True)
class Payoffs:
    """Worth of an episode's events.

    Attributes:
        goal: The end at the goal.
        collision: The end by a collision.
        late: The end by the time limit.
        stop: One stop of the agent.
        low: No episode is worth less, from any step on.
        high: Nor more.
    """

    goal: float
    collision: float
    late: float
    stop: float
    low: float
    high: float


SUCCESS = Payoffs(goal=1.0, collision=0.0, late=0.0, stop=0.0, low=0.0, high=1.0)


@dataclass(frozen=True, eq=False)
class _Level:
    """The cells of all states in which the agent has moved k times.

    Attributes:
        edges: Of the R cells along the main path.
        shape: Number of cells of each opponent; 1 where it is not carried.
        kind: Which column of ``share`` decides in a row; -1 at the goal.
        share: Share of each cell in which the policy goes; negative: whichever is better.
        collisions: Where they are; None where none can be.
    """

    edges: Floats  # [R + 1]
    shape: tuple[int, ...]
    kind: Integers  # [R]
    share: Floats  # [N, Q]
    collisions: kernels.Ends | None


@dataclass(frozen=True, eq=False)
class _Ahead:
    """Values before all opponents' steps, and their greatest errors.

    Attributes:
        mean: Bounds of the mean of a cell.
        place: Bounds of the mean at each place.
        state: Bounds for each state of the opponents, of the mean over the agent's places.
        fixed: Bounds for each state of the opponents, at each place.
        off: Greatest error of means.
        off_state: Greatest error of the values of single states.
        width: Width of the bounds at places; the further error of going is in proportion.
        width_state: As ``width``, for single states.
    """

    mean: Sequence[Floats]  # two of [*shape, R]
    place: Sequence[Floats]  # two of [*shape, R]
    state: Sequence[Floats]  # two of [*shape, R]
    fixed: Sequence[Floats]  # two of [*shape, R]
    off: Floats  # [*shape, R]
    off_state: Floats  # [*shape, R]
    width: Floats  # [*shape, R]
    width_state: Floats  # [*shape, R]


class EvasionChain:
    """All states of N-Evasion under a policy, or under the best there is.

    Args:
        parameters: The domain.
        policy: The policy; None for the best one, which sees all that there is.
        cells: Number of cells of each opponent's circle, an even number.
        spacing: Width of the rows along the main path, in deviations of the agent's place.

    Raises:
        InvalidArgumentError: It would take more than ``MOST_CELLS`` cells.
    """

    def __init__(
        self,
        parameters: EvasionParameters,
        policy: TreePolicy | None,
        *,
        cells: int,
        spacing: float,
    ) -> None:
        self._parameters, self._policy, self._cells = parameters, policy, cells
        self._spacing = spacing
        deviation = parameters.noise
        self._agent = Normal(
            center=parameters.agent_step, deviation=deviation * parameters.agent_step
        )
        opponent = Normal(
            center=parameters.opponent_step, deviation=deviation * parameters.opponent_step
        )
        self._width = 2.0 * parameters.path_length / cells
        self._first, self._circle = circle_moves(self._width, opponent)
        edges = self._all_edges()
        carried = self._carried(edges)
        shapes = [tuple(cells if k in one else 1 for one in carried) for k in range(len(edges))]
        needed = sum(math.prod(s) * (e.size - 1) for s, e in zip(shapes, edges, strict=True))
        if needed > MOST_CELLS:
            raise InvalidArgumentError(
                f"a proof must do with {MOST_CELLS:,} cells, got {needed:,}: the policy looks at "
                "too many opponents at once"
            )
        self.n_cells = needed
        self._unstopped: list[Floats] = []
        self._levels = [self._level(*one) for one in zip(edges, shapes, strict=True)]
        self._lines = [
            line_moves(edges[k], edges[k + 1], k, self._agent) for k in range(len(edges) - 1)
        ]

    def bounds(self, payoffs: Payoffs) -> tuple[float, float]:
        """Return bounds of the mean worth of an episode, over all starts and all noise."""
        steps = self._parameters.max_steps
        values = [self._at_the_end(level, payoffs) for level in self._levels]
        self._unstopped = [np.empty((0, 0))] * min(steps, len(values) - 1)
        for step in range(steps - 1, -1, -1):
            # After so many steps the agent has moved so many times at most.
            self._step_back(values[: step + 2], payoffs, judged=step > 0)
            if step < len(self._unstopped):
                self._unstopped[step] = self._by_place(step, values[step].low_mean)
        first = values[0]
        return float(first.low_mean.mean()), float(first.high_mean.mean())

    def least_by_place(self, opponent: int) -> Floats:
        """Return the least worth of an agent that has not stopped, of the last ``bounds``.

        A row for each number of steps, a column for each part of the opponent's path, whichever way
        it goes there: shape [K, cells / 2].
        """
        return np.array([rows[opponent] for rows in self._unstopped])

    def _by_place(self, k: int, field: Floats) -> Floats:
        """Return means over the agent's places, at each place of one opponent [n, cells / 2]."""
        edges = self._levels[k].edges
        weight = np.ones(1) if k == 0 else np.diff(self._agent.after(k).below(edges))
        mean = field @ (weight / weight.sum())
        found = []
        for axis, n in enumerate(mean.shape):
            others = tuple(i for i in range(mean.ndim) if i != axis)
            around = np.broadcast_to(mean.mean(axis=others), (self._cells,) if n == 1 else (n,))
            rising, falling = np.split(around, 2)
            found.append(np.minimum(rising, falling[::-1]))
        return np.array(found)

    def _all_edges(self) -> list[Floats]:
        """Return the edges of the cells of each level, up to one that is behind the goal."""
        goal = self._parameters.main_path_length
        thresholds = np.array([goal])
        if self._policy is not None:
            nodes = self._policy.tree.nodes
            thresholds = np.unique(np.append(thresholds, nodes.threshold[nodes.feature == 0]))
        found = [np.zeros(2)]
        rows = round(_INNER / self._spacing)
        spread = np.append(np.linspace(-_INNER, _INNER, 2 * rows + 1), [-REACH, REACH])
        while found[-1][0] < goal:
            there = self._agent.after(len(found))
            spots = there.center + there.deviation * np.sort(spread)
            inside = thresholds[(thresholds > spots[0]) & (thresholds < spots[-1])]
            near = np.abs(spots[:, None] - inside).min(axis=1, initial=np.inf)
            near[[0, -1]] = np.inf
            kept = spots[near > self._spacing / 4 * there.deviation]
            found.append(np.sort(np.concatenate([kept, inside])))
        return found

    def _carried(self, edges: Sequence[Floats]) -> list[range]:
        """Return the levels at which each opponent is carried."""
        goal = self._parameters.main_path_length
        reach = self._parameters.collision_distance
        found = []
        looked = [self._looked_at(one) for one in edges]
        for i, crossing in enumerate(self._parameters.crossing.tolist()):
            levels = [
                k
                for k, one in enumerate(edges)
                if min(one[0], goal) - reach <= crossing <= min(one[-1], goal) + reach
                or i in looked[k]
            ]
            first = 0 if self._policy is None and levels else min(levels, default=0)
            found.append(range(first, max(levels, default=-1) + 1))
        return found

    def _looked_at(self, edges: Floats) -> set[int]:
        """Return the opponents on which decisions at a level depend."""
        if self._policy is None:
            return set()
        nodes, actions = self._policy.tree.nodes, self._policy.actions
        goal = self._parameters.main_path_length

        def below(node: int, low: float, high: float) -> tuple[set[int], set[int]]:
            feature = int(nodes.feature[node])
            if feature < 0:
                return {int(actions[nodes.leaf[node]])}, set()
            sides = [int(nodes.left[node]), int(nodes.right[node])]
            if feature == 0:
                threshold = nodes.threshold[node]
                sides = (
                    [sides[0]] if high <= threshold else [sides[1]] if low >= threshold else sides
                )
            found = [below(side, low, high) for side in sides]
            chosen = set().union(*(one for one, _ in found))
            looked = set().union(*(one for _, one in found))
            if len(chosen) == 1:
                return chosen, set()
            opponent = {(feature - 1) % self._parameters.n_opponents} if feature > 0 else set()
            return chosen, looked | opponent

        pairs = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        return set().union(*(below(0, low, high)[1] for low, high in pairs if low < goal))

    def _level(self, edges: Floats, shape: tuple[int, ...]) -> _Level:
        middles = middle(edges[:-1], edges[1:])
        ended = edges[:-1] >= self._parameters.main_path_length
        kind = np.zeros(middles.size, dtype=np.int64)
        share = np.full((math.prod(shape), 1), -1.0)
        if self._policy is not None:
            nodes = self._policy.tree.nodes
            thresholds = np.unique(nodes.threshold[nodes.feature == 0])
            regions, kind = np.unique(np.searchsorted(thresholds, middles), return_inverse=True)
            share = np.empty((math.prod(shape), regions.size))
            for column in range(regions.size):
                row = int(np.flatnonzero(kind == column)[0])
                share[:, column] = self._shares(self._policy, edges[row : row + 2], shape)
        kind = np.where(ended, -1, kind).astype(np.int64)
        return _Level(edges, shape, kind, share, self._collisions(edges, shape))

    def _places(self) -> tuple[Floats, Floats, Floats]:
        """Return lower and upper bounds of an opponent's place in each cell, and its direction."""
        path, half = self._parameters.path_length, self._parameters.path_length / 2
        ends = self._width * np.arange(self._cells + 1)
        rising = np.arange(self._cells) < self._cells // 2
        low = np.where(rising, ends[:-1] - half, half - (ends[1:] - path))
        high = np.where(rising, ends[1:] - half, half - (ends[:-1] - path))
        return low, high, np.where(rising, 1.0, -1.0)

    def _shares(self, policy: TreePolicy, ends: Floats, shape: tuple[int, ...]) -> Floats:
        """Return the share of each cell in which the policy goes, shape [N]."""
        half = self._parameters.path_length / 2
        place_low, place_high, direction = self._places()
        index = np.indices(shape).reshape(len(shape), -1)
        low, high = ([np.full(index.shape[1], x)] for x in ends)
        all_ = np.ones(index.shape[1])
        for cell, n in zip(index, shape, strict=True):
            low.append(place_low[cell] if n > 1 else -half * all_)
            high.append(place_high[cell] if n > 1 else half * all_)
        if self._parameters.observe_direction:
            for cell, n in zip(index, shape, strict=True):
                low.append(direction[cell] if n > 1 else -all_)
                high.append(direction[cell] if n > 1 else all_)
        found = np.empty(index.shape[1])
        boxes = (np.stack(low, axis=1), np.stack(high, axis=1))
        nodes = ActingNodes(policy.tree.nodes, policy.actions)
        kernels.shares(nodes, _GO, *boxes, found)
        return found

    def _collisions(self, edges: Floats, shape: tuple[int, ...]) -> kernels.Ends | None:
        """Return which share of each cell is a collision."""
        low, high, _ = self._places()
        rows = edges.size - 1
        found = kernels.Ends(*(np.zeros((*shape, rows)) for _ in range(4)))
        k = round(edges.mean() / self._agent.center)
        for i, crossing in enumerate(self._parameters.crossing.tolist()):
            if shape[i] == 1:
                continue
            axes = [1] * len(shape)
            axes[i] = shape[i]
            for row in range(rows):
                weight, *chords = self._chords(edges[row], edges[row + 1], k, crossing)
                near, far = (
                    np.clip(np.minimum(high[:, None], c) - np.maximum(low[:, None], -c), 0, None)
                    / self._width
                    for c in chords
                )
                for out, share in (
                    (found.least, near @ weight), (found.least_place, near.min(axis=1)),
                ):  # fmt: skip
                    out[..., row] = np.maximum(out[..., row], share.reshape(axes))
                found.most[..., row] += (far @ weight).reshape(axes)
                found.most_place[..., row] += far.max(axis=1).reshape(axes)
        if not found.most_place.any():
            return None
        return kernels.Ends(*(np.minimum(one, 1.0).reshape(-1, rows) for one in found))

    def _chords(
        self, low: float, high: float, k: int, crossing: float
    ) -> tuple[Floats, Floats, Floats]:
        """Return the weights of slices of a row, and how near is surely and perhaps a collision."""
        ends = np.linspace(low, high, _SLICES + 1)
        weight = np.full(_SLICES, 1.0 / _SLICES)
        if high > low:
            weight = np.diff(self._agent.after(k).below(ends))
            weight = weight / weight.sum()
        off = np.abs(np.minimum(ends, self._parameters.main_path_length) - crossing)
        square = self._parameters.collision_square
        chord = np.sqrt(np.maximum(square - off * off, 0.0))
        chord[off * off > square] = -1.0
        near, far = np.minimum(chord[:-1], chord[1:]), np.maximum(chord[:-1], chord[1:])
        holds = (ends[:-1] <= crossing) & (crossing <= ends[1:])
        far = np.where(holds, math.sqrt(square), far)
        return weight, near, far

    def _at_the_end(self, level: _Level, payoffs: Payoffs) -> kernels.Values:
        """Return the values of a level at the time limit."""
        size = (math.prod(level.shape), level.kind.size)
        row = np.where(level.kind < 0, payoffs.goal, payoffs.late)
        values = kernels.Values(*(np.tile(row, (size[0], 1)) for _ in range(6)))
        if level.collisions is not None:
            kernels.end(level.collisions, payoffs.collision, values)
        return kernels.Values(*(one.reshape(*level.shape, size[1]) for one in values))

    def _step_back(self, values: list[kernels.Values], payoffs: Payoffs, *, judged: bool) -> None:
        """Replace the values of levels by those of one step earlier; the last is only read."""
        slack = (payoffs.high - payoffs.low) * (TAIL * self._parameters.n_opponents + _ROUNDING)
        limits = np.array([slack, payoffs.low, payoffs.high])
        here: _Ahead | None = None
        for k, level in enumerate(self._levels[: len(values) - 1]):
            stop = here or self._ahead(values[k])
            later = values[k + 1]
            shape = self._levels[k + 1].shape
            both = tuple(min(pair) for pair in zip(level.shape, shape, strict=True))
            moved = self._ahead(_summed_out(later, both))
            here = moved if both == shape else None
            go = _gone(moved, self._lines[k])
            staying = _stayed(stop, payoffs)
            wide = (*level.shape, level.kind.size)
            columns = [np.broadcast_to(one, wide).reshape(-1, wide[-1]) for one in go]
            flat = [one.reshape(-1, one.shape[-1]) for one in staying]
            out = kernels.Values(*(one.reshape(-1, one.shape[-1]) for one in values[k]))
            kernels.choose(
                kernels.Values(*flat),
                kernels.Values(*columns),
                level.share,
                level.kind,
                limits,
                out,
            )
            if judged and level.collisions is not None:
                kernels.end(level.collisions, payoffs.collision, out)

    def _ahead(self, values: kernels.Values) -> _Ahead:
        """Return values before all opponents' steps from those after them."""
        circle = self._circle
        mean, place = [values.low_mean, values.high_mean], [values.low_place, values.high_place]
        state, fixed = mean.copy(), place.copy()
        weight, width = values.high - values.low, values.high_place - values.low_place
        off = off_state = np.zeros_like(weight)
        weight_state, width_state = weight, width
        for axis, n in enumerate(weight.shape[:-1]):
            if n == 1:
                continue
            off = self._turn(axis, (off, circle.mean), (weight, circle.blur))
            off_state = self._turn(axis, (off_state, circle.most), (weight_state, circle.spread))
            weight = self._turn(axis, (weight, circle.mean))
            weight_state = self._turn(axis, (weight_state, circle.most))
            width = self._turn(axis, (width, circle.mean))
            width_state = self._turn(axis, (width_state, circle.most))
            mean = [self._turn(axis, (one, circle.mean)) for one in mean]
            place = [self._turn(axis, (one, circle.mean)) for one in place]
            state, fixed = (
                [
                    self._turn_bound(axis, one[0], circle.low, circle.high),
                    self._turn_bound(axis, one[1], circle.high, circle.low),
                ]
                for one in (state, fixed)
            )
        return _Ahead(mean, place, state, fixed, off, off_state, width, width_state)

    def _turn(self, axis: int, *parts: tuple[Floats, Floats]) -> Floats:
        out = np.zeros(parts[0][0].shape)
        for field, weights in parts:
            if field.any():
                kernels.turn(_around(field, axis), weights[0], self._first, _around(out, axis))
        return out

    def _turn_bound(self, axis: int, field: Floats, rising: Floats, falling: Floats) -> Floats:
        out = np.empty(field.shape)
        around = (_around(field, axis), rising[0], falling[0], self._first, _around(out, axis))
        kernels.turn_bound(*around)
        return out


def _around(field: Floats, axis: int) -> Floats:
    """Return a field as [before, circle, behind], a view."""
    shape = field.shape
    return field.reshape(math.prod(shape[:axis]), shape[axis], math.prod(shape[axis + 1 :]))


def _summed_out(values: kernels.Values, shape: tuple[int, ...]) -> kernels.Values:
    """Return the means of values over the opponents that are not carried in a shape."""
    axes = tuple(i for i, n in enumerate(shape) if n == 1 and values.low.shape[i] > 1)
    if not axes:
        return values
    return kernels.Values(*(one.mean(axis=axes, keepdims=True) for one in values))


def _stayed(ahead: _Ahead, payoffs: Payoffs) -> kernels.Values:
    """Return the values of stopping: the agent's place stays as it is."""
    found = []
    for pair, off in (
        (ahead.mean, ahead.off), (ahead.place, ahead.off), (ahead.fixed, ahead.off_state)
    ):  # fmt: skip
        found += [pair[0] - off + payoffs.stop, pair[1] + off + payoffs.stop]
    return kernels.Values(*found)


def _gone(ahead: _Ahead, moves: Moves) -> tuple[Floats, ...]:
    """Return the values of going, of the rows of the level before."""
    off = _weigh(ahead.off, moves.mean) + _weigh(ahead.width, moves.blur)
    found = [_weigh(ahead.mean[0], moves.mean) - off, _weigh(ahead.mean[1], moves.mean) + off]
    # With means over places, or without: better where a row is wide and its places differ.
    for means, single, off, width in (
        (ahead.mean, ahead.place, ahead.off, ahead.width),
        (ahead.state, ahead.fixed, ahead.off_state, ahead.width_state),
    ):
        near = _weigh(off, moves.most)
        far = near + _weigh(width, moves.spread)
        low = [_by_parts(one[0], moves.low, moves.high) for one in (means, single)]
        high = [_by_parts(one[1], moves.high, moves.low) for one in (means, single)]
        found.append(np.maximum(low[0] - far, low[1] - near))
        found.append(np.minimum(high[0] + far, high[1] + near))
    return tuple(found)


def _by_parts(field: Floats, rising: Floats, falling: Floats) -> Floats:
    """Return a bound of the expected values of rows after a step, wherever it begins in its row."""
    change = np.diff(field, axis=-1)
    found = _weigh(np.maximum(change, 0.0), rising[:, 1:])
    found += _weigh(np.minimum(change, 0.0), falling[:, 1:])
    found += field[..., :1]
    return found


def _weigh(field: Floats, weights: Floats) -> Floats:
    """Return the sums of a field's rows with the weights [I, J] of each row of the level before."""
    out = np.empty((*field.shape[:-1], weights.shape[0]))
    rows = (field.reshape(-1, field.shape[-1]), np.ascontiguousarray(weights))
    kernels.weigh(*rows, out.reshape(-1, out.shape[-1]))
    return out
