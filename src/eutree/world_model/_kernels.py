"""A world model and recorded episodes as kernels see them, and looks at one state of theirs.

All chance comes from a table of uniform draws: step t of episode e reads the same entries whatever
the policy is, so two policies meet common random numbers.
"""

import math
from typing import NamedTuple

from eutree.arrays import Floats, Integers, Uint32s
from eutree.compiled import compiled, inlined

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
    """Copy the steps of episode e that come before ``until`` to k and on; return what is next."""
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
def model_leaf(tests: Uint32s, thresholds: Floats, root: int, states: Floats, k: int) -> int:
    """Return the row of the model's leaf below ``root`` that state k of [N, 2 d] falls into."""
    node = root
    while tests[node, 1] != node:
        below = states[k, tests[node, 0]] <= thresholds[node]
        node = tests[node, 1] if below else tests[node, 2]
    row: int = tests[node, 3]
    return row


@inlined
def fitted(lines: Floats, row: int, states: Floats, k: int) -> float:
    """Return the leaf's fit at state k, within the range of what the leaf has seen."""
    p = states.shape[1]
    # The sum begins with the constant and ends with what the action adds: unrolled trees give the
    # bits that the fitted ones gave.
    value = lines[row, p]
    for j in range(p):
        value += lines[row, j] * states[k, j]
    value += lines[row, p + 1]
    # A line is no model beyond the data that it was fitted to.
    clipped: float = min(max(value, lines[row, p + 2]), lines[row, p + 3])
    return clipped


@inlined
def chance(lines: Floats, row: int, states: Floats, k: int, draw: float) -> float:
    """Return the probability of an end at state k, or 0 where it is clearly below the draw.

    The log-odds are linear in the observation and its squares.
    """
    d = states.shape[1] // 2
    odds = lines[row, 2 * d]
    for i in range(d):
        odds += (lines[row, i] + lines[row, d + i] * states[k, i]) * states[k, i]
    if odds < -7.0 and draw > 1e-3:  # exp(-7) is less: spare the exponential
        return 0.0
    return 1.0 / (1.0 + math.exp(min(-odds, 40.0)))  # no overflow


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
        out.owner[e] = e
        out.first[e] = e
    out.first[out.returns.size] = out.returns.size
