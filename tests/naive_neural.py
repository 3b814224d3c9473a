"""Slow, obvious twins of the compiled loops of eutree.neural and of neural world models."""

import numpy as np


def forward(network, x):
    """Return what the layers put out, from matrix products."""
    hidden1 = np.maximum(x @ network.w1 + network.b1, 0.0)
    hidden2 = np.maximum(hidden1 @ network.w2 + network.b2, 0.0)
    return hidden1, hidden2, hidden2 @ network.w3 + network.b3


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
