"""Where all starts lead: boxes carried forward, cut at their starts until each is decided.

A piece of the starts is carried as one box. While its box is in leaves of one action, it moves by
that action. Where the tree is of two minds in the box, or where the event has happened to a part
of it, the *starts* of the piece are cut in two and both halves begin again: their boxes are
smaller from the first step on. A piece that is small enough is not cut any further but follows
every action that is possible in it, so it is still true of each of its starts that the event
comes not before the earliest and not after the latest of these branches.
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.formulas import LARGEST_RATIO
from eutree.policies import TreePolicy
from eutree.policies.sklearn_tree import float64_thresholds
from eutree.proof import _kernels
from eutree.proof.certificate import NEVER, Pieces
from eutree.proof.intervals import (
    Affine,
    Doubt,
    Intervals,
    Truth,
    are_finite,
    clip,
    maximum,
    middle,
    minimum,
    quotient,
    rounded,
    unless,
    where,
)
from eutree.proof.plant import Plant, State, from_a_start
from eutree.trees.text import derived_features
from eutree.validation import check_amounts, check_integer, check_listed, check_number

MOST_ACTIONS = 64  # bits of a set of actions
_AT_ONCE = 1 << 14  # boxes that are moved together: their arrays stay in the cache
_LARGE = 2.0**-12  # share of all starts: a piece above it is cut in a disturbed plant, too
_MOST_BRANCHES = 8  # moments at which a piece may follow several actions, before it is given up


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How far a proof goes before it leaves a piece undecided.

    Attributes:
        smallest: Share of all starts below which a piece is not cut.
        box_steps: Steps of boxes in all; pieces not decided by then stay undecided.
        pieces: Decided pieces and branches in all: what is kept. Others then stay undecided.
        refinements: How many times finer than the plant's own a grid is, one after the other,
            until a property for ever is proven.
    """

    smallest: float = 2.0**-26
    box_steps: int = 300_000_000
    pieces: int = 1 << 20
    refinements: tuple[int, ...] = (1, 2)

    def __post_init__(self) -> None:
        check_number("smallest", self.smallest, low=0.0, high=1.0)
        check_amounts(self, box_steps=1, pieces=1)
        object.__setattr__(self, "refinements", check_listed("refinements", self.refinements))
        for finer in self.refinements:
            check_integer("each of refinements", finer, low=1)
        if not self.refinements:
            raise InvalidArgumentError("refinements must have at least one integer, got none")


class Acting:
    """A policy on boxes of states of a plant, which says how and how precisely it observes them.

    Raises:
        InvalidArgumentError: It has more than ``MOST_ACTIONS`` actions.
    """

    def __init__(self, policy: TreePolicy, plant: Plant) -> None:
        if policy.schema.n_actions > MOST_ACTIONS:
            raise InvalidArgumentError(
                f"a policy must have at most {MOST_ACTIONS} actions to be proven, got "
                f"{policy.schema.n_actions}"
            )
        nodes, derivation = policy.tree.nodes, policy.derivation
        asked = derived_features(policy.tree, policy.schema)
        self._formulas = {j: derivation.formulas[j - derivation.n_measured] for j in asked}
        self._n_features = policy.schema.n_features
        if np.dtype(plant.precision) == np.float32:
            # The tree sees single precision: rounding is monotone, so a test of the rounded value
            # is the test of the double itself at one other threshold. What is derived are doubles.
            measured = nodes.feature < derivation.n_measured
            threshold = np.where(measured, float64_thresholds(nodes.threshold), nodes.threshold)
            nodes = nodes._replace(threshold=threshold)
        self._nodes = _kernels.ActingNodes(nodes, policy.actions)
        self._plant, self.n_actions = plant, policy.schema.n_actions

    def __call__(self, state: State) -> Integers:
        """Return which actions are possible in boxes, a bit for each, the last the sign: [N]."""
        seen = [*map(Intervals.of, self._plant.observe(state))]
        if self._formulas:
            seen = [*seen, *self._derived(seen)]
        size = np.shape(state[0].low)
        low, high = (
            np.stack([np.broadcast_to(getattr(one, end), size) for one in seen], axis=1)
            for end in ("low", "high")
        )
        found = np.empty(size, dtype=np.uint64)
        _kernels.decide(self._nodes, low, high, found)
        return found.view(np.int64)

    def _derived(self, measured: State) -> list[Intervals]:
        """Return what is derived of the numbers that the tree sees of the measured ones."""
        known = [rounded(one, self._plant.precision) for one in measured]
        known += known[:1] * (self._n_features - len(known))  # no test asks for those left so
        for j, formula in self._formulas.items():  # none has a last(...): see Plant.check_fits
            known[j] = Intervals.of(formula.compute(known, known.__getitem__, _OPERATIONS))
        return known[len(measured) :]


def _ratio(one: Intervals, other: Intervals) -> Intervals:
    """Return quotients as formulas have them, whose value of nought by nought is known."""
    one, other = Intervals.of(one), Intervals.of(other)
    is_plain = type(one) is type(other) is Intervals
    found = quotient(one, other) if is_plain else one / other
    return clip(found, -LARGEST_RATIO, LARGEST_RATIO)


def _or_nan(operation: Callable[..., Any]) -> Callable[..., Any]:
    """Return an operation of which nothing is known where, by the bounds, it may give NaN."""

    def compute(*parts: Any) -> Any:
        found = operation(*parts)
        bounds = [Intervals(one.low, one.high) for one in map(Intervals.of, parts)]
        if not isinstance(found, Affine) or all(are_finite(one).all() for one in bounds):
            return found
        return unless(np.isnan(operation(*bounds).low), found)

    return compute


# Of formulas, on intervals.
_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "+": _or_nan(operator.add), "-": _or_nan(operator.sub), "*": _or_nan(operator.mul),
    "/": _or_nan(_ratio), "negative": operator.neg, "abs": lambda a: maximum(a, -a),
    "min": minimum, "max": maximum, "if": where,
    "<": lambda a, b: Intervals.of(a) < b, "<=": lambda a, b: Intervals.of(a) <= b,
    ">": lambda a, b: Intervals.of(a) > b, ">=": lambda a, b: Intervals.of(a) >= b,
    "and": operator.and_, "or": operator.or_, "number": np.float64,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Boxes on their way."""

    start_low: Floats  # [d, N]; lower bounds of the starts
    start_high: Floats  # [d, N]; upper bounds of the starts
    center: Floats  # [d, N]; where the middle of their starts is
    # Half of how it changes across them, along each number of the start that varies
    slope: Floats  # [d, k, N]
    error: Floats  # [d, N]; greatest deviation from that
    steps: Integers  # [N]; how many steps they have gone
    # Number of the piece of which a box is one branch of several; -1 where it is all
    owner: Integers  # [N]
    branches: Integers  # [N]; how often several actions were followed
    ended: Booleans  # [N]; whether episodes of a part of it may have ended without the event

    @classmethod
    def beginning(cls, low: Floats, high: Floats, varies: Booleans) -> "_Boxes":
        """Return boxes at their starts [d, N]; each number that varies is a variable."""
        zeros = np.zeros(low.shape[1], dtype=np.int64)
        center = middle(low, high)
        radius = np.maximum(high - center, center - low)
        slope = np.eye(len(low))[:, varies, None] * radius[:, None]
        error = np.where(radius > 0, 2.0**-51 * (np.abs(center) + radius), 0.0)
        return cls(low, high, center, slope, error, zeros, zeros - 1, zeros, zeros > 0)

    @classmethod
    def joined(cls, parts: Sequence["_Boxes"]) -> "_Boxes":
        columns = (np.concatenate([getattr(p, f.name) for p in parts], -1) for f in fields(cls))
        return cls(*columns)

    def __len__(self) -> int:
        return int(self.steps.size)

    def __getitem__(self, chosen: Booleans | slice) -> "_Boxes":
        return _Boxes(*(getattr(self, f.name)[..., chosen] for f in fields(self)))

    def at(self, state: State) -> "_Boxes":
        """Return the boxes one step later, in a state."""
        if not all(isinstance(one, Affine) for one in state):
            state = [*map(self.state()[0].like, state)]
        center, slope, error = (
            np.stack([getattr(one, name) for one in state]) for name in ("center", "slope", "error")
        )
        return replace(self, center=center, slope=slope, error=error, steps=self.steps + 1)

    def state(self, side: int = -1) -> list[Affine]:
        """Return the state, for a step that notes its doubts, or assumes a side of its jumps."""
        doubt = Doubt(np.zeros_like(self.steps), np.full_like(self.steps, side))
        columns = zip(self.center, self.slope, self.error, strict=True)
        return [Affine(*column, doubt) for column in columns]


class Reach:
    """When an event happens, within a number of steps, from each start of a plant.

    ``event`` says whether it has happened in states, ``is_over`` whether an episode has ended in
    them without it.
    """

    def __init__(
        self,
        acting: Acting,
        plant: Plant,
        event: Callable[[State], Truth],
        is_over: Callable[[State], Truth],
        *,
        horizon: int,
        effort: Effort,
    ) -> None:
        self._acting, self._plant, self._event = acting, plant, event
        self._horizon, self._is_over, self._effort = horizon, is_over, effort
        start = np.array(plant.start, dtype=np.float64)  # [d, 2]
        self._width = start[:, 1] - start[:, 0]
        self._varies = self._width > 0
        made = from_a_start(plant, acting.n_actions)
        wide = [one.high - one.low > 1e-6 * (1.0 + np.abs(one.low)) for one in made]  # disturbed
        self._large = _LARGE if np.any(wide) else 0.0
        self._waiting = [_Boxes.beginning(start[:, :1], start[:, 1:], self._varies)]
        self._found: list[tuple[Floats, Floats, Integers, Integers, Integers, Integers]] = []
        self._kept = self._owners = 0
        self.box_steps = 0

    def pieces(self) -> Pieces:
        """Return the pieces of the starts, and when the event happens to each."""
        with np.errstate(all="ignore"):  # a number without bounds is NaN, and then nothing is sure
            self._carry(self._waiting.pop())
        return self._joined()

    def _carry(self, boxes: _Boxes) -> None:
        while len(boxes):
            if self.box_steps > self._effort.box_steps or self._kept >= self._effort.pieces:
                self._give_up(boxes)
                boxes = boxes[:0]
            else:
                boxes = self._moved(self._decided(boxes))
            if len(boxes) < _AT_ONCE // 2 and self._waiting:
                boxes = self._next(boxes)

    def _next(self, boxes: _Boxes) -> _Boxes:
        """Return boxes together with some of those that wait."""
        parts, room = [boxes], _AT_ONCE - len(boxes)
        while self._waiting and room > 0:
            part = self._waiting.pop()
            if len(part) > room:
                self._waiting.append(part[room:])
            parts.append(part[:room])
            room -= len(parts[-1])
        return _Boxes.joined(parts)

    def _decided(self, boxes: _Boxes) -> tuple[_Boxes, Integers]:
        """Return boxes and the one action that is taken in each; others are cut, or branch."""
        possible = self._acting(boxes.state())
        several = (possible & (possible - 1)) != 0
        if not several.any():
            return boxes, first_action(possible)
        cut = several & self._is_wide(boxes)
        self._cut(boxes[cut])
        lost = several & ~cut & (boxes.branches >= _MOST_BRANCHES)
        self._give_up(boxes[lost])
        parts, actions = [boxes[~several]], [first_action(possible[~several])]
        branching = several & ~cut & ~lost
        small, sets = self._owned(boxes[branching]), possible[branching]
        for bit in range(self._acting.n_actions):
            takes = (sets >> bit) & 1 == 1
            parts.append(small[takes])
            actions.append(np.full(int(takes.sum()), bit))
        return _Boxes.joined(parts), np.concatenate(actions)

    def _owned(self, boxes: _Boxes) -> _Boxes:
        """Return boxes with the number of the piece whose branches they are now."""
        fresh = boxes.owner < 0
        owner = np.where(fresh, self._owners + np.cumsum(fresh) - 1, boxes.owner)
        self._owners += int(fresh.sum())
        return replace(boxes, owner=owner, branches=boxes.branches + 1)

    def _moved(self, chosen: tuple[_Boxes, Integers]) -> _Boxes:
        """Return the boxes that are still on their way one step later."""
        boxes, action = chosen
        if not len(boxes):
            return boxes
        boxes, state = self._stepped(boxes, action)
        event = self._event(state)
        over = event.surely & ~boxes.ended
        self._keep(boxes[over], boxes.steps[over], boxes.steps[over])
        perhaps = event.maybe & ~over
        ends = self._is_over(state)
        safe = ends.surely & ~event.maybe
        boxes, over = replace(boxes, ended=boxes.ended | ends.maybe), over | safe
        self._keep_never(boxes[safe])
        if perhaps.any():
            cut = perhaps & self._is_wide(boxes)
            self._cut(boxes[cut])
            boxes = self._marked(boxes, perhaps & ~cut)
            over = over | cut
        late = ~over & (boxes.steps >= self._horizon)
        self._keep_never(boxes[late])
        return boxes[~(over | late)]

    def _stepped(self, boxes: _Boxes, action: Integers) -> tuple[_Boxes, State]:
        """Return boxes and their state one step later.

        Boxes that straddle a jump of the plant are cut too, or followed on both sides; those that
        straddle two jumps in one step are left as wide as both make them.
        """
        self.box_steps += len(boxes)
        state = boxes.state()
        later = boxes.at(self._plant.step(state, action))
        unsure = state[0].doubt.unsure > 0
        if not unsure.any():
            return later, later.state()
        wide = unsure & self._is_wide(boxes)
        self._cut(boxes[wide])
        once = ~wide & (state[0].doubt.unsure == 1)
        small = self._owned(boxes[once])
        parts = [later[~wide & ~once]]
        for side in (0, 1):
            parts.append(small.at(self._plant.step(small.state(side), action[once])))
        later = _Boxes.joined(parts)
        return later, later.state()

    def _marked(self, boxes: _Boxes, small: Booleans) -> _Boxes:
        """Note that the event may have happened to small pieces; they go on, for it may not."""
        owned = self._owned(boxes[small])
        self._keep(owned, owned.steps, owned.steps)
        owner = boxes.owner.copy()
        owner[small] = owned.owner
        return replace(boxes, owner=owner)

    def _is_wide(self, boxes: _Boxes) -> Booleans:
        """Return which pieces may be cut: they are wide enough, and have not branched.

        In a disturbed plant also: they are large, or the start still tells where they go. Boxes of
        halves are as wide where it does not, and as undecided.
        """
        widest, root = self._widths(boxes).max(axis=0), 1.0 / max(self._varies.sum(), 1)
        wide, large = (widest > share**root for share in (self._effort.smallest, self._large))
        tells = (np.abs(boxes.slope).sum(axis=1) > boxes.error / 8).any(axis=0)
        return np.asarray(wide & (large | tells) & (boxes.owner < 0))

    def _widths(self, boxes: _Boxes) -> Floats:
        """Return shares of all starts along each number [d, N]; 0 where no double is between."""
        low, high = boxes.start_low, boxes.start_high
        center = middle(low, high)
        return np.where((low < center) & (center < high), (high - low) / self._width[:, None], 0.0)

    def _cut(self, boxes: _Boxes) -> None:
        """Let both halves of pieces begin again, cut across their widest number."""
        if not len(boxes):
            return
        at = self._widths(boxes).argmax(axis=0), np.arange(len(boxes))
        low, high = boxes.start_low.copy(), boxes.start_high.copy()
        high[at] = low[at] = middle(low[at], high[at])
        lows, highs = np.hstack([boxes.start_low, low]), np.hstack([high, boxes.start_high])
        self._waiting.append(_Boxes.beginning(lows, highs, self._varies))

    def _give_up(self, boxes: _Boxes) -> None:
        """Note that the event may happen to pieces from the next step on, or never."""
        self._keep(boxes, boxes.steps + 1, np.full(len(boxes), NEVER))

    def _keep_never(self, boxes: _Boxes) -> None:
        self._keep(boxes, *[np.full(len(boxes), NEVER)] * 2)

    def _keep(self, boxes: _Boxes, first: Integers, last: Integers) -> None:
        if len(boxes):
            self._kept += len(boxes)
            least = np.where(last == NEVER, self._shortest(boxes), first)
            self._found.append((boxes.start_low, boxes.start_high, boxes.owner, first, last, least))

    def _shortest(self, boxes: _Boxes) -> Integers:
        """Return how many steps episodes take at least that may have ended without the event.

        Where one has and the plant does not say so, every action leaves the state as it is: none
        has where an action moves it.
        """
        moves, before = np.zeros(len(boxes), dtype=bool), boxes.state()
        if self._plant.reward is not None:  # else nobody asks
            for k in range(self._acting.n_actions):
                later = self._plant.step(before, np.full(len(boxes), k))
                for one, other in zip(later, before, strict=True):
                    moves |= ~(one - other == 0.0).maybe
        return np.where(moves & ~boxes.ended, boxes.steps + 1, 1)

    def _joined(self) -> Pieces:
        """Return the decided pieces, the branches of each piece together."""
        columns = zip(*self._found, strict=True)
        low, high, owners, first, last, least = (np.concatenate(column, -1) for column in columns)
        n = len(owners)
        group = np.where(owners < 0, np.arange(n), n + owners)  # those alone come first
        _, kept, group = np.unique(group, return_index=True, return_inverse=True)
        (earliest, shortest), latest = np.full((2, len(kept)), NEVER), np.zeros_like(kept)
        np.minimum.at(earliest, group, first)
        np.minimum.at(shortest, group, least)
        np.maximum.at(latest, group, last)
        return Pieces(self._plant.state, low.T[kept], high.T[kept], earliest, latest, shortest)


def first_action(possible: Integers) -> Integers:
    """Return the first action of each set: so many bits are 0 below the lowest that is 1."""
    found: Integers = np.bitwise_count(~possible & (possible - 1)).astype(np.int64)
    return found
