"""Compiled loops of the neural world model: fitting its members.

One output vector of a member, for d features, reads

    0 .. d - 1       mean displacement, scaled; of a binary feature the log-odds of its upper value
    d .. 2 d - 1     logarithm of the displacement's variance, scaled; unused where it is binary
    2 d + KIND       reward, scaled, of a step that goes on, ends badly, ends well
    2 d + 2 + KIND   log-odds of a bad and of a good end

so that good and bad ends have a head each: one head would predict the mean of both, which no step
ever earns.
"""

import math
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Float32s, Floats, Integers
from eutree.compiled import compiled, overwrite
from eutree.neural import Network, adam_step, backward, forward, room

GOES_ON, BAD, GOOD = 0, 1, 2  # kinds of step
# Weight of an end at the observation it led to: enough to be learned where no step was ever taken,
# and little beside the steps that went on from there, if there are any.
AGAIN = 0.1
FAR = 3.0  # scaled errors count linearly from here on (Huber)
LEAST_LOG_VARIANCE, MOST_LOG_VARIANCE = -8.0, 3.0


class Steps(NamedTuple):
    """The rows that a member is fitted to: one for each transition, then one for each end's o'."""

    inputs: Float32s  # [N + E, p]
    targets: Float32s  # [N, d] scaled displacement, or 0 and 1 where the feature is binary
    rewards: Float32s  # [N + E] scaled as those of its kind
    kind: Integers  # [N + E] GOES_ON, BAD or GOOD
    binary: Booleans  # [d]


class Fitting(NamedTuple):
    """A member under fitting; all changes in place."""

    network: Network
    gradient: Network
    mean: Float32s  # [P] Adam's
    square: Float32s  # [P] Adam's


class Scales(NamedTuple):
    """The units of the networks' inputs and outputs."""

    centre: Floats  # [p - A] mean of each input that is no action
    spread: Floats  # [p - A] its standard deviation and a twentieth of its range
    move: Floats  # [d] displacement that counts 1
    moves: Floats  # [d, 2] least and largest displacement, a few in ten thousand left out
    binary: Booleans  # [d] which features have two values only
    circles: Integers  # [C, 2] pairs of features that stay on a circle, as cosine and sine do
    low: Floats  # [d] least value of each feature
    high: Floats  # [d] largest value of each feature
    earned: Floats  # [3, 4] mean, unit, least and largest reward of each kind of step


@compiled
def logistic(odds: float) -> float:
    """Return the probability of log-odds, without overflow."""
    # The other side needs no bound: exp of a large negative number is 0.
    return 1.0 / (1.0 + math.exp(min(-odds, 40.0)))


@compiled
def write_error(
    steps: Steps, rows: Integers, weight: float, out: Float32s, error: Float32s
) -> None:
    """Write the derivative of the mean loss by each output.

    Displacements: Huber's loss of the mean, and for the variance the normal likelihood of the error
    as it is: it does not pull at the mean, which would buy likelihood by forgetting rare steps.
    Binary features and ends: cross-entropy. Rewards: Huber's loss in the head of the step's kind.

    ``rows`` [n] are the batch, ``out`` its outputs [n, q]. A row that ends counts ``weight`` for
    the log-odds of ends: there are more of them in a batch than among the steps.
    """
    n, d = rows.size, steps.binary.size
    error[:] = 0
    for i in range(n):
        row = rows[i]
        for j in range(d if row < len(steps.targets) else 0):
            if steps.binary[j]:
                error[i, j] = (logistic(out[i, j]) - steps.targets[row, j]) / n
                continue
            # The derivative of Huber's loss: the difference, cut where errors count linearly.
            difference = out[i, j] - steps.targets[row, j]
            error[i, j] = min(max(difference, -FAR), FAR) / n
            spread = out[i, d + j]
            # Of (square exp(-v) + v) / 2 with v = log variance, the derivative by v. The same cut
            # keeps one far displacement from widening the noise of all.
            square = min(difference * difference, FAR * FAR)
            if LEAST_LOG_VARIANCE < spread < MOST_LOG_VARIANCE:
                error[i, d + j] = 0.5 * (1.0 - square * math.exp(-spread)) / n
            else:  # back into the range of the draws
                error[i, d + j] = 0.1 * spread / n
        kind = steps.kind[row]
        # The heads of the other kinds keep an error of 0: a step says nothing about them.
        difference = out[i, 2 * d + kind] - steps.rewards[row]
        error[i, 2 * d + kind] = min(max(difference, -FAR), FAR) / n
        counts = weight if kind != GOES_ON else 1.0
        if row >= len(steps.targets):
            counts *= AGAIN
        for end in (BAD, GOOD):
            # Derivative of the cross-entropy by the log-odds: probability minus outcome (0 or 1).
            probability = logistic(out[i, 2 * d + 2 + end])
            error[i, 2 * d + 2 + end] = counts * (probability - (kind == end)) / n


@compiled
def fit(
    fitting: Fitting,
    steps: Steps,
    rows: Integers,  # [U, B] rows of each update's batch
    rates: Floats,  # [U] step size of each update
    number: int,
    weight: float,
) -> None:
    """Make U updates of one member, after ``number`` others."""
    n = rows.shape[1]
    x = np.empty((n, steps.inputs.shape[1]), fitting.network.weights.dtype)
    at = room(fitting.network, n)
    error = np.empty_like(at.out)
    for u in range(rows.shape[0]):
        for i in range(n):
            overwrite(x[i], steps.inputs[rows[u, i]])
        forward(fitting.network, x, at)
        write_error(steps, rows[u], weight, at.out, error)
        backward(fitting.network, x, at, error, fitting.gradient)
        adam_step(
            fitting.network.weights,
            fitting.gradient.weights,
            fitting.mean,
            fitting.square,
            # Adam's corrections go by the number of all updates, this one included.
            number + u + 1,
            rates[u],
        )
