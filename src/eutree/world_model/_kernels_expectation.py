"""Compiled loops of expectation: steps of the world model without draws, actions held for long."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import compiled
from eutree.world_model._kernels import World, chance, fitted, model_leaf


class Boxes(NamedTuple):
    """A partition of a finite box: a tree's arrays, and the box."""

    feature: Int32s  # [M] below 0 at a leaf
    threshold: Floats  # [M]
    left: Int32s  # [M]
    right: Int32s  # [M]
    leaf: Int32s  # [M]
    low: Floats  # [d]
    high: Floats  # [d]


class Held(NamedTuple):
    """Actions that are held, and what comes of each; written in place but for the actions."""

    actions: Integers  # [N]
    places: Floats  # [N, d] where it starts; then where it ended
    weights: Floats  # [N] discount^tau times the chance to go on
    rewards: Floats  # [N] discounted sum of the expected rewards
    entered: Integers  # [N] the box it ended in


@compiled
def expected_step(world: World, action: int, states: Floats, move: Floats) -> tuple[float, float]:
    """Move the first state as expected; return the expected reward and the chance to go on.

    A chance of an end is not drawn: rewards of the three kinds of steps are weighed by theirs. As
    in a step that is drawn, a good end is what a bad one leaves over.
    """
    world.tally[0] += 1
    roots, tests, thresholds = world.roots, world.tests, world.thresholds
    lines, noise = world.lines, world.noise
    d = move.size
    for i in range(d):
        row = model_leaf(tests, thresholds, roots[action, i], states, 0)
        move[i] = fitted(lines, noise, row, states, 0)
    # Only now: all displacements were asked of the state before the step.
    for i in range(d):
        states[0, i] += move[i]
        states[0, d + i] = 0.0  # held actions start from places, not from movements
    row = model_leaf(tests, thresholds, roots[action, d + 3], states, 0)
    bad = chance(lines, noise, row, states, 0, 0.0)
    row = model_leaf(tests, thresholds, roots[action, d + 4], states, 0)
    good = min(chance(lines, noise, row, states, 0, 0.0), 1.0 - bad)
    goes_on = max(1.0 - bad - good, 0.0)
    reward = 0.0
    for kind, share in enumerate((goes_on, bad, good)):
        if share > 0.0:
            row = model_leaf(tests, thresholds, roots[action, d + kind], states, 0)
            reward += share * fitted(lines, noise, row, states, 0)
    return reward, goes_on


@compiled
def hold(
    world: World,
    boxes: Boxes,
    discount: float,
    longest: int,
    out: Held,
) -> None:
    """Hold each action until the trajectory leaves the box it first entered."""
    actions, places, weight, reward, entered = out
    d = places.shape[1]
    states, move = np.zeros((1, 2 * d)), np.zeros(d)
    state = states[0]
    for n in range(places.shape[0]):
        state[:d], state[d:] = places[n], 0.0
        weight[n], reward[n], first = 1.0, 0.0, -1
        # weight = discount^tau times the chance that the episode still goes on after tau steps;
        # reward is the expected discounted sum of those tau steps.
        for _ in range(longest):
            earned, goes_on = expected_step(world, actions[n], states, move)
            reward[n] += weight[n] * earned
            weight[n] *= discount * goes_on
            node = 0
            # The box is finite, a model need not stay in it; the nearest place inside stands for
            # it.
            for i in range(d):
                state[i] = min(max(state[i], boxes.low[i]), boxes.high[i])
            while boxes.feature[node] >= 0:
                below = state[boxes.feature[node]] <= boxes.threshold[node]
                node = boxes.left[node] if below else boxes.right[node]
            entered[n] = boxes.leaf[node]
            # A start may lie at the edge of its box: the box of the first step is the one to be
            # left.
            if first < 0:
                first = entered[n]
            if entered[n] != first or weight[n] <= 1e-12:
                break
        places[n] = state[:d]
