"""Trials to a threshold, where some runs end before they get there.

A run that never reached the level within its trials is *censored*: all that is known is that it
takes longer. Leaving such runs out, or counting them at their last trial, flatters slow learners.
Hence, with t_1 < t_2 < ... the times at which runs got there:

* Kaplan and Meier (1958): the share not yet there, S(t) = product over t_i <= t of (1 - d_i / n_i),
  d_i getting there at t_i, n_i being still on their way just before;
* its median: the first t with S(t) <= 1/2; infinite if fewer than half ever get there;
* the restricted mean: the area under S up to a horizon, the mean of min(time, horizon), which is
  always finite and is what the comparisons use.

Reference: E. L. Kaplan, P. Meier, *Nonparametric estimation from incomplete observations*, JASA 53
(1958).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Integers, frozen
from eutree.errors import InvalidArgumentError
from eutree.evaluation.bootstrap import draw_rows
from eutree.evaluation.intervals import Estimate, Interval, check_confidence
from eutree.validation import check_integer, check_number, check_vector


@dataclass(frozen=True, eq=False)
class Durations:
    """How long each run took to reach a level, or that it had not when it ended.

    Attributes:
        times: Trials until the level was reached, or until the run ended.
        reached: Whether it was reached.
    """

    times: Floats  # [N]
    reached: Booleans  # [N]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", frozen(check_vector("times", self.times)))
        object.__setattr__(self, "reached", frozen(np.asarray(self.reached, dtype=bool)))
        if self.times.shape != self.reached.shape or not self.times.size:
            raise InvalidArgumentError(
                "times and reached must have one entry for each run (at least one), got shapes "
                f"{self.times.shape} and {self.reached.shape}"
            )
        if self.times.min() < 0:
            raise InvalidArgumentError(f"times must be >= 0, got {self.times.min():g}")

    def __len__(self) -> int:
        """Return the number of runs."""
        return int(self.times.size)

    def take(self, rows: Integers) -> "Durations":
        """Return some of the runs, in this order."""
        return Durations(self.times[rows], self.reached[rows])


@dataclass(frozen=True, eq=False)
class SurvivalCurve:
    """Kaplan and Meier's share of runs that are not yet there.

    Attributes:
        times: Times at which runs got there, ascending.
        shares: S(t) from each time on, until the next.
    """

    times: Floats  # [K]
    shares: Floats  # [K]

    def __post_init__(self) -> None:
        for name in ("times", "shares"):
            object.__setattr__(self, name, frozen(np.asarray(getattr(self, name), np.float64)))

    @property
    def median(self) -> float:
        """First time at which at least half the runs are there; infinite if they never are."""
        there = self.shares <= 0.5 + 1e-12
        return float(self.times[there.argmax()]) if there.any() else math.inf

    def restricted_mean(self, horizon: float) -> float:
        """Return the mean of min(time, horizon): the area under the curve up to there."""
        inside = self.times < horizon
        edges = np.concatenate([[0.0], self.times[inside], [horizon]])
        heights = np.concatenate([[1.0], self.shares[inside]])
        return float((np.diff(edges) * heights).sum())


def trials_to_threshold(
    episodes: ArrayLike, curves: Sequence[ArrayLike], threshold: float, *, lasting: int = 1
) -> Durations:
    """Return when each run's learning curve first reached a level.

    Args:
        episodes: Trial of each point of the curves, ascending, shape [P].
        curves: Success rates or returns of each run, shape [P] each.
        threshold: The level.
        lasting: Points in a row that must be at or above it; one may be luck. The first counts.
    """
    places = check_vector("episodes", episodes)
    check_number("threshold", threshold)
    lasting = check_integer("lasting", lasting, low=1)
    times, reached = [], []
    for curve in curves:
        above = check_vector("curves", curve, size=places.size) >= threshold
        runs = np.convolve(above, np.ones(lasting), mode="valid") == lasting
        reached.append(bool(runs.any()))
        times.append(places[runs.argmax()] if runs.any() else places[-1])
    return Durations(np.array(times), np.array(reached))


def kaplan_meier(durations: Durations) -> SurvivalCurve:
    """Return the share of runs not yet there as a function of time."""
    times = np.unique(durations.times[durations.reached])
    at_risk = (durations.times >= times[:, np.newaxis]).sum(axis=1)
    there = ((durations.times == times[:, np.newaxis]) & durations.reached).sum(axis=1)
    return SurvivalCurve(times, np.cumprod(1.0 - there / at_risk))


def restricted_mean(
    durations: Durations,
    horizon: float,
    *,
    confidence: float = 0.95,
    resamples: int = 999,
    seed: int = 0,
) -> Estimate:
    """Return the mean of min(time, horizon) with its bootstrap interval."""
    check_number("horizon", horizon, low=0.0, low_open=True)
    rows = draw_rows(len(durations), resamples=resamples, seed=seed)
    drawn = [kaplan_meier(durations.take(row)).restricted_mean(horizon) for row in rows]
    value = kaplan_meier(durations).restricted_mean(horizon)
    return Estimate(value, _middle(drawn, confidence), len(durations))


def restricted_mean_ratio(
    first: Durations,
    second: Durations,
    horizon: float,
    *,
    paired: bool = True,
    confidence: float = 0.95,
    resamples: int = 999,
    seed: int = 0,
) -> Estimate:
    """Return how many times as long the first takes as the second, up to a horizon.

    Args:
        first: Durations of one learner.
        second: Durations of the other.
        horizon: Where both are cut off; the smallest last trial of all runs, usually.
        paired: Whether run i of both has the same seed; then pairs are drawn together.
        confidence: Of the bootstrap interval.
        resamples: Draws of the bootstrap.
        seed: Source of chance.
    """
    check_number("horizon", horizon, low=0.0, low_open=True)
    if paired and len(first) != len(second):
        raise InvalidArgumentError(
            f"paired durations must be as many, got {len(first)} and {len(second)}"
        )
    rows = draw_rows(len(first), resamples=resamples, seed=seed)
    others = rows if paired else draw_rows(len(second), resamples=resamples, seed=seed + 1)
    drawn = [
        _ratio(first.take(row), second.take(other), horizon)
        for row, other in zip(rows, others, strict=True)
    ]
    value = _ratio(first, second, horizon)
    return Estimate(value, _middle(drawn, confidence), len(first))


def _ratio(first: Durations, second: Durations, horizon: float) -> float:
    """Return the ratio of restricted means; 1 for 0 to 0."""
    mine = kaplan_meier(first).restricted_mean(horizon)
    theirs = kaplan_meier(second).restricted_mean(horizon)
    if theirs == 0.0:
        return 1.0 if mine == 0.0 else math.inf
    return mine / theirs


def _middle(drawn: Sequence[float], confidence: float) -> Interval:
    """Return the percentile interval of some draws; infinite ones are the largest."""
    tail = (1 - check_confidence(confidence)) / 2
    order = np.sort(np.asarray(drawn))
    low = order[math.floor(tail * (order.size - 1))]
    return Interval(float(low), float(order[math.ceil((1 - tail) * (order.size - 1))]))
