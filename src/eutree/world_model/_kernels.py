"""Compiled loops of rollouts: a step of the world model, episodes under a policy tree.

All chance comes from a table of uniform draws: step t of episode e reads the same entries whatever
the policy is, so two policies meet common random numbers.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers, Uint32s
from eutree.compiled import compiled

# A prime, so that episodes begin at places of the table that do not line up; the table wraps.
EPISODE_STRIDE = 7919


class World(NamedTuple):
    """Model trees of each action in common arrays, laid out for one step after another.

    Roots 0 to d - 1 of an action are of the displacements, then those of the reward of a step that
    goes on, of one that ends badly and of one that ends well, and of the log-odds of a bad and of
    a good end. All look at a state: an observation and the displacement that led to it.
    """

    # Numbers of nodes are unsigned: numba then leaves out the test for negative ones.
    roots: Uint32s  # [A, d + 5]
    levels: Integers  # [A, d + 5] tests on the longest way down from each root
    # A leaf leads to itself, so a walk may take more steps than there are tests on its way.
    tests: Uint32s  # [M, 4] feature, node below, node above, row of the leaf
    thresholds: Floats  # [M]
    lines: Floats  # [L, 2 d + 4] coefficients, constant, the action's constant, lowest, highest
    noise: Integers  # [L, 2] first residual, number of residuals
    residuals: Floats  # [K]
    tally: Integers  # [1] steps taken in it so far


class Conditions(NamedTuple):
    """What all policies meet alike: a world, its chance, and how their episodes are counted."""

    world: World
    draws: Floats  # [size], a power of two
    horizon: int  # most steps of an episode
    discount: float


class ActionTree(NamedTuple):
    """A policy tree with one action at each leaf node; feature -1 marks a leaf.

    Nodes are in preorder.
    """

    feature: Integers  # [M]
    threshold: Floats  # [M]
    left: Integers  # [M]
    right: Integers  # [M]
    action: Integers  # [M]


class Episodes(NamedTuple):
    """Imagined episodes of one policy, step after step."""

    states: Floats  # [K, 2 d] observation, displacement that led to it
    earned: Floats  # [K] return before each step
    node: Integers  # [K] leaf node of the policy
    owner: Integers  # [K] episode
    first: Integers  # [E + 1] first step of each episode
    returns: Floats  # [E]


@compiled
def overwrite(target: Floats, source: Floats) -> None:
    """Copy an array of the same length; numba takes seconds to compile ``target[:] = source``."""
    for i in range(target.size):
        target[i] = source[i]


@compiled
def leaf_node(policy: ActionTree, root: int, x: Floats) -> int:
    """Return the leaf node below ``root`` that x falls into."""
    node = root
    # x is in the box of ``node``. NaN compares false and goes right, as in every tree here.
    while policy.feature[node] >= 0:
        below = x[policy.feature[node]] <= policy.threshold[node]
        node = policy.left[node] if below else policy.right[node]
    return node


@compiled
def model_leaf(tests: Uint32s, thresholds: Floats, root: int, state: Floats) -> int:
    """Return the row of the model's leaf below ``root`` that the state falls into."""
    node = root
    while True:
        below = tests[node, 1]
        if below == node:
            row: int = tests[node, 3]
            return row
        node = below if state[tests[node, 0]] <= thresholds[node] else tests[node, 2]


@compiled
def fitted(lines: Floats, row: int, state: Floats) -> float:
    """Return the leaf's fit at a state, within the range of what the leaf has seen."""
    p = state.size
    # The sum begins with the constant and ends with what the action adds: unrolled trees give the
    # bits that the fitted ones gave.
    value = lines[row, p]
    for j in range(p):
        value += lines[row, j] * state[j]
    value += lines[row, p + 1]
    # A line is no model beyond the data that it was fitted to.
    clipped: float = min(max(value, lines[row, p + 2]), lines[row, p + 3])
    return clipped


@compiled
def chance(world: World, root: int, state: Floats, draw: float) -> float:
    """Return the probability of an end, or 0 where it is clearly below the draw.

    The log-odds are linear in the observation and its squares.
    """
    row = model_leaf(world.tests, world.thresholds, root, state)
    d = state.size // 2
    odds = world.lines[row, 2 * d]
    for i in range(d):
        odds += (world.lines[row, i] + world.lines[row, d + i] * state[i]) * state[i]
    if odds < -7.0 and draw > 1e-3:  # exp(-7) is less: spare the exponential
        return 0.0
    return 1.0 / (1.0 + math.exp(min(-odds, 40.0)))  # no overflow


@compiled
def model_step(
    world: World,
    draws: Floats,  # [size], a power of two
    at: int,
    action: int,
    state: Floats,  # [2 d], in and out
    move: Floats,  # [d] scratch
) -> tuple[float, bool]:
    """Move one step; return the reward and whether it was the last."""
    world.tally[0] += 1
    d = move.size
    # A power of two: the remainder is an "and", not a division.
    mask = draws.size - 1
    for i in range(d):
        row = model_leaf(world.tests, world.thresholds, world.roots[action, i], state)
        # A residual of the leaf, drawn evenly: the noise has the shape that the data had there.
        # draws < 1, so pick stays below the number of residuals.
        pick = int(draws[(at + i) & mask] * world.noise[row, 1])
        noise = world.residuals[world.noise[row, 0] + pick]
        move[i] = fitted(world.lines, row, state) + noise
    # Only now: all displacements were asked of the state before the step.
    for i in range(d):
        state[i] += move[i]
        state[d + i] = move[i]
    # One draw decides both ends, a bad one from below and a good one from above: as the two chances
    # shrink, fewer draws end at all, whatever the policy.
    draw = draws[(at + d) & mask]
    kind = 0
    if draw < chance(world, world.roots[action, d + 3], state, draw):
        kind = 1
    elif 1.0 - draw <= chance(world, world.roots[action, d + 4], state, 1.0 - draw):
        kind = 2
    row = model_leaf(world.tests, world.thresholds, world.roots[action, d + kind], state)
    return fitted(world.lines, row, state), kind > 0


@compiled
def assign_starts(
    starts: Floats,  # [S, d]
    out: Episodes,
) -> None:
    """Write episodes of one step each: the starts in turn."""
    d = starts.shape[1]
    for e in range(out.returns.size):
        for i in range(d):
            out.states[e, i] = starts[e % starts.shape[0], i]
            # Nothing has led to a first observation.
            out.states[e, d + i] = 0.0
        out.earned[e] = 0.0
        out.node[e] = 0
        out.first[e] = e
    out.first[out.returns.size] = out.returns.size


@compiled
def record(
    conditions: Conditions,
    before: Episodes,
    departs: Integers,  # [E] first step of each episode to run again, -1 where there is none
    within: Integers,  # [M] node of the policy that holds all steps of a node before
    policy: ActionTree,
    out: Episodes,
) -> None:
    """Run the policy's episodes: those of ``before`` as far as it acts alike, then its own."""
    world, draws, horizon, discount = conditions
    d = before.states.shape[1] // 2
    state, move = np.zeros(2 * d), np.zeros(d)
    k = 0
    # The first k steps are written: those of the episodes before e, whose returns are final.
    for e in range(out.returns.size):
        begin, end = before.first[e], before.first[e + 1]
        same = end if departs[e] < 0 else departs[e]
        out.first[e] = k
        for i in range(begin, same):
            for j in range(2 * d):
                out.states[k, j] = before.states[i, j]
            out.earned[k] = before.earned[i]
            # The search begins at the node that holds the whole old leaf, mostly a leaf itself.
            out.node[k] = leaf_node(policy, within[before.node[i]], before.states[i])
            out.owner[k] = e
            k += 1
        out.returns[e] = before.returns[e]
        if departs[e] < 0:
            continue
        overwrite(state, before.states[same])
        total = before.earned[same]
        # As a power, not carried on from the copied steps: go_on begins in the same way, and paired
        # returns must agree to the bit where actions do.
        weight = discount ** (same - begin)
        for t in range(same - begin, horizon):
            node = leaf_node(policy, 0, state)
            for j in range(2 * d):
                out.states[k, j] = state[j]
            out.earned[k] = total
            out.node[k] = node
            out.owner[k] = e
            k += 1
            at = e * EPISODE_STRIDE + t * (d + 1)
            reward, ends = model_step(world, draws, at, policy.action[node], state, move)
            total += weight * reward
            weight *= discount
            if ends:
                break
        out.returns[e] = total
    out.first[out.returns.size] = k
