"""Compiled loop that holds actions in a world model, without draws: as it expects them to lead."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled, overwrite
from eutree.trees import TreeNodes, descend
from eutree.world_model import World, chance, derive, fitted, model_leaf


class Held(NamedTuple):
    """Actions that are held, and the outcome of each; written in place but for the actions."""

    actions: Integers  # [N]
    places: Floats  # [N, d] where it starts; then where it ended
    weights: Floats  # [N] discount^tau times the chance to go on
    rewards: Floats  # [N] discounted sum of the expected rewards
    entered: Integers  # [N] the leaf it ended in


@compiled
def expected_step(world: World, action: int, states: Floats, move: Floats) -> tuple[float, float]:
    """Move the first state as expected; return the expected reward and the chance to go on.

    A chance of an end is not drawn: rewards of the three kinds of steps are weighed by theirs. As
    in a step that is drawn, a good end has at most the chance that a bad one leaves over.
    """
    world.tally[0] += 1
    roots, lines, noise = world.roots, world.lines, world.noise
    d = move.size
    for i in range(d):
        row = model_leaf(world, roots[action, i], states, 0)
        move[i] = fitted(lines, noise, row, states, 0)
    # Only now: all displacements were asked of the state before the step.
    for i in range(d):
        states[0, d + i] = states[0, i]
        states[0, i] += move[i]
    derive(world.formulas, states[0])
    states[0, d:] = 0.0  # held actions start from places, not from movements
    row = model_leaf(world, roots[action, d + 3], states, 0)
    bad = chance(lines, noise, row, states, 0, 0.0)
    row = model_leaf(world, roots[action, d + 4], states, 0)
    good = min(chance(lines, noise, row, states, 0, 0.0), 1.0 - bad)
    goes_on = max(1.0 - bad - good, 0.0)
    reward = 0.0
    for kind, share in enumerate((goes_on, bad, good)):
        if share > 0.0:
            row = model_leaf(world, roots[action, d + kind], states, 0)
            reward += share * fitted(lines, noise, row, states, 0)
    return reward, goes_on


@compiled
def hold(
    world: World,
    nodes: TreeNodes,
    low: Floats,  # [d]
    high: Floats,  # [d]
    discount: float,
    longest: int,
    out: Held,
) -> None:
    """Hold each action until the trajectory leaves the leaf it first entered."""
    actions, places, weight, reward, entered = out
    d = places.shape[1]
    states, move = np.zeros((1, 2 * d)), np.zeros(d)
    state = states[0]
    for n in range(places.shape[0]):
        overwrite(state[:d], places[n])
        state[d:] = 0.0
        weight[n], reward[n], first = 1.0, 0.0, -1
        # weight = discount^tau times the chance that the episode still goes on after tau steps;
        # reward is the expected discounted sum of those tau steps.
        for _ in range(longest):
            earned, goes_on = expected_step(world, actions[n], states, move)
            reward[n] += weight[n] * earned
            weight[n] *= discount * goes_on
            # A model need not stay in what is possible: the nearest place inside stands for it.
            for i in range(d):
                state[i] = min(max(state[i], low[i]), high[i])
            entered[n] = descend(nodes, state, 0)
            # A start may lie at the edge of its leaf: the leaf of the first step is the one to be
            # left.
            if first < 0:
                first = entered[n]
            if entered[n] != first or weight[n] <= 1e-12:
                break
        overwrite(places[n], state)  # its first d
