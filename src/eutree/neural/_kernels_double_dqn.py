"""Compiled loop of Double DQN: one update after another, nothing in between."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Float32s, Floats, Integers
from eutree.compiled import compiled
from eutree.neural._kernels import (
    Network,
    adam_step,
    backward,
    forward,
    limit_norm,
    move_towards,
    room,
)


class Experience(NamedTuple):
    """Stretches of n steps, one row each."""

    observations: Float32s  # [N, d] o, scaled
    actions: Integers  # [N] a
    earned: Float32s  # [N] discounted sum of the rewards of the stretch
    later: Float32s  # [N, d] observation at its end, scaled
    discounts: Float32s  # [N] what the value there counts: gamma^n, or 0 where the task ended


class Learning(NamedTuple):
    """Networks under learning and the averages of Adam; all change in place."""

    online: Network
    target: Network
    average: Network
    gradient: Network
    mean: Float32s  # [P]
    square: Float32s  # [P]


class Rates(NamedTuple):
    """How fast what moves, and what is cut."""

    target: float  # share of the way that the target moves to the online weights
    average: float  # the same of the average
    error: float  # largest temporal difference that counts
    norm: float  # largest norm of a gradient


@compiled
def take_batch(experience: Experience, rows: Integers, x: Float32s, later: Float32s) -> None:
    """Write the observations of some rows, and those at the ends of their stretches."""
    for i in range(rows.size):
        for j in range(x.shape[1]):
            x[i, j] = experience.observations[rows[i], j]
            later[i, j] = experience.later[rows[i], j]


@compiled
def best(values: Float32s) -> int:
    """Return the first of the largest values."""
    chosen = 0
    for a in range(1, values.size):
        if values[a] > values[chosen]:
            chosen = a
    return chosen


@compiled
def update(
    learning: Learning,
    experience: Experience,
    rows: Integers,  # [U, B] rows of each update's batch
    steps: Floats,  # [U] step size of each update
    number: int,
    rates: Rates,
) -> None:
    """Make U updates of Double DQN (van Hasselt, Guez and Silver 2016, Eq. 4).

    The online network chooses the action at the end of a stretch, the target network values it. The
    squared error is linear beyond ``rates.error``, as in DQN. ``number`` is how many updates were
    made before.
    """
    n = rows.shape[1]
    dtype = learning.online.weights.dtype
    x = np.empty((n, experience.observations.shape[1]), dtype)
    later = np.empty_like(x)
    at, at_target = room(learning.online, n), room(learning.online, n)
    chosen = np.empty(n, np.int64)
    goal = np.empty(n, np.float64)
    error = np.empty_like(at.out)
    for u in range(rows.shape[0]):
        take_batch(experience, rows[u], x, later)
        forward(learning.online, later, at)
        # Chosen by one network and valued by the other: no action is valued by the noise that chose
        # it. Where the task ended the discount is 0.
        for i in range(n):
            chosen[i] = best(at.out[i])
        forward(learning.target, later, at_target)
        for i in range(n):
            row = rows[u, i]
            value = at_target.out[i, chosen[i]]
            goal[i] = experience.earned[row] + experience.discounts[row] * value
        # Last of the forward passes, for ``backward`` needs what the layers put out for x.
        forward(learning.online, x, at)
        # Only the action that was taken has a target.
        error[:] = 0
        for i in range(n):
            action = experience.actions[rows[u, i]]
            difference = at.out[i, action] - goal[i]
            error[i, action] = min(max(difference, -rates.error), rates.error) / n
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
def greedy_action(network: Network, x: Float32s) -> int:
    """Return the action of the largest value at one observation, scaled, shape [1, d]."""
    at = room(network, 1)
    forward(network, x, at)
    return best(at.out[0])
