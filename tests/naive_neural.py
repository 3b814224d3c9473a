"""Slow, obvious twins of the compiled loops of eutree.neural and of neural world models."""

import numpy as np


def forward(network, x):
    """Return what the layers put out, from matrix products."""
    hidden1 = np.maximum(x @ network.w1 + network.b1, 0.0)
    hidden2 = np.maximum(hidden1 @ network.w2 + network.b2, 0.0)
    return hidden1, hidden2, hidden2 @ network.w3 + network.b3


def add_rows(w, x, active, out):
    """Add x[k] times row k of w, four rows to a term, the rest one by one."""
    whole = len(active) // 4 * 4
    for t in range(0, whole, 4):
        a, b, c, d = (x[k] * w[k] for k in active[t : t + 4])
        out = out + (((a + b) + c) + d)
    for k in active[whole:]:
        out = out + x[k] * w[k]
    return out


def adam(weights, gradients, rate):
    """Return weights after a step of Adam for each gradient, as in the paper's Algorithm 1."""
    mean, square = np.zeros_like(weights), np.zeros_like(weights)
    for number, gradient in enumerate(gradients, start=1):
        mean = 0.9 * mean + 0.1 * gradient
        square = 0.999 * square + 0.001 * gradient**2
        unbiased = mean / (1 - 0.9**number), square / (1 - 0.999**number)
        weights = weights - rate * unbiased[0] / (np.sqrt(unbiased[1]) + 1e-8)
    return weights


def stretch(episode, begin, discount, n_steps):
    """Return rewards, end and discount of the stretch that begins at a step."""
    earned, step = 0.0, begin
    while step < len(episode) and step < begin + n_steps:
        earned += discount ** (step - begin) * episode.rewards[step]
        step += 1
    ended = step == len(episode) and episode.terminated
    return earned, step, 0.0 if ended else discount ** (step - begin)


def logistic(odds):
    """Return the probability of log-odds."""
    return 1.0 / (1.0 + np.exp(-odds))


def ensemble_loss(out, target, reward, kind, binary, weight):
    """Return one row's loss of a world model's outputs, the variance's error held fixed apart.

    Returns:
        What the mean, the binary features, the rewards and the ends cost, and what the variances
        cost: the latter is not to be differentiated by the means.
    """
    d = len(binary)
    first, second = 0.0, 0.0
    for j in range(d):
        if binary[j]:
            p = logistic(out[j])
            first -= np.log(p if target[j] else 1 - p)
        else:
            error = out[j] - target[j]
            first += 0.5 * error**2 if abs(error) <= 3 else 3 * (abs(error) - 1.5)
            second += 0.5 * (out[d + j] + min(error**2, 9.0) * np.exp(-out[d + j]))
    error = out[2 * d + kind] - reward
    first += 0.5 * error**2 if abs(error) <= 3 else 3 * (abs(error) - 1.5)
    for end in (1, 2):
        p = logistic(out[2 * d + 2 + end])
        first -= (weight if kind else 1.0) * np.log(p if kind == end else 1 - p)
    return first, second


def ensemble_step(world, draws, at, member, action, state, derivation=None):
    """Return next state, reward and whether the step was the last, by the obvious formulas."""
    members, scales = world.members, world.scales
    d = len(scales.move)
    x = np.concatenate(
        [
            (state[: len(scales.centre)] - scales.centre) / scales.spread,
            np.eye(members.w1.shape[1] - len(scales.centre))[action],
        ]
    )
    hidden = np.maximum(x @ members.w1[member] + members.b1[member], 0)
    hidden = np.maximum(hidden @ members.w2[member] + members.b2[member], 0)
    out = hidden @ members.w3[member] + members.b3[member]
    after = np.empty(2 * d)
    for i in range(d):
        place = (at + i) % draws.uniform.size
        if scales.binary[i]:
            above = draws.uniform[place] < logistic(out[i])
            after[i] = scales.high[i] if above else scales.low[i]
        else:
            noise = draws.normal[place] * np.exp(0.5 * np.clip(out[d + i], -8, 3))
            move = np.clip(scales.move[i] * (out[i] + noise), *scales.moves[i])
            after[i] = np.clip(state[i] + move, scales.low[i], scales.high[i])
    for pair in scales.circles.tolist():
        after[pair] *= np.linalg.norm(state[pair]) / np.linalg.norm(after[pair])
    if derivation is not None:
        after[:d] = derivation.rows(after[: derivation.n_measured], state[:d])
    after[d:] = after[:d] - state[:d]
    draw = draws.uniform[(at + d) % draws.uniform.size]
    kind = 0
    if draw < logistic(out[2 * d + 3]):
        kind = 1
    elif 1 - draw <= logistic(out[2 * d + 4]):
        kind = 2
    mean, unit, low, high = scales.earned[kind]
    return after, float(np.clip(mean + unit * out[2 * d + kind], low, high)), kind > 0


def action_values(out, n_actions):
    """Return the mean output of each action."""
    return np.array([[part.mean() for part in np.split(row, n_actions)] for row in out])


def quantile_loss(quantiles, goals, limit):
    """Return the loss of quantile regression, twice the paper's and not divided by ``limit``."""
    loss = 0.0
    for k, quantile in enumerate(quantiles):
        below = (k + 0.5) / len(quantiles)
        for goal in goals:
            error = abs(goal - quantile)
            huber = 0.5 * error**2 if error <= limit else limit * (error - 0.5 * limit)
            loss += 2.0 * (below if goal > quantile else 1.0 - below) * huber
    return loss / len(goals)
