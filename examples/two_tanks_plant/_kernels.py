"""Compiled loops that follow boxes of two tanks for ever.

A box of states is bounds of numbers, two for each: the lower one at ``box[J]``, the upper one at
``box[J + 1]``, with J one of the names below. Several of them say the same in other words. Each is
a sum that the water itself keeps from rising or that follows the others without a detour, so that
bounds of it do not creep outward from cell to cell:

* ``STORED``: upper level, and what the pump still brings and the open valve still takes when both
  are off, at the flow of a level of ``BALANCE``. It never rises while both are off above that.
* ``BEHIND``: lower level minus deviation: where the average of the deviation lags to.
* ``MASS``: the water of both tanks, and what the pump still brings; only the pump adds to it.
* ``WEIGHED``: ``SHARES`` of the mass, the rest of the lower level with what the valve still brings.

``_SLACK`` is more than all roundings of a step, of the program and of these loops: numbers are
below 10 and formulas have two dozen operations, so those are below 1e-13. The features that a tree
sees are bounds in the same way, at ``seen[2 j]`` and ``seen[2 j + 1]``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Integers
from eutree.compiled import compiled

STORED, BEHIND, DEVIATION, PUMP, VALVE, LOWER, MASS, WEIGHED = range(0, 16, 2)
SHARES = (0.0, 0.25, 0.5)
N_NUMBERS = WEIGHED // 2 + len(SHARES)
N_FEATURES, N_ACTIONS = 8, 4
STEP, LAG, HEIGHT = 5.0, 0.35, 2.0  # s, share of the way an actuator moves in a step, m
PUMPED = STEP * 0.012  # m that the pump brings in a step at full speed
LET = STEP * 0.010  # m that the open valve lets through in a step at a level of 1 m
BALANCE, USUAL = 1.5**0.5, 1.45**0.5  # roots of levels for which flows are credited
_LEFT = (1.0 - LAG) / LAG  # steps at full speed that an actuator still runs when it is off
RUN_DOWN, CREDIT, STILL_LET = PUMPED * _LEFT, LET * BALANCE * _LEFT, LET * USUAL * _LEFT
DEMAND = (STEP * 0.002, STEP * 0.008)  # m in a step
_SLACK = 1e-12
_RATE = 1000.0 / STEP  # mm/s for a metre in a step
_RATE_SLACK = 1e-6
_SHARES = np.array(SHARES)


class Leaves(NamedTuple):
    """A tree as the boxes of its leaves."""

    low: Floats  # [L, 8]
    high: Floats  # [L, 8]
    action: Integers  # [L]


class CellCuts(NamedTuple):
    """How each number is cut: into cells, and these into parts to which hulls are rounded."""

    counts: Integers  # [d] cells; 1 where only the hull is kept
    parts: Integers  # [d] of each cell
    edges: Floats  # [d, most] of all parts, in order


class Reached(NamedTuple):
    """What is reached: for each cell and action that is taken next, the hull of its states."""

    # First part and the one after the last; none: 65535 and 0.
    hull: NDArray[np.uint16]  # [nodes, d, 2]
    waits: Booleans  # [nodes] whether it is in the queue
    queue: Integers  # [nodes + 1] numbers of nodes, used in a circle
    ends: Integers  # [2] how many were taken from the queue, and put into it


class Flow(NamedTuple):
    """A step of a box: what it was before, and what moved."""

    before: Floats  # [2 d]
    levels: Floats  # [4] bounds of the upper, and of the lower level before
    through: Floats  # [2] m through the valve
    on: int  # whether the pump
    opened: int  # and the valve were told to open


class Room(NamedTuple):
    """Room to work in."""

    box: Floats  # [2 d]
    part: Floats  # [2 d]
    seen: Floats  # [16]
    at: Integers  # [5, d]


@compiled
def agree(box: Floats, seen: Floats) -> bool:
    """Let all that is known of the same states narrow each other; False where nothing is left."""
    lower = max(box[LOWER], box[BEHIND] + box[DEVIATION] - _SLACK, 0.0)
    lower_most = min(box[LOWER + 1], box[BEHIND + 1] + box[DEVIATION + 1] + _SLACK, HEIGHT)
    seen[0] = max(
        seen[0], 0.0, box[STORED] - RUN_DOWN * box[PUMP + 1] + CREDIT * box[VALVE] - _SLACK,
        box[MASS] - RUN_DOWN * box[PUMP + 1] - lower_most - _SLACK,
    )  # fmt: skip
    seen[1] = min(
        seen[1], HEIGHT, box[STORED + 1] - RUN_DOWN * box[PUMP] + CREDIT * box[VALVE + 1] + _SLACK,
        box[MASS + 1] - RUN_DOWN * box[PUMP] - lower + _SLACK,
    )  # fmt: skip
    seen[2], seen[3] = max(seen[2], lower), min(seen[3], lower_most)
    if seen[0] > seen[1] or seen[2] > seen[3]:
        return False
    upper, upper_most, lower, lower_most = seen[0], seen[1], seen[2], seen[3]
    _meet(box, LOWER, lower, lower_most)
    _meet(box, BEHIND, lower - box[DEVIATION + 1], lower_most - box[DEVIATION])
    _meet(box, DEVIATION, lower - box[BEHIND + 1], lower_most - box[BEHIND])
    pump, pump_most = RUN_DOWN * box[PUMP], RUN_DOWN * box[PUMP + 1]
    _meet(box, MASS, upper + lower + pump, upper_most + lower_most + pump_most)
    _meet(box, STORED, upper + pump - CREDIT * box[VALVE + 1],
          upper_most + pump_most - CREDIT * box[VALVE])  # fmt: skip
    for i in range(_SHARES.size):
        k, share = WEIGHED + 2 * i, _SHARES[i]
        rest = 1.0 - share
        _meet(box, k, rest * (box[LOWER] + STILL_LET * box[VALVE]) + share * box[MASS],
              rest * (box[LOWER + 1] + STILL_LET * box[VALVE + 1])
              + share * box[MASS + 1])  # fmt: skip
        _meet(box, LOWER, (box[k] - share * box[MASS + 1]) / rest - STILL_LET * box[VALVE + 1],
              (box[k + 1] - share * box[MASS]) / rest - STILL_LET * box[VALVE])  # fmt: skip
    for place, number in ((2, LOWER), (4, PUMP), (6, VALVE), (14, DEVIATION)):
        seen[place] = max(seen[place], box[number])
        seen[place + 1] = min(seen[place + 1], box[number + 1])
    for k in range(0, box.size, 2):
        if box[k] > box[k + 1]:
            return False
    return bool(seen[2] <= seen[3])


@compiled
def _meet(box: Floats, number: int, low: float, high: float) -> None:
    """Narrow a number to bounds, moved outward."""
    box[number] = max(box[number], low - _SLACK)
    box[number + 1] = min(box[number + 1], high + _SLACK)


@compiled
def move(flow: Flow, out: Floats, seen: Floats) -> float:
    """Write the box one step later and the features then; return the highest level, not clipped.

    ``seen[8]`` and ``seen[9]`` hold the range of set points and stay.
    """
    before, levels, through, on, opened = flow
    for actuator, told in ((PUMP, on), (VALVE, opened)):
        out[actuator] = max((1.0 - LAG) * before[actuator] + LAG * told - _SLACK, 0.0)
        out[actuator + 1] = min((1.0 - LAG) * before[actuator + 1] + LAG * told + _SLACK, 1.0)
    pump, pump_most, valve, valve_most = out[PUMP], out[PUMP + 1], out[VALVE], out[VALVE + 1]
    root, root_most = np.sqrt(levels[0]), np.sqrt(levels[1])
    through[0], through[1] = LET * valve * root - _SLACK, LET * valve_most * root_most + _SLACK
    if levels[0] > 1e-3:  # the level less its flow rises with the level: two corners bound it
        low, high = levels[0] - LET * valve_most * root, levels[1] - LET * valve * root_most
    else:
        low, high = levels[0] - through[1], levels[1] - through[0]
    low, high = low + PUMPED * pump - _SLACK, high + PUMPED * pump_most + _SLACK
    taken = min(DEMAND[0], levels[2]) - _SLACK
    taken_most = min(DEMAND[1], levels[3]) + _SLACK
    fall, rise = through[0] - taken_most, through[1] - taken
    seen[10] = _RATE * (PUMPED * pump - through[1]) - _RATE_SLACK
    seen[11] = _RATE * (PUMPED * pump_most - through[0]) + _RATE_SLACK
    if low <= 0.0:  # a tank that runs empty falls no further
        seen[11] = max(seen[11], 0.0)
    seen[12], seen[13] = _RATE * fall - _RATE_SLACK, _RATE * rise + _RATE_SLACK
    lower, lower_most = levels[2] + fall - _SLACK, levels[3] + rise + _SLACK
    highest = max(high - levels[4], lower_most - levels[5])
    seen[0], seen[1] = max(low, 0.0), max(high, 0.0)
    seen[2], seen[3] = max(lower, 0.0), max(lower_most, 0.0)
    seen[4], seen[5], seen[6], seen[7] = pump, pump_most, valve, valve_most
    _begin(out)
    out[LOWER], out[LOWER + 1] = seen[2], seen[3]
    _follow(before, out, seen, fall, rise)
    seen[14], seen[15] = out[DEVIATION], out[DEVIATION + 1]
    if levels[0] > 0.1:  # far from empty
        _drift(flow, out, out[VALVE], out[VALVE + 1])
    return float(highest)


@compiled
def _begin(out: Floats) -> None:
    """Forget all numbers but the actuators."""
    for k in range(0, out.size, 2):
        if k != PUMP and k != VALVE:
            out[k], out[k + 1] = -9.0, 9.0


@compiled
def _follow(before: Floats, out: Floats, seen: Floats, fall: float, rise: float) -> None:
    """Narrow deviation and lag by the change of the lower level and the set point."""
    behind, behind_most = before[BEHIND] + fall, before[BEHIND + 1] + rise
    _meet(out, DEVIATION, before[DEVIATION] + 0.1 * (behind - seen[9]),
          before[DEVIATION + 1] + 0.1 * (behind_most - seen[8]))  # fmt: skip
    _meet(out, BEHIND, 0.9 * behind + 0.1 * seen[8], 0.9 * behind_most + 0.1 * seen[9])


@compiled
def _drift(flow: Flow, out: Floats, valve: float, valve_most: float) -> None:
    """Narrow what is stored by how it changed: by what was told, and by how far from balance."""
    root, root_most = np.sqrt(flow.levels[0]) - BALANCE, np.sqrt(flow.levels[1]) - BALANCE
    told = PUMPED * flow.on - LET * BALANCE * flow.opened
    low = told - LET * max(valve * root_most, valve_most * root_most)
    high = told - LET * min(valve * root, valve_most * root)
    out[STORED] = max(out[STORED], flow.before[STORED] + low - _SLACK)
    if flow.on + flow.opened == 0 and root >= 1e-6:
        # It does not rise, and no slack is added: it stands for the real sum up to what all
        # roundings of one run-down come to, a hundred steps at most, for which agree has slack.
        out[STORED + 1] = min(out[STORED + 1], flow.before[STORED + 1] + min(high, 0.0))
    else:
        out[STORED + 1] = min(out[STORED + 1], flow.before[STORED + 1] + high + _SLACK)


@compiled
def narrow(flow: Flow, box: Floats, seen: Floats, is_dry: bool) -> bool:
    """Narrow a box after a step by what the features say of that step; False if none is left.

    Which rates a leaf asks for says how much flowed, so how the levels changed.
    """
    before, levels, through, on, opened = flow
    root, root_most = np.sqrt(levels[0]), np.sqrt(levels[1])
    for _ in range(2):
        low = max(LET * box[VALVE] * root, through[0])
        high = min(LET * box[VALVE + 1] * root_most, through[1])
        if not is_dry:  # else the rate is above what flowed
            box[PUMP] = max(box[PUMP], (seen[10] / _RATE + low) / PUMPED - _SLACK)
        box[PUMP + 1] = min(box[PUMP + 1], (seen[11] / _RATE + high) / PUMPED + _SLACK)
        drawn = DEMAND[0] if levels[2] > 0.05 else 0.0
        low = max(PUMPED * box[PUMP] - seen[11] / _RATE, seen[12] / _RATE + drawn)
        high = seen[13] / _RATE + DEMAND[1]
        if not is_dry:
            high = min(high, PUMPED * box[PUMP + 1] - seen[10] / _RATE)
        if root_most > 1e-3:
            box[VALVE] = max(box[VALVE], low / (LET * root_most) - _SLACK)
        if root > 1e-3:
            box[VALVE + 1] = min(box[VALVE + 1], high / (LET * root) + _SLACK)
    fall, rise = seen[12] / _RATE - _SLACK, seen[13] / _RATE + _SLACK
    seen[0] = max(seen[0], levels[0] + seen[10] / _RATE - _SLACK)
    seen[1] = min(seen[1], levels[1] + seen[11] / _RATE + _SLACK)
    if box[PUMP] > box[PUMP + 1] or box[VALVE] > box[VALVE + 1] or fall > rise:
        return False
    _meet(box, LOWER, levels[2] + fall, levels[3] + rise)
    _follow(before, box, seen, fall, rise)
    if is_dry:  # the clip adds water: sums that count it may rise
        return bool(seen[0] <= seen[1])
    _drift(flow, box, box[VALVE], box[VALVE + 1])
    taken, taken_most = through[0] - rise, through[1] - fall
    _meet(box, MASS, before[MASS] + PUMPED * on - taken_most,
          before[MASS + 1] + PUMPED * on - taken)  # fmt: skip
    valve, valve_most = box[VALVE], box[VALVE + 1]
    most = max(valve * (USUAL - root), valve_most * (USUAL - root))
    least = min(valve * (USUAL - root_most), valve_most * (USUAL - root_most))
    for i in range(_SHARES.size):
        k, share = WEIGHED + 2 * i, _SHARES[i]
        rest, pumped = (1.0 - share) * LET, share * PUMPED * on
        _meet(box, k, before[k] + rest * (USUAL * opened - most) + pumped - taken_most,
              before[k + 1] + rest * (USUAL * opened - least) + pumped - taken)  # fmt: skip
    return bool(seen[0] <= seen[1])


@compiled
def first_part(edges: Floats, n: int, value: float) -> int:
    """Return the last of the first n edges that is not above a value; 0 if all are."""
    low, high = 0, n
    while high - low > 1:  # the answer is in [low, high)
        middle = (low + high) // 2
        if edges[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@compiled
def last_part(edges: Floats, n: int, value: float) -> int:
    """Return the first of the edges from 1 on that is not below a value; n if all are."""
    low, high = 0, n
    while high - low > 1:  # the answer is in (low, high]
        middle = (low + high) // 2
        if edges[middle] >= value:
            high = middle
        else:
            low = middle
    return high


@compiled
def spread(
    leaves: Leaves, cells: CellCuts, flow: Flow, reached: Reached, room: Room,
    box: Floats, seen: Floats, is_first: bool,
) -> None:  # fmt: skip
    """Add a box to what is reached: piece by piece of the cells, leaf by leaf of the tree."""
    counts, parts, edges = cells
    first, last, at = room.at[0], room.at[1], room.at[2]
    d = counts.size
    for j in range(d):
        # Levels are known to be in the tank by now, so all numbers are in the range of the cells.
        n = counts[j] * parts[j]
        first[j] = first_part(edges[j], n, box[2 * j]) // parts[j]
        last[j] = max((last_part(edges[j], n, box[2 * j + 1]) - 1) // parts[j], first[j])
        at[j] = first[j]
    while True:  # counts through the cells like the digits of a number
        cell = 0
        for j in range(d):
            room.part[2 * j] = max(box[2 * j], edges[j, at[j] * parts[j]])
            room.part[2 * j + 1] = min(box[2 * j + 1], edges[j, (at[j] + 1) * parts[j]])
            cell = cell * counts[j] + at[j]
        for leaf in range(leaves.action.size):
            room.box[:] = room.part
            if not _enters(leaves, leaf, room, seen):
                continue
            if not is_first and not narrow(flow, room.box, room.seen, seen[0] <= 0.0):
                continue
            if agree(room.box, room.seen):
                _add(cells, reached, room, cell * N_ACTIONS + leaves.action[leaf])
        j = d - 1
        while j >= 0 and at[j] == last[j]:
            at[j] = first[j]
            j -= 1
        if j < 0:
            return
        at[j] += 1


@compiled
def _enters(leaves: Leaves, leaf: int, room: Room, seen: Floats) -> bool:
    """Narrow the features, and the numbers that are features, to a leaf; False if none is left."""
    for j in range(N_FEATURES):
        room.seen[2 * j] = max(seen[2 * j], leaves.low[leaf, j])
        room.seen[2 * j + 1] = min(seen[2 * j + 1], leaves.high[leaf, j])
        if room.seen[2 * j] > room.seen[2 * j + 1]:
            return False
    for place, number in ((4, PUMP), (6, VALVE), (14, DEVIATION)):
        room.box[number] = max(room.box[number], room.seen[place])
        room.box[number + 1] = min(room.box[number + 1], room.seen[place + 1])
        if room.box[number] > room.box[number + 1]:
            return False
    return True


@compiled
def _add(cells: CellCuts, reached: Reached, room: Room, node: int) -> None:
    """Widen the hull of a node by a box; a node that grew waits to be looked at."""
    counts, parts, edges = cells
    grew = False
    for j in range(counts.size):
        n, begin = counts[j] * parts[j], room.at[2, j] * parts[j]
        low = max(first_part(edges[j], n, room.box[2 * j]) - begin, 0)
        low = min(low, parts[j] - 1)
        high = last_part(edges[j], n, room.box[2 * j + 1]) - begin
        high = min(max(high, low + 1), parts[j])
        if low < reached.hull[node, j, 0]:
            reached.hull[node, j, 0] = low
            grew = True
        if high > reached.hull[node, j, 1]:
            reached.hull[node, j, 1] = high
            grew = True
    if grew and not reached.waits[node]:
        reached.waits[node] = True
        reached.queue[reached.ends[1] % reached.queue.size] = node
        reached.ends[1] += 1


@compiled
def flood(
    leaves: Leaves, cells: CellCuts, reached: Reached, targets: Floats, limits: Floats, most: int
) -> int:
    """Follow what waits until nothing does; return the node that breaks a limit, or -1.

    ``targets`` [2] are the least and the greatest set point, ``limits`` [2] are those of both
    levels, and at most ``most`` boxes are moved.
    """
    counts, parts, edges = cells
    d = counts.size
    before, box, seen = np.empty(2 * d), np.empty(2 * d), np.empty(2 * N_FEATURES)
    levels, through = np.empty(6), np.empty(2)
    levels[4:] = limits
    room = Room(np.empty(2 * d), np.empty(2 * d), np.empty(2 * N_FEATURES),
                np.empty((3, d), dtype=np.int64))  # fmt: skip
    steps = 0
    while reached.ends[0] < reached.ends[1] and steps < most:
        node = reached.queue[reached.ends[0] % reached.queue.size]
        reached.ends[0] += 1
        reached.waits[node] = False
        steps += 1
        rest, action = node // N_ACTIONS, node % N_ACTIONS
        for j in range(d - 1, -1, -1):
            begin = rest % counts[j] * parts[j]
            rest //= counts[j]
            before[2 * j] = edges[j, begin + reached.hull[node, j, 0]]
            before[2 * j + 1] = edges[j, begin + reached.hull[node, j, 1]]
        for j in range(N_FEATURES):
            seen[2 * j], seen[2 * j + 1] = -99.0, 99.0
        if not agree(before, seen):
            continue
        levels[:4] = seen[:4]
        seen[8:10] = targets
        flow = Flow(before, levels, through, action // 2, action % 2)
        if move(flow, box, seen) >= 0.0:
            return int(node)
        spread(leaves, cells, flow, reached, room, box, seen, False)
    return -1


@compiled
def shadow(
    cells: CellCuts,
    hull: NDArray[np.uint16],  # [nodes, d, 2]
    out: Booleans,  # [I, J] of the upper and the lower level, from 0 to HEIGHT
) -> None:
    """Mark where the levels are in some box that is reached."""
    n, d, _ = hull.shape
    box, seen = np.empty(2 * d), np.empty(2 * N_FEATURES)
    rows, columns = out.shape
    for node in range(n):
        if hull[node, 0, 1] == 0:
            continue
        place = node // N_ACTIONS
        for j in range(d - 1, -1, -1):
            begin = place % cells.counts[j] * cells.parts[j]
            place //= cells.counts[j]
            box[2 * j] = cells.edges[j, begin + hull[node, j, 0]]
            box[2 * j + 1] = cells.edges[j, begin + hull[node, j, 1]]
        seen[0::2], seen[1::2] = -99.0, 99.0
        if agree(box, seen):
            for i in range(
                int(seen[0] / HEIGHT * rows), min(int(seen[1] / HEIGHT * rows) + 1, rows)
            ):
                for j in range(
                    int(seen[2] / HEIGHT * columns),
                    min(int(seen[3] / HEIGHT * columns) + 1, columns),
                ):
                    out[i, j] = True
