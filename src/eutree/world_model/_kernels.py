"""A world model and recorded episodes as kernels see them, and looks at one state of theirs.

All chance comes from a table of uniform draws: step t of episode e reads the same entries under
every policy, so two policies meet common random numbers.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers, Uint32s
from eutree.compiled import compiled, compiled_later, inlined, overwrite
from eutree.world_model._kernels_formulas import Formulas

# A prime, so that episodes begin at places of the table that do not line up; the table wraps.
EPISODE_STRIDE = 7919


class NodeTests(NamedTuple):
    """Trees as walks see them: of two children, the one below comes right before the one above.

    So a step down is ``above`` less whether the test holds, without a branch or a second look. A
    leaf leads to itself, for no number is at most NaN: a walk may take more steps than it needs.
    """

    # Numbers of nodes are unsigned: numba then leaves out the test for negative ones.
    features: Uint32s  # [M]
    thresholds: Floats  # [M] NaN at a leaf
    above: Uint32s  # [M]


class World(NamedTuple):
    """Model trees of each action in common arrays, laid out for one step after another.

    Roots 0 to d - 1 of an action are of the displacements, then those of the reward of a step that
    goes on, of one that ends badly and of one that ends well, and of the log-odds of a bad and of
    a good end. All look at a state: an observation and the displacement that led to it.
    """

    roots: Uint32s  # [A, d + 5]
    levels: Integers  # [d + 5] tests on the longest way down from each tree's roots
    tests: NodeTests
    rows: Uint32s  # [M] of each leaf in the arrays below
    lines: Floats  # [L, 2 d + 4] coefficients, constant, the action's constant, lowest, highest
    noise: Integers  # [L, 3] first residual, number of residuals, coefficients up to the last not 0
    residuals: Floats  # [K]
    formulas: Formulas  # of the derived features
    apart: int  # 1: each displacement draws its residual; 0: one draw, of the same row in all
    tally: Integers  # [1] steps taken in it so far


class Conditions(NamedTuple):
    """The conditions of all policies: a world, its chance, and how their episodes are counted."""

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
def leaf_node(policy: ActionTree, root: int, x: Floats) -> int:
    """Return the leaf node below ``root`` that x falls into."""
    node = root
    # x is in the box of ``node``. NaN compares false and goes right, as in every tree here.
    while policy.feature[node] >= 0:
        below = x[policy.feature[node]] <= policy.threshold[node]
        node = policy.left[node] if below else policy.right[node]
    return node


@inlined
def keep(
    before: Episodes,
    e: int,
    until: int,
    within: Integers,  # [M] node of the policy that holds all steps of a node before
    policy: ActionTree,
    out: Episodes,
    k: int,
) -> int:
    """Copy the steps of episode e before ``until`` to k and on; return the next free row."""
    for i in range(before.first[e], until):
        for j in range(before.states.shape[1]):
            out.states[k, j] = before.states[i, j]
        out.earned[k] = before.earned[i]
        # The search begins at the node that holds the whole old leaf, mostly a leaf itself.
        out.node[k] = leaf_node(policy, within[before.node[i]], before.states[i])
        out.owner[k] = e
        k += 1
    return k


@inlined
def model_leaf(world: World, root: int, states: Floats, k: int) -> int:
    """Return the row of the model's leaf below ``root`` that state k of [N, 2 d] falls into."""
    features, thresholds, above = world.tests
    node = root
    while above[node] != node:
        node = above[node] - np.uint32(states[k, features[node]] <= thresholds[node])
    row: int = world.rows[node]
    return row


@inlined
def fitted(lines: Floats, noise: Integers, row: int, states: Floats, k: int) -> float:
    """Return the leaf's fit at state k, clipped to the leaf's range of targets."""
    p = states.shape[1]
    # The sum begins with the constant and ends with the action's constant: unrolled trees give the
    # bits that the fitted ones gave.
    value = lines[row, p]
    for j in range(noise[row, 2]):  # most leaves are constants
        value += lines[row, j] * states[k, j]
    value += lines[row, p + 1]
    # A line is no model beyond the data that it was fitted to.
    clipped: float = min(max(value, lines[row, p + 2]), lines[row, p + 3])
    return clipped


@inlined
def chance(lines: Floats, noise: Integers, row: int, states: Floats, k: int, draw: float) -> float:
    """Return the probability of an end at state k, or 0 where it is clearly below the draw.

    The log-odds are linear in the observation and its squares.
    """
    d = states.shape[1] // 2
    odds = lines[row, 2 * d]
    for i in range(min(noise[row, 2], d)):
        odds += (lines[row, i] + lines[row, d + i] * states[k, i]) * states[k, i]
    if odds < -7.0 and draw > 1e-3:  # exp(-7) is less: spare the exponential
        return 0.0
    return 1.0 / (1.0 + math.exp(min(-odds, 40.0)))  # no overflow


@compiled_later
def overlay(policy: ActionTree, challenger: ActionTree, n_features: int, out: Integers) -> None:
    """Write, for each leaf node of the policy, the challenger's lowest node that holds its box."""
    n_nodes = policy.feature.size
    low = np.full((n_nodes, n_features), -np.inf)
    high = np.full((n_nodes, n_features), np.inf)
    # Preorder: the box of a node, low < x <= high, is known before its children get theirs.
    for node in range(n_nodes):
        feature = policy.feature[node]
        if feature >= 0:
            left, right = policy.left[node], policy.right[node]
            for child in (left, right):
                overwrite(low[child], low[node])
                overwrite(high[child], high[node])
            high[left, feature] = min(high[node, feature], policy.threshold[node])
            low[right, feature] = max(low[node, feature], policy.threshold[node])
            continue
        at = 0
        # The leaf's box lies in that of ``at``, down to where the challenger would divide it.
        while challenger.feature[at] >= 0:
            if high[node, challenger.feature[at]] <= challenger.threshold[at]:
                at = challenger.left[at]
            elif low[node, challenger.feature[at]] >= challenger.threshold[at]:
                at = challenger.right[at]
            else:
                break
        out[node] = at


@compiled_later
def departures(
    policy: ActionTree,
    challenger: ActionTree,
    within: Integers,  # [M] out: the overlay
    episodes: Episodes,
    begin: Integers,  # [M + 1]
    steps: Integers,  # [K] by leaf node of the policy
    out: Integers,  # [E]
) -> None:
    """Write the first step of each episode at which the challenger acts differently; -1: none.

    Only steps in leaves that the challenger divides, or treats differently, are visited.
    """
    overlay(policy, challenger, episodes.states.shape[1] // 2, within)
    out[:] = -1
    for leaf in range(policy.feature.size):
        if policy.feature[leaf] >= 0:
            continue
        root, taken = within[leaf], policy.action[leaf]
        # One leaf of the challenger holds the box and acts alike: none of its steps can differ.
        if challenger.feature[root] < 0 and challenger.action[root] == taken:
            continue
        for i in range(begin[leaf], begin[leaf + 1]):
            k = steps[i]
            known = out[episodes.owner[k]]
            # Steps are numbered in time, so the smallest k of an episode is its first departure.
            if known >= 0 and known < k:
                continue
            if challenger.action[leaf_node(challenger, root, episodes.states[k])] != taken:
                out[episodes.owner[k]] = k
