"""Compiled loops of the neural world model: fitting its members, and rollouts in it.

One output vector of a member, for d features, reads

    0 .. d - 1       mean displacement, scaled; of a binary feature the log-odds of its upper value
    d .. 2 d - 1     logarithm of the displacement's variance, scaled; unused where it is binary
    2 d + KIND       reward, scaled, of a step that goes on, ends badly, ends well
    2 d + 2 + KIND   log-odds of a bad and of a good end

so that good and bad ends have a head each: one head would predict the mean of both, which no step
ever earns.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Float32s, Floats, Integers
from eutree.compiled import compiled, overwrite
from eutree.neural import Network, adam_step, add_rows, backward, forward, room
from eutree.world_model._kernels import EPISODE_STRIDE, ActionTree, Episodes, keep, leaf_node

GOES_ON, BAD, GOOD = 0, 1, 2  # kinds of step
# Weight of an end at the observation it led to: enough to be learned where no step was ever taken,
# and little beside the steps that went on from there, if there are any.
AGAIN = 0.1
FAR = 3.0  # scaled errors count linearly from here on (Huber)
LEAST_LOG_VARIANCE, MOST_LOG_VARIANCE = -8.0, 3.0


class Steps(NamedTuple):
    """The rows that a member is fitted to: one for each transition, then one for each end's o'."""

    inputs: Float32s  # [N + E, p]
    targets: Float32s  # [N, d] scaled displacement, or 0 and 1 where the feature is binary
    rewards: Float32s  # [N + E] scaled as those of its kind
    kind: Integers  # [N + E] GOES_ON, BAD or GOOD
    binary: Booleans  # [d]


class Fitting(NamedTuple):
    """A member under fitting; all changes in place."""

    network: Network
    gradient: Network
    mean: Float32s  # [P] Adam's
    square: Float32s  # [P] Adam's


class Scales(NamedTuple):
    """The units of the networks' inputs and outputs."""

    centre: Floats  # [p - A] mean of each input that is no action
    spread: Floats  # [p - A] its standard deviation and a twentieth of its range
    move: Floats  # [d] displacement that counts 1
    moves: Floats  # [d, 2] least and largest displacement, a few in ten thousand left out
    binary: Booleans  # [d] which features have two values only
    low: Floats  # [d] least value of each feature
    high: Floats  # [d] largest value of each feature
    earned: Floats  # [3, 4] mean, unit, least and largest reward of each kind of step


class EnsembleWorld(NamedTuple):
    """The members of an ensemble, to be run."""

    members: Network  # each array of all members [M, ...]
    scales: Scales
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


@compiled
def logistic(odds: float) -> float:
    """Return the probability of log-odds, without overflow."""
    # The other side needs no bound: exp of a large negative number is 0.
    return 1.0 / (1.0 + math.exp(min(-odds, 40.0)))


@compiled
def write_error(
    steps: Steps, rows: Integers, weight: float, out: Float32s, error: Float32s
) -> None:
    """Write the derivative of the mean loss by each output.

    Displacements: Huber's loss of the mean, and for the variance the normal likelihood of the error
    as it is: it does not pull at the mean, which would buy likelihood by forgetting rare steps.
    Binary features and ends: cross-entropy. Rewards: Huber's loss in the head of the step's kind.

    Args:
        steps: All rows.
        rows: Those of the batch, [n].
        weight: How much a row that ends counts for the log-odds of ends: there are more of them in
            a batch than among the steps.
        out: Outputs, [n, q].
        error: Out, [n, q].
    """
    n, d = rows.size, steps.binary.size
    error[:] = 0
    for i in range(n):
        row = rows[i]
        for j in range(d if row < len(steps.targets) else 0):
            if steps.binary[j]:
                error[i, j] = (logistic(out[i, j]) - steps.targets[row, j]) / n
                continue
            # The derivative of Huber's loss: the difference, cut where errors count linearly.
            difference = out[i, j] - steps.targets[row, j]
            error[i, j] = min(max(difference, -FAR), FAR) / n
            spread = out[i, d + j]
            # Of (square exp(-v) + v) / 2 with v = log variance, the derivative by v. The same cut
            # keeps one far displacement from widening the noise of all.
            square = min(difference * difference, FAR * FAR)
            if LEAST_LOG_VARIANCE < spread < MOST_LOG_VARIANCE:
                error[i, d + j] = 0.5 * (1.0 - square * math.exp(-spread)) / n
            else:  # back into the range of the draws
                error[i, d + j] = 0.1 * spread / n
        kind = steps.kind[row]
        # The heads of the other kinds keep an error of 0: a step says nothing about them.
        difference = out[i, 2 * d + kind] - steps.rewards[row]
        error[i, 2 * d + kind] = min(max(difference, -FAR), FAR) / n
        counts = weight if kind != GOES_ON else 1.0
        if row >= len(steps.targets):
            counts *= AGAIN
        for end in (BAD, GOOD):
            # Derivative of the cross-entropy by the log-odds: probability minus outcome (0 or 1).
            probability = logistic(out[i, 2 * d + 2 + end])
            error[i, 2 * d + 2 + end] = counts * (probability - (kind == end)) / n


@compiled
def fit(
    fitting: Fitting,
    steps: Steps,
    rows: Integers,  # [U, B] rows of each update's batch
    rates: Floats,  # [U] step size of each update
    number: int,
    weight: float,
) -> None:
    """Make U updates of one member, after ``number`` others."""
    n = rows.shape[1]
    x = np.empty((n, steps.inputs.shape[1]), fitting.network.weights.dtype)
    at = room(fitting.network, n)
    error = np.empty_like(at.out)
    for u in range(rows.shape[0]):
        for i in range(n):
            overwrite(x[i], steps.inputs[rows[u, i]])
        forward(fitting.network, x, at)
        write_error(steps, rows[u], weight, at.out, error)
        backward(fitting.network, x, at, error, fitting.gradient)
        adam_step(
            fitting.network.weights,
            fitting.gradient.weights,
            fitting.mean,
            fitting.square,
            # Adam's corrections go by the number of all updates, this one included.
            number + u + 1,
            rates[u],
        )


@compiled
def rectify(x: Float32s, active: Integers) -> int:
    """Replace negative numbers by 0; write where the others are, and return how many."""
    n = 0
    for k in range(x.size):
        x[k] = max(x[k], 0)
        # Written always and counted only where it is positive: no branch to be guessed wrong.
        # active has a place more than x for the last one.
        active[n] = k
        n += x[k] > 0
    return n


class Scratch(NamedTuple):
    """Room for one evaluation of a member."""

    x: Float32s  # [p]
    hidden1: Float32s  # [h]
    hidden2: Float32s  # [h]
    out: Float32s  # [q]
    active: Integers  # [max(p, h) + 1]


@compiled
def scratch_of(world: EnsembleWorld) -> Scratch:
    """Return room for the members of a world model."""
    (_, p, h), q = world.members.w1.shape, world.members.w3.shape[2]
    return Scratch(
        np.zeros(p, np.float32),
        np.zeros(h, np.float32),
        np.zeros(h, np.float32),
        np.zeros(q, np.float32),
        np.zeros(max(p, h) + 1, np.int64),
    )


@compiled
def look(world: EnsembleWorld, member: int, action: int, state: Floats, at: Scratch) -> None:
    """Write a member's output for a state [2 d] (observation, displacement) and an action."""
    members, scales = world.members, world.scales
    n_seen = scales.centre.size
    for k in range(n_seen):
        at.x[k] = (state[k] - scales.centre[k]) / scales.spread[k]
        at.active[k] = k
    # Actions are one-hot: of their rows in w1 only one is added.
    at.x[n_seen + action] = 1
    at.active[n_seen] = n_seen + action
    overwrite(at.hidden1, members.b1[member])
    add_rows(members.w1[member], at.x, n_seen + 1, at.active, at.hidden1)
    at.x[n_seen + action] = 0  # so that only one action is ever set
    n = rectify(at.hidden1, at.active)
    overwrite(at.hidden2, members.b2[member])
    add_rows(members.w2[member], at.hidden1, n, at.active, at.hidden2)
    n = rectify(at.hidden2, at.active)
    overwrite(at.out, members.b3[member])
    add_rows(members.w3[member], at.hidden2, n, at.active, at.out)


@compiled
def step(
    world: EnsembleWorld,
    draws: Draws,
    at: int,
    member: int,
    action: int,
    state: Floats,  # [2 d], in and out
    scratch: Scratch,
) -> tuple[float, bool]:
    """Move one step; return the reward and whether it was the last.

    The same entries of the tables decide under every policy: from ``at`` on one for each feature,
    then one for the end. States and displacements stay in the range that was seen.
    """
    world.tally[0] += 1
    look(world, member, action, state, scratch)
    out, scales, mask = scratch.out, world.scales, draws.uniform.size - 1
    d = scales.move.size
    for i in range(d):
        before = state[i]
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
        # The displacement after clipping: the one that the next state shows, not the one drawn.
        state[d + i] = state[i] - before
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
def record(
    conditions: EnsembleConditions,
    before: Episodes,
    departs: Integers,  # [E] first step of each episode to run again, -1 where there is none
    within: Integers,  # [M] node of the policy that holds all steps of a node before
    policy: ActionTree,
    out: Episodes,
) -> None:
    """Imagine the policy's episodes: those of ``before`` as far as it acts alike, then its own.

    Episode e runs in member e modulo the number of members.
    """
    world, draws, horizon = conditions
    d, n_members = world.scales.move.size, len(world.members.w1)
    state, scratch = np.zeros(2 * d), scratch_of(world)
    k = 0
    # The first k steps are written: those of the episodes before e, whose returns are final.
    for e in range(out.returns.size):
        begin, end = before.first[e], before.first[e + 1]
        same = end if departs[e] < 0 else departs[e]
        out.first[e] = k
        k = keep(before, e, same, within, policy, out, k)
        out.returns[e] = before.returns[e]
        if departs[e] < 0:
            continue
        overwrite(state, before.states[same])
        total = before.earned[same]
        # Returns are sums without discount here; t is the step within the episode, which picks the
        # draws.
        for t in range(same - begin, horizon):
            node = leaf_node(policy, 0, state)
            overwrite(out.states[k], state)
            out.earned[k] = total
            out.node[k] = node
            out.owner[k] = e
            k += 1
            at = e * EPISODE_STRIDE + t * (d + 1)
            reward, ends = step(
                world, draws, at, e % n_members, policy.action[node], state, scratch
            )
            total += reward
            if ends:
                break
        out.returns[e] = total
    out.first[out.returns.size] = k


@compiled
def challenger_returns(
    conditions: EnsembleConditions,
    episodes: Episodes,
    departs: Integers,  # [E] step from which the challenger acts on its own, -1 where it never does
    challenger: ActionTree,
    first: int,
    last: int,
    out: Floats,  # [E]
) -> None:
    """Write a challenger's returns, of the same chance, in episodes ``first`` to ``last`` - 1."""
    world, draws, horizon = conditions
    d, n_members = world.scales.move.size, len(world.members.w1)
    state, scratch = np.zeros(2 * d), scratch_of(world)
    for e in range(first, last):
        out[e] = episodes.returns[e]
        if departs[e] < 0:
            continue
        # Up to that step it has earned as much as the policy.
        overwrite(state, episodes.states[departs[e]])
        total = episodes.earned[departs[e]]
        for t in range(departs[e] - episodes.first[e], horizon):
            action = challenger.action[leaf_node(challenger, 0, state)]
            at = e * EPISODE_STRIDE + t * (d + 1)
            reward, ends = step(world, draws, at, e % n_members, action, state, scratch)
            total += reward
            if ends:
                break
        out[e] = total
