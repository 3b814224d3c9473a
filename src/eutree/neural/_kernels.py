"""Compiled loops of small networks: two hidden layers of rectified linear units.

No linear algebra library is called. All sums are taken in an order of their own, so the same seed
gives the same bytes under any library, number of threads or width of vectors, and the zeros that a
rectifier leaves, more than half of a hidden layer, are skipped.

Weights are 32-bit numbers: learning is limited by memory, and a step needs a direction only. The
tests run the same loops on 64-bit numbers, where gradients can be held against differences.
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Float32s, Floats, Integers
from eutree.compiled import compiled, overwrite

DECAY_OF_MEAN, DECAY_OF_SQUARE = 0.9, 0.999  # Adam's beta_1, beta_2
SMALL = 1e-8  # Adam's epsilon


class Network(NamedTuple):
    """A perceptron p -> h -> h -> q; the matrices are views of one vector of all weights."""

    w1: Float32s  # [p, h]
    b1: Float32s  # [h]
    w2: Float32s  # [h, h]
    b2: Float32s  # [h]
    w3: Float32s  # [h, q]
    b3: Float32s  # [q]
    weights: Float32s  # [P] all of the above


class Activations(NamedTuple):
    """Outputs of the layers of a network for each row of a batch."""

    hidden1: Float32s  # [n, h]
    hidden2: Float32s  # [n, h]
    out: Float32s  # [n, q]


@compiled
def add_rows(w: Float32s, x: Float32s, n: int, active: Integers, out: Float32s) -> None:
    """Add x[k] times row k of w to out, for the first n entries k of ``active``.

    Four rows make one term, so that the inner loop runs along memory and needs no sum to be
    reordered; two terms are added in one pass while there are so many.
    """
    t = 0
    # out holds the products of active[:t]. The parentheses fix the order of the additions, so the
    # sum is the same at any width of vectors, and in one pass or two.
    while t + 8 <= n:
        k0, k1, k2, k3 = active[t], active[t + 1], active[t + 2], active[t + 3]
        k4, k5, k6, k7 = active[t + 4], active[t + 5], active[t + 6], active[t + 7]
        x0, x1, x2, x3, x4, x5, x6, x7 = x[k0], x[k1], x[k2], x[k3], x[k4], x[k5], x[k6], x[k7]
        w0, w1, w2, w3, w4, w5, w6, w7 = w[k0], w[k1], w[k2], w[k3], w[k4], w[k5], w[k6], w[k7]
        for j in range(out.size):
            one = out[j] + (((x0 * w0[j] + x1 * w1[j]) + x2 * w2[j]) + x3 * w3[j])
            out[j] = one + (((x4 * w4[j] + x5 * w5[j]) + x6 * w6[j]) + x7 * w7[j])
        t += 8
    if t + 4 <= n:
        k0, k1, k2, k3 = active[t], active[t + 1], active[t + 2], active[t + 3]
        x0, x1, x2, x3 = x[k0], x[k1], x[k2], x[k3]
        w0, w1, w2, w3 = w[k0], w[k1], w[k2], w[k3]
        for j in range(out.size):
            out[j] += ((x0 * w0[j] + x1 * w1[j]) + x2 * w2[j]) + x3 * w3[j]
        t += 4
    while t < n:
        k0 = active[t]
        x0, w0 = x[k0], w[k0]
        for j in range(out.size):
            out[j] += x0 * w0[j]
        t += 1


@compiled
def add_product(a: Float32s, b: Float32s, out: Float32s) -> None:
    """Add the matrix product of a [n, p] and b [p, q] to out [n, q].

    Rows of b are added to a row of out. Those whose factor is 0 are left out.
    """
    n, p = a.shape
    # One more than p: the place behind the last is written to before it is known to count.
    active = np.empty(p + 1, np.int64)
    for i in range(n):
        # active[:m] holds, ascending, the columns k <= the present one with a[i, k] != 0.
        m = 0
        for k in range(p):
            active[m] = k
            m += a[i, k] != 0
        add_rows(b, a[i], m, active, out[i])


@compiled
def layer(x: Float32s, w: Float32s, b: Float32s, rectified: bool, out: Float32s) -> None:
    """Write x w + b, and 0 in place of negative entries if it is rectified."""
    for i in range(x.shape[0]):
        # The constants first, the products after: this order is part of the result.
        overwrite(out[i], b)
    add_product(x, w, out)
    if rectified:
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] = max(out[i, j], 0)


@compiled
def forward(network: Network, x: Float32s, at: Activations) -> None:
    """Write the outputs of each layer for the rows of x [n, p]."""
    layer(x, network.w1, network.b1, True, at.hidden1)
    layer(at.hidden1, network.w2, network.b2, True, at.hidden2)
    layer(at.hidden2, network.w3, network.b3, False, at.out)


@compiled
def layer_gradient(
    x: Float32s,  # [n, p] inputs of the layer
    error: Float32s,  # [n, q] derivative of the loss by its outputs, before rectifying
    of_w: Float32s,  # [p, q] out
    of_b: Float32s,  # [q] out
) -> None:
    """Write the derivatives of the loss by a layer's weights: x^T error and its column sums."""
    of_w[:] = 0
    # Transposed copies, so that the inner loop of the product runs along memory.
    add_product(np.ascontiguousarray(x.T), error, of_w)
    of_b[:] = 0
    for i in range(error.shape[0]):
        for j in range(error.shape[1]):
            of_b[j] += error[i, j]


@compiled
def passed_back(error: Float32s, w: Float32s, hidden: Float32s) -> Float32s:
    """Return the derivative of the loss by the inputs of a rectified layer, [n, h].

    ``error`` [n, q] is that by the sums of the next layer, whose weights are w [h, q]. Nothing is
    passed back where an output ``hidden`` [n, h] of the rectified layer is 0.
    """
    back = np.zeros_like(hidden)
    add_product(error, np.ascontiguousarray(w.T), back)
    # The rectifier has slope 1 above 0 and, by convention, 0 at it.
    for i in range(back.shape[0]):
        for j in range(back.shape[1]):
            if hidden[i, j] <= 0:
                back[i, j] = 0
    return back


@compiled
def backward(
    network: Network, x: Float32s, at: Activations, error: Float32s, gradient: Network
) -> None:
    """Write the gradient of a loss by all weights (Rumelhart, Hinton and Williams 1986).

    ``at`` is what ``forward`` wrote for the inputs x [n, p], ``error`` [n, q] the derivative of the
    loss by each output.
    """
    # From the last layer to the first; errors are those before the rectifier.
    layer_gradient(at.hidden2, error, gradient.w3, gradient.b3)
    error2 = passed_back(error, network.w3, at.hidden2)
    layer_gradient(at.hidden1, error2, gradient.w2, gradient.b2)
    error1 = passed_back(error2, network.w2, at.hidden1)
    layer_gradient(x, error1, gradient.w1, gradient.b1)


@compiled
def adam_step(
    weights: Float32s,
    gradient: Float32s,
    mean: Float32s,
    square: Float32s,
    number: int,
    rate: float,
) -> None:
    """Take one step of Adam (Kingma and Ba 2015, Algorithm 1) in place; the first has number 1.

    ``mean`` and ``square`` are decaying averages of the gradient and of its squares. Both start at
    0 and are too small by 1 - beta^number, which is divided out.
    """
    # Both corrections in one factor, computed in 64 bits and rounded once. Constants are cast to
    # the width of the weights: a single 64-bit factor would widen every line of the loop.
    scale = rate * np.sqrt(1.0 - DECAY_OF_SQUARE**number) / (1.0 - DECAY_OF_MEAN**number)
    scale32 = weights.dtype.type(scale)
    keep1, keep2 = weights.dtype.type(DECAY_OF_MEAN), weights.dtype.type(DECAY_OF_SQUARE)
    new1, new2 = weights.dtype.type(1 - DECAY_OF_MEAN), weights.dtype.type(1 - DECAY_OF_SQUARE)
    small = weights.dtype.type(SMALL)
    for i in range(weights.size):
        slope = gradient[i]
        mean[i] = keep1 * mean[i] + new1 * slope
        square[i] = keep2 * square[i] + new2 * slope * slope
        weights[i] -= scale32 * mean[i] / (np.sqrt(square[i]) + small)


@compiled
def limit_norm(gradient: Float32s, limit: float) -> None:
    """Scale a gradient down, in place, to a Euclidean norm of at most ``limit``."""
    total = 0.0
    for i in range(gradient.size):
        # In 64 bits: a long sum of small squares would lose them in 32.
        total += float(gradient[i]) * float(gradient[i])
    norm = np.sqrt(total)
    if norm > limit:
        gradient *= gradient.dtype.type(limit / norm)


@compiled
def move_towards(weights: Float32s, goal: Float32s, share: float) -> None:
    """Move weights a share of the way to others, in place."""
    part = weights.dtype.type(share)
    for i in range(weights.size):
        # As a difference, so that weights which are at the goal stay there to the bit.
        weights[i] += part * (goal[i] - weights[i])


@compiled
def room(network: Network, n: int) -> Activations:
    """Return room for the outputs of all layers for n rows."""
    h, q = network.w3.shape
    return Activations(
        np.empty((n, h), network.weights.dtype),
        np.empty((n, h), network.weights.dtype),
        np.empty((n, q), network.weights.dtype),
    )


@compiled
def outputs(network: Network, x: Float32s) -> Float32s:
    """Return the network's outputs for each row of x [n, p], shape [n, q]."""
    at = room(network, x.shape[0])
    forward(network, x, at)
    return at.out


class StretchRows(NamedTuple):
    """Stretches of n steps, one row each."""

    observations: Float32s  # [N, d] o, scaled
    actions: Integers  # [N] a
    earned: Float32s  # [N] discounted sum of the rewards of the stretch
    later: Float32s  # [N, d] observation at its end, scaled
    discounts: Float32s  # [N] weight of the value there: gamma^n, or 0 where the task ended
    allowed: Booleans  # [N, A] which actions are allowed there


class Learning(NamedTuple):
    """Networks under learning and the averages of Adam; all change in place."""

    online: Network
    target: Network
    average: Network
    gradient: Network
    mean: Float32s  # [P]
    square: Float32s  # [P]


class Rates(NamedTuple):
    """Rates at which weights move, and limits of errors and gradients."""

    target: float  # share of the way that the target moves to the online weights
    average: float  # the same of the average
    error: float  # largest temporal difference that counts
    norm: float  # largest norm of a gradient


@compiled
def take_batch(experience: StretchRows, rows: Integers, x: Float32s, later: Float32s) -> None:
    """Write the observations of some rows, and those at the ends of their stretches."""
    for i in range(rows.size):
        for j in range(x.shape[1]):
            x[i, j] = experience.observations[rows[i], j]
            later[i, j] = experience.later[rows[i], j]


@compiled
def best(values: Floats, allowed: Booleans) -> int:
    """Return the first of the largest values of actions that are allowed, at least one."""
    chosen = -1
    for a in range(values.size):
        if allowed[a] and (chosen < 0 or values[a] > values[chosen]):
            chosen = a
    return chosen


@compiled
def action_values(out: Float32s, n_actions: int, values: Floats) -> None:
    """Write the mean of each action's quantiles, from outputs [n, A m] to values [n, A]."""
    m = out.shape[1] // n_actions
    for i in range(out.shape[0]):
        for a in range(n_actions):
            total = 0.0
            for k in range(a * m, (a + 1) * m):
                total += out[i, k]
            values[i, a] = total / m


@compiled
def quantile_errors(quantiles: Float32s, goals: Floats, limit: float, error: Float32s) -> None:
    """Write the derivatives of the loss of quantile regression (Dabney et al. 2018, Eq. 10).

    The k-th of m quantiles is to have a share (k + 1/2) / m of the goals below it. Squares are
    linear beyond ``limit``. A single quantile has the squared error of DQN. All arrays are [m],
    and the goals are equally likely returns.
    """
    m = quantiles.size
    for k in range(m):
        below = (k + 0.5) / m
        total = 0.0
        for j in range(m):
            difference = quantiles[k] - goals[j]
            weight = below if difference < 0.0 else 1.0 - below
            total += weight * min(max(difference, -limit), limit)
        error[k] = 2.0 * total / m


@compiled
def update(
    learning: Learning,
    experience: StretchRows,
    rows: Integers,  # [U, B] rows of each update's batch
    steps: Floats,  # [U] step size of each update
    number: int,
    rates: Rates,
) -> None:
    """Make U updates of Double DQN (van Hasselt, Guez and Silver 2016, Eq. 4).

    The online network chooses the action at the end of a stretch, the target network values it. An
    action has m outputs, the quantiles of its return. ``number`` is how many updates were made
    before.
    """
    n, n_actions = rows.shape[1], experience.allowed.shape[1]
    dtype = learning.online.weights.dtype
    x = np.empty((n, experience.observations.shape[1]), dtype)
    later = np.empty_like(x)
    at, at_target = room(learning.online, n), room(learning.online, n)
    m = at.out.shape[1] // n_actions
    values = np.empty((n, n_actions), np.float64)
    chosen = np.empty(n, np.int64)
    goals = np.empty((n, m), np.float64)
    error = np.empty_like(at.out)
    for u in range(rows.shape[0]):
        take_batch(experience, rows[u], x, later)
        forward(learning.online, later, at)
        action_values(at.out, n_actions, values)
        # Chosen by one network and valued by the other: no action is valued by the noise that chose
        # it. Where the task ended the discount is 0.
        for i in range(n):
            chosen[i] = best(values[i], experience.allowed[rows[u, i]])
        forward(learning.target, later, at_target)
        for i in range(n):
            row = rows[u, i]
            for k in range(m):
                value = at_target.out[i, chosen[i] * m + k]
                goals[i, k] = experience.earned[row] + experience.discounts[row] * value
        # Last of the forward passes, for ``backward`` needs the outputs of the layers for x.
        forward(learning.online, x, at)
        # Only the action that was taken has a target.
        error[:] = 0
        for i in range(n):
            begin = experience.actions[rows[u, i]] * m
            of_action = error[i, begin : begin + m]
            quantile_errors(at.out[i, begin : begin + m], goals[i], rates.error, of_action)
            for k in range(m):
                of_action[k] /= n
        backward(learning.online, x, at, error, learning.gradient)
        limit_norm(learning.gradient.weights, rates.norm)
        adam_step(
            learning.online.weights,
            learning.gradient.weights,
            learning.mean,
            learning.square,
            number + u + 1,
            steps[u],
        )
        move_towards(learning.target.weights, learning.online.weights, rates.target)
        move_towards(learning.average.weights, learning.online.weights, rates.average)


@compiled
def greedy_action(network: Network, x: Float32s, allowed: Booleans) -> int:
    """Return the allowed action of the largest value at one observation, scaled, shape [1, d]."""
    at = room(network, 1)
    forward(network, x, at)
    values = np.empty((1, allowed.size), np.float64)
    action_values(at.out, allowed.size, values)
    return best(values[0], allowed)
