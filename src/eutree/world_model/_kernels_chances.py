"""Compiled loops of chances: expectations in place of draws, the fit of the chance of an end.

Steps of the world model without draws, and actions held for long. A logistic leaf has the chance of
an end by a linear or quadratic boundary; it is fitted here, apart from ``_kernels_regression.py``,
because shares are fitted by likelihood, not by squares.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.compiled import compiled, compiled_later, overwrite
from eutree.trees import TreeNodes, descend
from eutree.world_model._kernels import World, chance, fitted, model_leaf
from eutree.world_model._kernels_formulas import derive
from eutree.world_model._kernels_regression import TINY, solve_positive


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


CERTAIN = 18.0  # log-odds beyond which a row cannot pull a fit
RIDGE = 1e-5
MOST_STEPS = 60
MOST_ODDS = 1e300  # product of 1 + exp(-|log-odds|), whose logarithm is taken now and then
DECREASE = 1e-3  # of the penalised deviance below which a fit is done


@compiled_later
def newton_step(
    Z: Floats,  # [n, q]
    y: Booleans,  # [n]
    weights: Floats,  # [q]
    H: Floats,  # [q, q] scratch
    step: Floats,  # [q] out
) -> float:
    """Write Newton's step from some weights; return their penalised deviance.

    Twice the negative log-likelihood, with the ridge on all weights but the first.
    """
    n, q = Z.shape
    H[:] = 0.0
    step[:] = 0.0
    total, odds = 0.0, 1.0
    for i in range(n):
        eta = 0.0
        for k in range(q):
            eta += weights[k] * Z[i, k]
        # Log-odds against the row's outcome: the row adds log(1 + exp(against)) to the loss.
        against = -eta if y[i] else eta
        if against < -CERTAIN:
            continue
        # exp of a negative number in either case. The products of 1 + small are collected, because
        # one logarithm of a product is cheaper than many.
        small = math.exp(-abs(eta))
        if against > 0.0:
            total += against
        odds *= 1.0 + small
        if odds > MOST_ODDS:
            total += math.log(odds)
            odds = 1.0
        p = (1.0 if eta > 0.0 else small) / (1.0 + small)
        # First and second derivative of that by the row's log-odds.
        pull, curvature = p - y[i], p * (1.0 - p)
        for k in range(q):
            step[k] += pull * Z[i, k]
            scaled = curvature * Z[i, k]
            for m in range(k + 1):
                H[k, m] += scaled * Z[i, m]
    total += math.log(odds)
    # The constant is not penalised, but must not make H singular.
    H[0, 0] += TINY
    for k in range(1, q):
        H[k, k] += RIDGE
        step[k] += RIDGE * weights[k]
        total += 0.5 * RIDGE * weights[k] * weights[k]
    solve_positive(H, step, q)
    return 2.0 * total


@compiled_later
def fit_log_odds(
    X: Floats,  # [n, d]
    y: Booleans,  # [n] both values occur
    squares: bool,
    out: Floats,  # [2 d + 1] coefficients of x, of x * x, constant
) -> float:
    """Fit log-odds linear in x, or in x and its squares, by Newton's method; return the deviance.

    Features are standardised for the ridge, which keeps separable rows from infinite weights.
    """
    n, d = X.shape
    q = 2 * d + 1 if squares else d + 1
    centre, spread = np.zeros(d), np.zeros(d)
    for j in range(d):
        centre[j] = X[:, j].mean()
        spread[j] = X[:, j].std() + TINY
    Z = np.empty((n, q))
    n_true = 0
    for i in range(n):
        n_true += y[i]
        Z[i, 0] = 1.0
        for j in range(d):
            z = (X[i, j] - centre[j]) / spread[j]
            Z[i, 1 + j] = z
            if squares:
                Z[i, 1 + d + j] = z * z
    weights, tried = np.zeros(q), np.zeros(q)
    step, ahead, H = np.zeros(q), np.zeros(q), np.zeros((q, q))
    # Log-odds of the share: the best fit without features.
    weights[0] = math.log(n_true / (n - n_true))
    now = newton_step(Z, y, weights, H, step)
    for _ in range(MOST_STEPS):
        share, before = 1.0, now
        # Halve the step until the deviance falls: it is convex, so a short enough step succeeds but
        # for rounding.
        while share > 1e-3:
            for k in range(q):
                tried[k] = weights[k] - share * step[k]
            now = newton_step(Z, y, tried, H, ahead)
            if now < before:
                break
            share *= 0.5
        if not now < before:
            now = before
            break
        overwrite(weights, tried)
        overwrite(step, ahead)
        if before - now < DECREASE:
            break
    # Back to the units of the features: z = (x - centre) / spread, multiplied out.
    out[:] = 0.0
    out[2 * d] = weights[0]
    for j in range(d):
        linear = weights[1 + j] / spread[j]
        square = weights[1 + d + j] / (spread[j] * spread[j]) if squares else 0.0
        out[j] = linear - 2.0 * square * centre[j]
        out[d + j] = square
        out[2 * d] += square * centre[j] * centre[j] - linear * centre[j]
    return now
