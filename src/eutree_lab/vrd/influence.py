"""Where to refine a grid: local criteria, and how much an error matters elsewhere.

Local, along the edges (a, b) of a box in axis i:

    average        mean of |V(b) - V(a)|           resolution where V is not constant
    nonlinearity   variance of |V(b) - V(a)|       where it is not linear; 0 for additive V
    disagreement   share of edges whose ends act differently, times the edge's length
    combined       the boxes that nonlinearity or disagreement nominates

Global, with P the discounted transitions of the greedy policy:

    influence of corners on a set    I = chi + P^T I                    (dV(set) / dR)
    variance due to interpolation    s2 = e + discount^2 P s2, e = sum_y p (discount V(y) + R - V)^2

    stdev_inf      sqrt(s2) I, on the boxes where actions change
    starts         sqrt(s2) I, on given states: the starts of the demonstrations

The names of the criteria are those of Munos and Moore (2002), the last one is our own (VRDP, A. W.
Moore 1991, refines along a trajectory that must be guessed; a demonstration is one). A global
criterion scores a box by the mean of its corners, and cuts the axis with the largest average.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError
from eutree.validation import check_choice, check_number
from eutree_lab.vrd import _kernels_corners as kernels
from eutree_lab.vrd.corner_process import Solved
from eutree_lab.vrd.kuhn import Grid

TOLERANCE, MOST_ROUNDS = 1e-10, 100_000
THINNEST = 2.0**-20  # side, as a share of the whole, below which nothing is halved

Scores: TypeAlias = Callable[[Solved, Floats], Floats]  # and starts [S, d] to [L, d]


def influence(solved: Solved, source: Floats) -> Floats:
    """Return the influence of each corner on a weighted set of corners, both [C]."""
    successor, weight, discount, _ = solved.process.chosen(solved.policy)
    total: Floats = np.empty(len(source))
    kernels.influence(
        successor, weight * discount[:, np.newaxis], source, TOLERANCE, MOST_ROUNDS, total
    )
    return total


def variance(solved: Solved) -> Floats:
    """Return the variance of the discounted sum that interpolation causes, of each corner [C]."""
    successor, weight, discount, reward = solved.process.chosen(solved.policy)
    values = solved.values
    ahead = discount[:, np.newaxis] * values[successor] + reward[:, np.newaxis]
    own = (weight * (ahead - (weight * ahead).sum(axis=1, keepdims=True)) ** 2).sum(axis=1)
    total: Floats = own.copy()
    kernels.variance(successor, weight, discount, own, TOLERANCE, MOST_ROUNDS, total)
    return total


def average(solved: Solved, starts: Floats) -> Floats:
    """Return the mean difference of values along the edges of each axis, shape [L, d]."""
    return _by_axis(solved.grid, lambda a, b: _differences(solved, a, b).mean(axis=1))


def nonlinearity(solved: Solved, starts: Floats) -> Floats:
    """Return the variance of that difference over the edges of each axis, shape [L, d]."""
    if solved.grid.tree.n_features < 2:
        raise InvalidArgumentError(
            "the criterion 'nonlinearity' must have at least 2 features, got 1: "
            "a box has only one edge then"
        )
    return _by_axis(solved.grid, lambda a, b: _differences(solved, a, b).var(axis=1))


def disagreement(solved: Solved, starts: Floats) -> Floats:
    """Return the share of edges whose ends act differently times their length, shape [L, d]."""
    policy = solved.policy
    share = _by_axis(solved.grid, lambda a, b: (policy[a] != policy[b]).mean(axis=1))
    lengths: Floats = share * (solved.grid.high - solved.grid.low) / solved.grid.span
    return lengths


def combined(solved: Solved, starts: Floats) -> Floats:
    """Return ranks: the better of those by nonlinearity and by disagreement, shape [L, d]."""
    ranks = []
    for scores in (nonlinearity(solved, starts), disagreement(solved, starts)):
        order = np.argsort(np.argsort(scores, axis=None, kind="stable")).reshape(scores.shape)
        ranks.append(np.where(scores > 0.0, 1.0 + order, 0.0))
    better: Floats = np.maximum(*ranks)
    return better


def stdev_inf(solved: Solved, starts: Floats) -> Floats:
    """Return deviation times influence on the boundary of change of control, shape [L, d]."""
    chi = np.zeros(solved.grid.n_corners)
    chi[np.unique(solved.grid.corner_of[_undecided(solved)])] = 1.0
    return _weighed(solved, np.sqrt(variance(solved)) * influence(solved, chi))


def on_starts(solved: Solved, starts: Floats) -> Floats:
    """Return deviation times influence on given states [S, d], shape [L, d]."""
    if not len(starts):
        raise InvalidArgumentError("the criterion 'starts' must have demonstrated starts, got none")
    corner, weight = solved.grid.weights(starts)
    chi = np.bincount(corner.ravel(), weight.ravel(), minlength=solved.grid.n_corners)
    return _weighed(solved, np.sqrt(variance(solved)) * influence(solved, chi / len(starts)))


CRITERIA: dict[str, Scores] = {
    "average": average,
    "nonlinearity": nonlinearity,
    "disagreement": disagreement,
    "combined": combined,
    "stdev_inf": stdev_inf,
    "starts": on_starts,
}


def refined(solved: Solved, criterion: str, share: float, starts: Floats) -> Grid:
    """Return the grid with the share of boxes that score highest halved in their best axes.

    Args:
        solved: The grid, solved.
        criterion: One of ``CRITERIA``.
        share: Share of the boxes to halve, at least one; only those with a score above 0.
        starts: States that matter, shape [S, d]; used by "starts".
    """
    check_number("share", share, low=0.0, high=1.0, low_open=True)
    scores = CRITERIA[check_choice("criterion", criterion, CRITERIA)](solved, starts)
    sides = (solved.grid.high - solved.grid.low) / solved.grid.span
    scores = np.where(sides > THINNEST, scores, 0.0)
    best = scores.max(axis=1)
    order = np.argsort(-best, kind="stable")[: max(1, round(share * len(best)))]
    chosen = order[best[order] > 0.0]
    axes = scores[chosen].argmax(axis=1)
    return solved.grid.halve(list(zip(chosen.tolist(), axes.tolist(), strict=True)))


def _undecided(solved: Solved) -> Booleans:
    """Return which boxes have corners that act differently, shape [L]."""
    actions = solved.policy[solved.grid.corner_of]
    differ: Booleans = (actions != actions[:, :1]).any(axis=1)
    return differ


def _weighed(solved: Solved, at_corners: Floats) -> Floats:
    """Return a box's mean over its corners, in the axis with the largest average difference."""
    differences = average(solved, np.empty((0, 0)))
    scores = np.zeros_like(differences)
    boxes = np.arange(len(scores))
    scores[boxes, differences.argmax(axis=1)] = at_corners[solved.grid.corner_of].mean(axis=1)
    return scores


def _differences(solved: Solved, lower: Floats, upper: Floats) -> Floats:
    apart: Floats = np.abs(solved.values[upper] - solved.values[lower])
    return apart


def _by_axis(grid: Grid, score: Callable[..., Floats]) -> Floats:
    return np.stack([score(*grid.edges(axis)) for axis in range(grid.low.shape[1])], axis=1)
