"""Compiled loops of imagined episodes in an ensemble, side by side.

A network that looks at one state loads each weight for one product. Here many episodes of a member
are under way at once, each in a *lane*, and each weight that is loaded meets all of them. A sum
has the same order in every lane, however many there are, so results do not depend on them.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Float32s, Floats, Integers
from eutree.compiled import compiled, compiled_uncounted, inlined
from eutree.neural import Network
from eutree.world_model._kernels import EPISODE_STRIDE, ActionTree, Episodes
from eutree.world_model._kernels_ensemble import (
    BAD,
    GOES_ON,
    GOOD,
    LEAST_LOG_VARIANCE,
    MOST_LOG_VARIANCE,
    Scales,
    logistic,
)
from eutree.world_model._kernels_formulas import Formulas, derive

LANES = 64
VECTOR = 16  # 32-bit numbers in the widest vector: lanes are counted up to a multiple
ROWS = 8  # of weights that are added in one pass


class EnsembleWorld(NamedTuple):
    """The members of an ensemble, to be run.

    Inputs and hidden units are filled up with such as are always 0, to a multiple of ``ROWS``.
    """

    members: Network  # each array of all members [M, ...]
    scales: Scales
    formulas: Formulas  # of the derived features
    tally: Integers  # [1] steps taken in it so far


class Draws(NamedTuple):
    """Tables of chance; both sizes are one power of two."""

    uniform: Floats  # [K]
    normal: Floats  # [K]


class EnsembleConditions(NamedTuple):
    """The conditions of all policies: the members, their chance, the most steps of an episode."""

    world: EnsembleWorld
    draws: Draws
    horizon: int


class Tasks(NamedTuple):
    """Trees that are run from recorded steps to the end."""

    forest: ActionTree
    roots: Integers  # [m] node of the forest at which the tree of each task begins
    begins: Integers  # [m] recorded step from which it acts
    totals: Floats  # [m] out: what the episode earns


class EnsembleLanes(NamedTuple):
    """Episodes under way; those before the first n are, the rest is left from others.

    The networks' numbers are those of all lanes for one unit, then for the next.
    """

    states: Floats  # [L, 2 d] observation, displacement
    x: Float32s  # [p L]
    hidden1: Float32s  # [h L]
    hidden2: Float32s  # [h L]
    out: Float32s  # [q L]
    row: Float32s  # [q] the same of one lane
    nodes: Integers  # [L] of the forest: the root of the lane's tree, then the leaf of its state
    tasks: Integers  # [L] which of ``Tasks``
    owners: Integers  # [L] episode
    steps: Integers  # [L] steps since the episode's start


@compiled
def empty_lanes(world: EnsembleWorld) -> EnsembleLanes:
    """Return lanes in which nothing is under way."""
    (_, p, h), q = world.members.w1.shape, world.members.w3.shape[2]
    numbers = np.zeros((p + 2 * h + q) * LANES, dtype=np.float32)
    first, second, third = p * LANES, (p + h) * LANES, (p + 2 * h) * LANES
    none = np.zeros((4, LANES), dtype=np.int64)
    return EnsembleLanes(
        np.zeros((LANES, 2 * world.scales.move.size)),
        numbers[:first], numbers[first:second], numbers[second:third], numbers[third:],
        np.zeros(q, dtype=np.float32), none[0], none[1], none[2], none[3],
    )  # fmt: skip


@compiled
def write_layer(
    w: Float32s, b: Float32s, x: Float32s, n: int, least: np.float32, out: Float32s
) -> None:
    """Write a layer's outputs of the first n lanes, none below ``least``.

    The parentheses fix the order of the additions. Places are computed from one constant, so that
    a loop over lanes runs along two stretches of memory.
    """
    for j in range(b.size):
        at, k = j * LANES, 0
        for lane in range(n):
            out[at + lane] = b[j]
        # Not ``range`` with a step: then numba does not know that no place is negative.
        while k + ROWS <= len(w):
            w0, w1, w2, w3 = w[k, j], w[k + 1, j], w[k + 2, j], w[k + 3, j]
            w4, w5, w6, w7 = w[k + 4, j], w[k + 5, j], w[k + 6, j], w[k + 7, j]
            for lane in range(n):
                i = k * LANES + lane
                x0, x1, x2, x3 = x[i], x[i + LANES], x[i + 2 * LANES], x[i + 3 * LANES]
                i += 4 * LANES
                x4, x5, x6, x7 = x[i], x[i + LANES], x[i + 2 * LANES], x[i + 3 * LANES]
                one = out[at + lane] + (((x0 * w0 + x1 * w1) + x2 * w2) + x3 * w3)
                out[at + lane] = one + (((x4 * w4 + x5 * w5) + x6 * w6) + x7 * w7)
            k += ROWS
        for lane in range(n):
            out[at + lane] = max(out[at + lane], least)


@compiled
def look(
    world: EnsembleWorld, member: int, forest: ActionTree, lanes: EnsembleLanes, n: int
) -> None:
    """Go down each lane's tree, and write a member's outputs for its state and action."""
    members, scales, states = world.members, world.scales, lanes.states
    n_seen = scales.centre.size
    for lane in range(n):
        node = lanes.nodes[lane]
        # As ``leaf_node``: to call it for each lane takes longer than the way down.
        while forest.feature[node] >= 0:
            below = states[lane, forest.feature[node]] <= forest.threshold[node]
            node = forest.left[node] if below else forest.right[node]
        lanes.nodes[lane] = node
        for k in range(n_seen):
            lanes.x[k * LANES + lane] = (states[lane, k] - scales.centre[k]) / scales.spread[k]
        for k in range(n_seen, members.w1.shape[1]):
            lanes.x[k * LANES + lane] = k == n_seen + forest.action[node]
    zero, none, width = np.float32(0), np.float32(-np.inf), -(-n // VECTOR) * VECTOR
    write_layer(members.w1[member], members.b1[member], lanes.x, width, zero, lanes.hidden1)
    write_layer(members.w2[member], members.b2[member], lanes.hidden1, width, zero, lanes.hidden2)
    write_layer(members.w3[member], members.b3[member], lanes.hidden2, width, none, lanes.out)


@inlined
def move(
    world: EnsembleWorld,
    draws: Draws,
    at: int,
    out: Float32s,  # [q]
    state: Floats,  # [2 d], in and out
) -> tuple[float, bool]:
    """Move one step as a member's output says; return the reward and whether it was the last.

    The same entries of the tables decide under every policy: from ``at`` on one for each feature,
    then one for the end. States and displacements stay in the range that was seen, but for those
    that stay on a circle and for derived features, which are those of the next state.
    """
    scales = world.scales
    d, mask = scales.move.size, draws.uniform.size - 1
    for i in range(d):
        before = state[d + i] = state[i]
        # Its log-odds give the chance of the upper value; nothing lies between the two.
        if scales.binary[i]:
            above = draws.uniform[(at + i) & mask] < logistic(out[i])
            state[i] = scales.high[i] if above else scales.low[i]
        else:
            # The range within which ``write_error`` pulls at it; exp(spread / 2) is the deviation.
            spread = min(max(out[d + i], LEAST_LOG_VARIANCE), MOST_LOG_VARIANCE)
            noise = draws.normal[(at + i) & mask] * math.exp(0.5 * spread)
            move = scales.move[i] * (out[i] + noise)
            move = min(max(move, scales.moves[i, 0]), scales.moves[i, 1])
            state[i] = min(max(before + move, scales.low[i]), scales.high[i])
    for k in range(len(scales.circles)):
        i, j = scales.circles[k]
        here, there = math.hypot(state[d + i], state[d + j]), math.hypot(state[i], state[j])
        if there > 0.0:  # else it has no direction
            state[i] *= here / there
            state[j] *= here / there
    derive(world.formulas, state)
    for i in range(d):
        # The displacement after all of that: the one that the next state shows, not the one drawn.
        state[d + i] = state[i] - state[d + i]
    # One draw for both ends, from either side, as in the model of trees.
    draw = draws.uniform[(at + d) & mask]
    kind = GOES_ON
    if draw < logistic(out[2 * d + 2 + BAD]):
        kind = BAD
    elif 1.0 - draw <= logistic(out[2 * d + 2 + GOOD]):
        kind = GOOD
    # Back to the unit of rewards: mean and unit are those of the kind of step.
    reward = scales.earned[kind, 0] + scales.earned[kind, 1] * out[2 * d + kind]
    return min(max(reward, scales.earned[kind, 2]), scales.earned[kind, 3]), kind != GOES_ON


@compiled
def go_on(conditions: EnsembleConditions, before: Episodes, tasks: Tasks, trace: Episodes) -> int:
    """Run trees from steps of some episodes to the end; write the returns.

    Episode e runs in member e modulo the number of members. Returns the steps written to ``trace``,
    which gets each step if it has room for all, those of an episode in their order.
    """
    return run_lanes(conditions, before, tasks, trace, empty_lanes(conditions.world))


@compiled_uncounted
def run_lanes(
    conditions: EnsembleConditions, episodes: Episodes, tasks: Tasks, trace: Episodes,
    lanes: EnsembleLanes,
) -> int:  # fmt: skip
    """Do what ``go_on`` does, in its lanes: to count who holds an array took half of each step."""
    world, draws, horizon = conditions
    forest, roots, begins, totals = tasks
    d, n_members, out = world.scales.move.size, len(world.members.w1), lanes.row
    writes, written = trace.earned.size > 0, 0
    for member in range(n_members):
        n, begun = 0, 0
        # The first n lanes are under way, and the tasks before ``begun`` are in them or done.
        while n > 0 or begun < begins.size:
            while n < LANES and begun < begins.size:
                k = begins[begun]
                e = episodes.owner[k]
                if e % n_members == member:
                    for j in range(2 * d):
                        lanes.states[n, j] = episodes.states[k, j]
                    lanes.tasks[n], lanes.owners[n] = begun, e
                    lanes.steps[n] = k - episodes.first[e]
                    # Up to that step it has earned what the policy did. No discount here.
                    totals[begun] = episodes.earned[k]
                    n += 1
                begun += 1
            for lane in range(n):
                lanes.nodes[lane] = roots[lanes.tasks[lane]]
            look(world, member, forest, lanes, n)
            world.tally[0] += n
            for lane in range(n if writes else 0):
                for j in range(2 * d):
                    trace.states[written, j] = lanes.states[lane, j]
                trace.earned[written] = totals[lanes.tasks[lane]]
                trace.node[written], trace.owner[written] = lanes.nodes[lane], lanes.owners[lane]
                written += 1
            # Backwards: the last lane under way, which takes the place of one that ends, has moved.
            for lane in range(n - 1, -1, -1):
                for j in range(out.size):
                    out[j] = lanes.out[j * LANES + lane]
                at = lanes.owners[lane] * EPISODE_STRIDE + lanes.steps[lane] * (d + 1)
                reward, ends = move(world, draws, at, out, lanes.states[lane])
                totals[lanes.tasks[lane]] += reward
                lanes.steps[lane] += 1
                if ends or lanes.steps[lane] >= horizon:
                    n -= 1
                    for j in range(2 * d):
                        lanes.states[lane, j] = lanes.states[n, j]
                    lanes.tasks[lane], lanes.owners[lane] = lanes.tasks[n], lanes.owners[n]
                    lanes.steps[lane] = lanes.steps[n]
    return written
