"""Intervals by formula: of a mean over many episodes, of a share of successes.

Over learning runs, which are few and far from normal, use SciPy's bootstrap.

References: E. B. Wilson, *Probable inference, the law of succession, and statistical inference*,
JASA 22 (1927); M. Abramowitz, I. A. Stegun, *Handbook of Mathematical Functions*, 26.7.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eutree.validation import check_integer, check_number, check_vector

NORMAL = NormalDist()
_MANY = 200  # degrees of freedom from which an expansion about the normal quantile is as good


class Interval(NamedTuple):
    """Both ends of an interval."""

    low: float
    high: float


@dataclass(frozen=True)
class Estimate:
    """A statistic with its interval.

    Attributes:
        value: The statistic itself.
        interval: Where it lies with the confidence asked for.
        n: How many runs, or pairs of runs, it is made of.
    """

    value: float
    interval: Interval
    n: int


def check_confidence(confidence: float) -> float:
    """Return the confidence as a number inside (0, 1), or raise."""
    return check_number("confidence", confidence, low=0, high=1, low_open=True, high_open=True)


def mean_interval(values: ArrayLike, *, confidence: float = 0.95) -> Interval:
    """Return Student's interval of a mean; a single value shows no spread and is its own."""
    sample = check_vector("values", values)
    confidence = check_confidence(confidence)
    center = float(sample.mean())
    if sample.size == 1:
        return Interval(center, center)
    quantile = student_quantile(0.5 + confidence / 2, sample.size - 1)
    spread = quantile * float(sample.std(ddof=1)) / math.sqrt(sample.size)
    return Interval(center - spread, center + spread)


def wilson_interval(successes: int, n: int, *, confidence: float = 0.95) -> Interval:
    """Return Wilson's score interval of a share of successes among ``n`` trials.

    It stays inside [0, 1], and is right where all trials, or none, succeeded.
    """
    n = check_integer("n", n, low=1)
    successes = check_integer("successes", successes, high=n)
    z = NORMAL.inv_cdf(0.5 + check_confidence(confidence) / 2)
    share, weight = successes / n, z * z / n
    center = (share + weight / 2) / (1 + weight)
    spread = z * math.sqrt((share * (1 - share) + weight / 4) / n) / (1 + weight)
    low = 0.0 if successes == 0 else center - spread
    return Interval(low, 1.0 if successes == n else center + spread)


def student_quantile(probability: float, freedom: int) -> float:
    """Return a quantile of Student's t with ``freedom`` degrees of freedom."""
    freedom = check_integer("freedom", freedom, low=1)
    check_number("probability", probability, low=0, high=1, low_open=True, high_open=True)
    if freedom > _MANY:
        z = NORMAL.inv_cdf(probability)
        first = (z**3 + z) / 4
        second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
        third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
        return z + first / freedom + second / freedom**2 + third / freedom**3
    low, high = -math.pi / 2, math.pi / 2
    for _ in range(60):
        middle = (low + high) / 2
        if _student_cdf(middle, freedom) < probability:
            low = middle
        else:
            high = middle
    return math.sqrt(freedom) * math.tan((low + high) / 2)


def _student_cdf(angle: float, freedom: int) -> float:
    """Return P(T <= t) for angle = arctan(t / sqrt(freedom)) (Abramowitz & Stegun 26.7.3, 4)."""
    odd = freedom % 2
    powers = np.arange(odd + 2, freedom, 2)  # of the cosine, after the first
    factors = np.cumprod((powers - 1) / powers) * np.cos(angle) ** powers
    if odd:
        series = math.cos(angle) * (freedom > 1) + float(factors.sum())
        inside = 2 / math.pi * (angle + math.sin(angle) * series)
    else:
        inside = math.sin(angle) * (1.0 + float(factors.sum()))
    return 0.5 + inside / 2
