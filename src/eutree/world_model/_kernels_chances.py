"""Compiled fit of the chance of an end, by a linear or quadratic boundary of its log-odds.

It is apart from ``_kernels_regression.py``, because shares are fitted by likelihood, not by
squares.
"""

import math

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.compiled import compiled_later, overwrite
from eutree.world_model._kernels_regression import TINY, solve_positive

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
