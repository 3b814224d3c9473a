"""Compiled loops of imagined episodes in an ensemble, side by side.

Many episodes of a member are under way at once, each in a *lane*: while one waits for a draw or an
exponential, the next one goes on. Each is looked at alone, all outputs of a layer at once, so that
a few lanes, as most challengers have, cost no more each than many. The weights of a member fit into
the nearest cache. Sums have one order, so results depend neither on lanes nor on vectors.
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
ROWS = 8  # of weights that are added in one pass
TILE = 64  # columns of weights that lie together: at known distances, loops run as vectors


class EnsembleWorld(NamedTuple):
    """The members of an ensemble, to be run.

    Inputs, hidden units and outputs are filled up with such as are always 0, to a multiple of
    ``ROWS``.
    """

    members: Network  # each array of all members [M, ...]
    tiles: Network  # the same; matrices flat, the first ``TILE`` columns of all rows, then the next
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
    """Episodes under way; those before the first n are, the rest is left from others."""

    states: Floats  # [L, 2 d] observation, displacement
    x: Float32s  # [L, p]
    hidden1: Float32s  # [L, h]
    hidden2: Float32s  # [L, h]
    out: Float32s  # [q, L], those of a lane side by side
    nodes: Integers  # [L] of the forest: the root of the lane's tree, then the leaf of its state
    tasks: Integers  # [L] which of ``Tasks``
    owners: Integers  # [L] episode
    steps: Integers  # [L] steps since the episode's start


@compiled
def empty_lanes(world: EnsembleWorld) -> EnsembleLanes:
    """Return lanes in which nothing is under way."""
    (_, p, h), q = world.members.w1.shape, world.members.w3.shape[2]
    none = np.zeros((4, LANES), dtype=np.int64)
    return EnsembleLanes(
        np.zeros((LANES, 2 * world.scales.move.size)), np.zeros((LANES, p), dtype=np.float32),
        np.zeros((LANES, h), dtype=np.float32), np.zeros((LANES, h), dtype=np.float32),
        np.zeros((LANES, q), dtype=np.float32).T, none[0], none[1], none[2], none[3],
    )  # fmt: skip


@compiled_uncounted
def write_layer(
    tiles: Float32s, b: Float32s, x: Float32s, n: int, least: np.float32, out: Float32s
) -> None:
    """Write a layer's outputs [L, q] of the first n lanes, none below ``least``.

    The parentheses fix the order of the additions. A view begins at each tile, and at nothing that
    may be negative, or numba would look at the sign of each place.
    """
    p = x.shape[1]
    for lane in range(n):
        row, all_sums = x[lane], out[lane]
        for j in range(b.size):
            all_sums[j] = b[j]
        for first in range(0, b.size, TILE):
            sums, w, k = all_sums[first : first + TILE], tiles[first * p :], 0
            # Not ``range``, whose steps may be negative for what numba knows.
            while k + ROWS <= p:
                x0, x1, x2, x3 = row[k], row[k + 1], row[k + 2], row[k + 3]
                x4, x5, x6, x7 = row[k + 4], row[k + 5], row[k + 6], row[k + 7]
                for j in range(sums.size):
                    i = k * TILE + j
                    w0, w1, w2, w3 = w[i], w[i + TILE], w[i + 2 * TILE], w[i + 3 * TILE]
                    i += 4 * TILE
                    w4, w5, w6, w7 = w[i], w[i + TILE], w[i + 2 * TILE], w[i + 3 * TILE]
                    one = sums[j] + (((x0 * w0 + x1 * w1) + x2 * w2) + x3 * w3)
                    sums[j] = one + (((x4 * w4 + x5 * w5) + x6 * w6) + x7 * w7)
                k += ROWS
        for j in range(b.size):
            all_sums[j] = max(all_sums[j], least)


@compiled
def look(
    world: EnsembleWorld, member: int, forest: ActionTree, lanes: EnsembleLanes, n: int
) -> None:
    """Go down each lane's tree, and write a member's outputs for its state and action."""
    tiles, scales, states = world.tiles, world.scales, lanes.states
    n_seen = scales.centre.size
    for lane in range(n):
        node = lanes.nodes[lane]
        # As ``leaf_node``: to call it for each lane takes longer than the way down.
        while forest.feature[node] >= 0:
            below = states[lane, forest.feature[node]] <= forest.threshold[node]
            node = forest.left[node] if below else forest.right[node]
        lanes.nodes[lane] = node
        for k in range(n_seen):
            lanes.x[lane, k] = (states[lane, k] - scales.centre[k]) / scales.spread[k]
        for k in range(n_seen, lanes.x.shape[1]):
            lanes.x[lane, k] = k == n_seen + forest.action[node]
    zero, none = np.float32(0), np.float32(-np.inf)
    write_layer(tiles.w1[member], tiles.b1[member], lanes.x, n, zero, lanes.hidden1)
    write_layer(tiles.w2[member], tiles.b2[member], lanes.hidden1, n, zero, lanes.hidden2)
    write_layer(tiles.w3[member], tiles.b3[member], lanes.hidden2, n, none, lanes.out.T)


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
    d, n_members = world.scales.move.size, len(world.members.w1)
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
                at = lanes.owners[lane] * EPISODE_STRIDE + lanes.steps[lane] * (d + 1)
                reward, ends = move(world, draws, at, lanes.out[:, lane], lanes.states[lane])
                totals[lanes.tasks[lane]] += reward
                lanes.steps[lane] += 1
                if ends or lanes.steps[lane] >= horizon:
                    n -= 1
                    for j in range(2 * d):
                        lanes.states[lane, j] = lanes.states[n, j]
                    lanes.tasks[lane], lanes.owners[lane] = lanes.tasks[n], lanes.owners[n]
                    lanes.steps[lane] = lanes.steps[n]
    return written
