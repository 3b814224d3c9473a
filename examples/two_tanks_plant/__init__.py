"""The plant of two tanks in series, ``examples/two_tanks.py``: do they ever run over?

What holds for ever is found by following boxes from all starts, cell by cell, until nothing new is
reached (``_kernels.py`` beside). Demand and set point may be anything in their ranges
at every step. Where that fails, a search plays the tanks against the policy: it keeps, for each
coarse cell, the states that come nearest to running over, and a run that it finds is replayed in
the real environment with those demands and set points in place of the ones that are drawn.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.inspection import Region
from eutree.policies import TreePolicy
from eutree.proof import Certificate, Intervals, Picture, Plant, Starts, clip, minimum, sqrt
from eutree.proof.certificate import (
    CELLS,
    EMPTY,
    FAILS,
    KNOWN,
    OPEN,
    PROOF,
    PROVEN,
    REFUTED,
    UNDECIDED,
)
from eutree.proof.plant import State, own_arguments
from eutree.proof.properties import EVER, EpisodeProperty
from eutree.schema import EnvironmentSpec
from eutree.trees.boxes import leaf_boxes

from . import _kernels as kernels

PUMP, VALVE, LAG = 0.012, 0.010, 0.35
STEP, HEIGHT = kernels.STEP, kernels.HEIGHT
DEMAND, TARGET = (0.002, 0.008), (0.6, 1.4)
_NUMBERS = ("upper_level", "lower_level", "pump", "valve", "deviation")
_STORED, _LAG, _PUMPS, _PARTS = 0.15, 0.05, 3, 32  # width of cells, number of the pump's, parts
_MOST = 600_000  # steps of boxes
_SAID = {
    KNOWN: "White: never reached.",
    OPEN: "White: not reached so far; black: the box in which it may break.",
    FAILS: "White: not reached so far; red: the run that breaks it.",
}


class TwoTanks(Plant):
    """A pump fills the upper tank, a valve lets water from there into the lower one."""

    state = _NUMBERS
    start = ((0.6, 1.4), (0.4, 1.2), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    question = f"stays in upper_level < {HEIGHT:g} and lower_level < {HEIGHT:g} for ever"

    def __init__(self, spec: EnvironmentSpec) -> None:
        own_arguments(spec, {}, None)
        self.environment = spec

    def step(self, state: State, action: Integers) -> State:
        """Set pump and valve, and let five seconds pass."""
        on, opened = np.divmod(action, 2)
        upper, lower, pump, valve, deviation = state
        pump = pump + LAG * (on - pump)
        valve = valve + LAG * (opened - valve)
        demand, target = _anything(DEMAND, on), _anything(TARGET, on)
        between = VALVE * valve * sqrt(upper)
        taken = minimum(demand, lower / STEP)
        upper = clip(upper + STEP * (PUMP * pump - between), 0.0, HEIGHT)
        lower = clip(lower + STEP * (between - taken), 0.0, HEIGHT)
        return [upper, lower, pump, valve, deviation + 0.1 * (lower - target - deviation)]

    def observe(self, state: State) -> State:
        """Return what is known of the features: rates, which are of the last step, are not."""
        upper, lower, pump, valve, deviation = state
        target, rate = _anything(TARGET, pump.low), _anything((-np.inf, np.inf), pump.low)
        return [upper, lower, pump, valve, target, rate, rate, deviation]

    def put(self, env: gymnasium.Env[Any, Any], point: Floats) -> Any:
        """Fill the real tanks."""
        env.reset(seed=0)
        real: Any = env.unwrapped
        real._levels = point[:2].copy()
        real._pump, real._valve, real._deviation = point[2:].tolist()
        return real._observation()

    def state_of(self, env: gymnasium.Env[Any, Any]) -> Floats:
        """Return the state of the real tanks."""
        real: Any = env.unwrapped
        return np.array([*real._levels, real._pump, real._valve, real._deviation])

    def certify(
        self, policy: TreePolicy, asked: EpisodeProperty, refinements: Sequence[int]
    ) -> Certificate | None:
        """Return whether no tank ever runs over; None for a number of steps."""
        if asked.kind != "stays" or asked.region is None or asked.horizon not in (None, EVER):
            return None
        limits = _limits(asked.region)
        flood = Flood(policy, limits)
        every = f"from every start of {self.environment} it {asked.text}"
        if flood.is_closed:
            pictures = (flood.picture(None, KNOWN),)
            return Certificate(every, PROOF, PROVEN, pictures=pictures, work=flood.work)
        found = _played(self, policy, limits)
        if found is not None:
            run = found.pop("states")
            starts = Starts(_NUMBERS, run, run)
            words = f"it is not true that {every}: after {found['steps']} steps of the demands "
            words += f"and set points that are given, {found['runs_over']} is too high"
            return Certificate(
                words, PROOF, REFUTED, counterexample=found, starts=starts,
                pictures=(flood.picture(starts, FAILS),), work=flood.work,
            )  # fmt: skip
        box = ", ".join(
            f"{name} from {low:.4g} to {high:.4g}" for name, (low, high) in flood.open_box.items()
        )
        words = f"whether {every} is open: it may break in the box of {box}"
        ends = np.array(list(flood.open_box.values()))
        starts = Starts(_NUMBERS, ends[None, :, 0], ends[None, :, 1])
        return Certificate(
            words, PROOF, UNDECIDED, undecided=1.0, starts=starts,
            pictures=(flood.picture(starts, OPEN),), work=flood.work,
        )  # fmt: skip


class Flood:
    """All that is reached from the starts, in boxes.

    Args:
        policy: The policy.
        limits: What both levels must stay below, shape [2].

    Attributes:
        is_closed: Whether no step leads out of what is reached, and all of it is below the limits.
        open_box: A box from which a limit may be broken; empty where none is.
        work: What it took.
    """

    def __init__(self, policy: TreePolicy, limits: Floats) -> None:
        low, high = leaf_boxes(policy.tree)
        leaves = kernels.Leaves(low, high, np.asarray(policy.actions, dtype=np.int64))
        self._cells = _cells()
        n, d = int(np.prod(self._cells.counts)) * kernels.N_ACTIONS, kernels.N_NUMBERS
        hull = np.zeros((n, d, 2), dtype=np.uint16)
        hull[:, :, 0] = 65535
        self._reached = kernels.Reached(
            hull, np.zeros(n, dtype=bool), np.empty(n + 1, dtype=np.int64), np.zeros(2, np.int64)
        )
        self._begin(leaves)
        node = kernels.flood(leaves, self._cells, self._reached, np.array(TARGET), limits, _MOST)
        taken, put = self._reached.ends.tolist()
        self.is_closed = node < 0 and taken == put
        self.open_box = {} if self.is_closed else self._box(node if node >= 0 else self._next())
        nodes = int((hull[:, 0, 1] > 0).sum())
        self.work = {"cells": float(nodes), "box_steps": float(taken)}

    def _begin(self, leaves: kernels.Leaves) -> None:
        """Put the starts in: nothing flows, rates and the deviation are 0."""
        d = kernels.N_NUMBERS
        box, seen = np.tile([-9.0, 9.0], d), np.zeros(2 * kernels.N_FEATURES)
        (box[kernels.PUMP : kernels.PUMP + 2], box[kernels.VALVE : kernels.VALVE + 2]) = 0.0, 0.0
        box[kernels.DEVIATION : kernels.DEVIATION + 2] = 0.0
        seen[:4], seen[8:10] = np.array(TwoTanks.start[:2]).ravel(), TARGET
        kernels.agree(box, seen)
        nothing = np.zeros(6)
        flow = kernels.Flow(box, nothing, np.zeros(2), 0, 0)
        room = kernels.Room(np.empty(2 * d), np.empty(2 * d), np.empty(16),
                            np.empty((3, d), dtype=np.int64))  # fmt: skip
        kernels.spread(leaves, self._cells, flow, self._reached, room, box, seen, True)

    def holds(self, state: Floats, action: int) -> bool:
        """Return whether a state [5], with the action that is taken next, is reached."""
        box = _numbers(state)
        cells, count = self._cells, self._cells.counts
        edges = [cells.edges[j, : count[j] * cells.parts[j] + 1] for j in range(box.size)]
        near = []
        for edge, value in zip(edges, box.tolist(), strict=True):
            first = np.searchsorted(edge, value - 1e-11, side="right") - 1
            last = np.searchsorted(edge, value + 1e-11, side="left") - 1
            near.append(np.clip([first, last], 0, edge.size - 2).tolist())
        for place in itertools.product(*map(set, near)):
            at = np.array(place)
            cell = np.ravel_multi_index(tuple(at // cells.parts), tuple(count))
            hull = self._reached.hull[cell * kernels.N_ACTIONS + action].astype(int)
            part = at % cells.parts
            if (hull[:, 0] <= part).all() and (part < hull[:, 1]).all():
                return True
        return False

    def picture(self, starts: Starts | None, mark: int) -> Picture:
        """Return the levels that are reached, those at the start dark, and some states marked."""
        reached = np.zeros((CELLS, CELLS), dtype=bool)
        kernels.shadow(self._cells, self._reached.hull, reached)
        values, marks = np.zeros(reached.shape), np.where(reached, KNOWN, EMPTY)
        rooms = [(np.array(TwoTanks.start)[None, :2], KNOWN)]
        if starts is not None:
            rooms.append((np.stack([starts.low, starts.high], axis=2)[:, :2], mark))
        for boxes, kind in rooms:
            for box in (boxes / HEIGHT * CELLS).astype(int):
                room = tuple(slice(low, high + 1) for low, high in box.tolist())
                values[room], marks[room] = 1.0, kind
        return Picture(
            "Both levels",
            _NUMBERS[:2],
            (0.0, 0.0),
            (HEIGHT, HEIGHT),
            values,
            marks,
            f"Dark: the starts; light: what may be reached. {_SAID[mark]}",
        )

    def _next(self) -> int:
        return int(self._reached.queue[self._reached.ends[0] % self._reached.queue.size])

    def _box(self, node: int) -> dict[str, tuple[float, float]]:
        """Return bounds of what a tank's engineer would measure in the box of a node."""
        place = np.unravel_index(node // kernels.N_ACTIONS, tuple(self._cells.counts))
        begin = np.array(place) * self._cells.parts
        ends = begin[:, None] + self._reached.hull[node].astype(int)
        box = np.array([self._cells.edges[j][end] for j, end in enumerate(ends)]).ravel()
        seen = np.tile([-99.0, 99.0], kernels.N_FEATURES)
        kernels.agree(box, seen)
        found = {"upper_level": (seen[0], seen[1]), "lower_level": (seen[2], seen[3])}
        for name, k in zip(_NUMBERS[2:], (4, 6, 14), strict=True):
            found[name] = seen[k], seen[k + 1]
        return {name: (float(low), float(high)) for name, (low, high) in found.items()}


def _numbers(state: Floats) -> Floats:
    """Return the numbers by which boxes are known, of one state [5], shape [d]."""
    upper, lower, pump, valve, deviation = state
    mass = upper + lower + kernels.RUN_DOWN * pump
    weighed = [
        (1 - share) * (lower + kernels.STILL_LET * valve) + share * mass for share in kernels.SHARES
    ]
    stored = upper + kernels.RUN_DOWN * pump - kernels.CREDIT * valve
    return np.array([stored, lower - deviation, deviation, pump, valve, lower, mass, *weighed])


def _cells() -> kernels.CellCuts:
    """Return the cells; their ranges hold every state whose levels are in the tanks."""
    valve = [1.0]
    while valve[-1] > 0.12:  # a shut valve leaves each cell for another one, in so many steps
        valve.append(valve[-1] * (1.0 - LAG) + 1e-9)
    valve[-1] = 0.0
    cuts = [
        (_steps(-0.15, 2.25, _STORED), _PARTS), (_steps(0.2, 2.05, _LAG), 32),
        (_steps(-1.4, 1.4, _LAG), 16), (np.linspace(0.0, 1.0, _PUMPS + 1), 8),
        (np.array(valve[::-1]), 8), (np.array([0.0, HEIGHT]), 1024), (np.array([-0.2, 4.3]), 1024),
        *[(np.array([-0.2, 3.5]), 1024) for _ in kernels.SHARES],
    ]  # fmt: skip
    lines = [
        np.interp(np.arange((edges.size - 1) * n + 1) / n, np.arange(edges.size), edges)
        for edges, n in cuts
    ]
    table = np.zeros((len(lines), max(line.size for line in lines)))
    for row, line in zip(table, lines, strict=True):
        row[: line.size] = line
    count = np.array([edges.size - 1 for edges, _ in cuts])
    return kernels.CellCuts(count, np.array([n for _, n in cuts]), table)


def _steps(low: float, high: float, width: float) -> Floats:
    return np.linspace(low, high, round((high - low) / width) + 1)


def _anything(ends: tuple[float, float], like: Any) -> Intervals:
    return Intervals.between(*(np.full(np.shape(like), end) for end in ends))


def _limits(region: Region) -> Floats:
    """Return the bounds of both levels.

    Raises:
        InvalidArgumentError: The region bounds anything else, or a start is not in it.
    """
    low, high = np.asarray(region.low), np.asarray(region.high)
    if (low > -np.inf).any() or (high[2:] < np.inf).any():
        raise InvalidArgumentError(
            "a property of two tanks for ever must be about how high upper_level and lower_level "
            f"may rise, as in {TwoTanks.question!r}"
        )
    begins = np.array(TwoTanks.start)[:2, 1]
    if (high[:2] <= begins).any():
        raise InvalidArgumentError(
            f"a property of two tanks must allow the levels at which episodes begin, up to "
            f"{begins.tolist()}, got {high[:2].tolist()}"
        )
    # A level that has reached the brim has perhaps run over: the limit is below it at most.
    return np.minimum(high[:2], np.nextafter(HEIGHT, 0.0))


class ScriptedDraws:
    """What the real tanks draw, written down in advance: demands and set points."""

    def __init__(self, real: Any, script: Floats) -> None:
        self._real, self._steps = real, iter(script.tolist())
        self._target = 0.0

    def standard_normal(self) -> float:
        """Return the change that leads to the next demand."""
        self._target, demand = next(self._steps)
        return float((demand - self._real._demand) / 0.0006)

    def random(self) -> float:
        """Let the set point change."""
        return 0.0

    def uniform(self, low: float, high: float) -> float:
        """Return the next set point."""
        return min(max(self._target, low), high)


def rerun(
    plant: TwoTanks, policy: TreePolicy, start: Floats, script: Floats
) -> Iterator[tuple[Floats, int]]:
    """Yield states of the real tanks under given draws, and the action that is taken in each.

    Args:
        plant: Makes the environment.
        policy: The policy.
        start: Levels and set point to begin with, shape [3].
        script: Set point and demand of each step, shape [T, 2].
    """
    env = plant.make()
    plant.put(env, np.array([*start[:2], 0.0, 0.0, 0.0]))
    real: Any = env.unwrapped
    real._target = float(start[2])
    real.np_random = ScriptedDraws(real, script)
    observation = real._observation()
    for _ in range(len(script)):
        action = policy.act(np.asarray(observation, dtype=np.float64).tolist())
        yield plant.state_of(env), action
        observation = real.step(action)[0]
    yield plant.state_of(env), policy.act(np.asarray(observation, dtype=np.float64).tolist())
    env.close()


def _played(plant: TwoTanks, policy: TreePolicy, limits: Floats) -> dict[str, Any] | None:
    """Return a real run that breaks a limit; None if the search finds none."""
    for tank in np.flatnonzero(np.isfinite(limits)).tolist():
        found = Search(policy, tank).run(float(limits[tank]))
        if found is None:
            continue
        start, script = found
        states = np.array([state for state, _ in rerun(plant, policy, start, script)])
        broken = np.flatnonzero(states[:, tank] > limits[tank])
        if broken.size:
            steps = int(broken[0])
            named = zip(("upper_level", "lower_level", "set_point"), start.tolist(), strict=True)
            return {
                **dict(named), "steps": steps, "runs_over": _NUMBERS[tank],
                "set_points": script[:steps, 0].tolist(), "demands": script[:steps, 1].tolist(),
                "states": states[: steps + 1],
            }  # fmt: skip
    return None


class Search:
    """A search for demands and set points under which a tank runs over.

    Args:
        policy: The policy.
        tank: 0 for the upper, 1 for the lower one.
        seed: Of all chance.
    """

    STATES, TRIES, STEPS = 12_000, 6, 120

    def __init__(self, policy: TreePolicy, tank: int, seed: int = 0) -> None:
        self._policy, self._tank = policy, tank
        self._generator = np.random.default_rng(seed)

    def run(self, limit: float) -> tuple[Floats, Floats] | None:
        """Return a start and a script that break a limit; None if none was found."""
        draw, n = self._generator, self.STATES
        rows = np.zeros((n, 8))
        rows[:, 0], rows[:, 1] = draw.uniform(0.6, 1.4, n), draw.uniform(0.4, 1.2, n)
        rows[:, 4] = draw.uniform(*TARGET, n)
        first = rows[:, [0, 1, 4]]
        past: list[tuple[Integers, Floats, Floats]] = []
        for _ in range(self.STEPS):
            parent = np.repeat(np.arange(len(rows)), self.TRIES)
            target, demand = self._drawn(rows[parent, 4])
            later, highest = _moved(self._policy, rows[parent], target, demand)
            worst = int(highest[:, self._tank].argmax())
            if highest[worst, self._tank] > limit + 1e-9:
                script, row = [(target[worst], demand[worst])], parent[worst]
                for parents, targets, demands in past[::-1]:
                    script.append((targets[row], demands[row]))
                    row = parents[row]
                return first[row], np.array(script[::-1])
            kept = self._kept(later)
            past.append((parent[kept], target[kept], demand[kept]))
            rows = later[kept]
        return None

    def _drawn(self, before: Floats) -> tuple[Floats, Floats]:
        """Return set points and demands, most of them at the ends of their ranges."""
        draw, n = self._generator, before.size
        ends, any_ = np.array(TARGET), draw.uniform(*TARGET, n)
        kind = draw.random(n)
        target = np.select([kind < 0.3, kind < 0.6, kind < 0.75], [ends[1], ends[0], before], any_)
        kind = draw.random(n)
        demand = np.select([kind < 0.6, kind < 0.8], [*DEMAND], draw.uniform(*DEMAND, n))
        return target, demand

    def _kept(self, rows: Floats) -> Integers:
        """Return the rows of which each coarse cell has few that come nearer to running over."""
        upper, lower, pump, valve = rows[:, :4].T
        near = lower + 0.08 * valve + 0.4 * upper
        if self._tank == 0:
            near = upper + kernels.RUN_DOWN * pump - kernels.CREDIT * valve
        coarse = rows[:, [7, 1 - self._tank, 3, 2]] / np.array([0.03, 0.1, 0.1, 0.15])
        cell = np.floor(coarse).astype(np.int64) @ np.array([10**9, 10**6, 10**3, 1])
        order = np.lexsort((-near, cell))
        rank = np.arange(cell.size) - np.searchsorted(cell[order], cell[order])
        kept = order[rank < 3]
        wanted = near[kept] + self._generator.normal(0.0, 0.1, kept.size)
        best: Integers = kept[np.argsort(-wanted)[: self.STATES]]
        return best


def _moved(
    policy: TreePolicy, rows: Floats, target: Floats, demand: Floats
) -> tuple[Floats, Floats]:
    """Return observations [N, 8] one step later, and both levels before what is above is lost."""
    on, opened = np.divmod(policy.predict(rows)[0], 2)
    later = rows.copy()
    later[:, 2] += LAG * (on - rows[:, 2])
    later[:, 3] += LAG * (opened - rows[:, 3])
    between = VALVE * later[:, 3] * np.sqrt(np.maximum(rows[:, 0], 0.0))
    taken = np.minimum(demand, rows[:, 1] / STEP)
    change = np.stack([PUMP * later[:, 2] - between, between - taken], axis=1)
    highest = rows[:, :2] + STEP * change
    later[:, :2] = np.clip(highest, 0.0, HEIGHT)
    later[:, 5:7] = 1000.0 * (later[:, :2] - rows[:, :2]) / STEP
    later[:, 4] = target
    later[:, 7] += 0.1 * (later[:, 1] - target - rows[:, 7])
    return later, highest
