"""Bounds of a mean that are true for bounded values, however rare the bad ones are.

Student's interval has no width where a rare loss has not been seen, so it promises too much. Here
the mean of values that are never below ``worst`` is tested by betting: a gambler starts with 1,
stakes a share of the wealth before each value x, and holds

    K_n(m) = prod_i (1 + stake * (x_i - m)),        0 <= stake <= 1 / (m - worst).

If the mean is m or less, K is a nonnegative supermartingale: by Ville's inequality it ever reaches
1 / error with probability ``error`` at most. So every m with K_n(m) >= 1 / error may be ruled out,
*whenever* one looks, and after any number of looks. A mixture of stakes is such a process too. The
smallest mean that is not ruled out is a lower bound; where all values are equal it lies about
``log(1 / error) / n`` of the range below them: the rule of three.

Reference: I. Waudby-Smith, A. Ramdas, *Estimating means of bounded random variables by betting*,
JRSS B 86 (2024), sections 2 to 4.
"""

import math
import sys

import numpy as np

from eutree.arrays import Floats

_SHARES = 0.5 ** np.arange(11.0)  # of the largest stake; the mixture where nothing is known
TUNED = 0.5  # weight of a tuned stake
_BISECTIONS = 50


def log_wealth(values: Floats, mean: float, worst: float, stake: float | None = None) -> float:
    """Return log K_n(mean): how strongly values [n] speak against a mean this low or lower.

    The mean is above ``worst``, than which no value can be lower. The mixture gives half of the
    weight to a ``stake`` that was tuned on other values.
    """
    largest = 1.0 / (mean - worst)
    stakes = _SHARES * largest
    weights = np.full(stakes.size, 1.0 / stakes.size)
    if stake is not None:
        stakes = np.append(stakes, min(stake, largest))
        weights = np.append(weights * (1.0 - TUNED), TUNED)
    return float(np.logaddexp.reduce(_log_products(values, mean, stakes) + np.log(weights)))


def log_wealth_path(
    values: Floats, mean: float, worst: float | Floats, stake: float | None = None
) -> Floats:
    """Return log K_1(mean), log K_2(mean) ...: the wealth after every value, shape [..., n].

    The values are those of one gambler, or of many; ``worst`` is one for all of them, or one for
    each, shape [..., 1]. See :func:`log_wealth`.
    """
    largest = 1.0 / (mean - worst)
    stakes = [share * largest for share in _SHARES.tolist()]
    weights = [1.0 / len(stakes)] * len(stakes)
    if stake is not None:
        stakes.append(np.minimum(stake, largest))
        weights = [*((1.0 - TUNED) * weight for weight in weights), TUNED]
    wealth = np.full(values.shape, -np.inf)
    for one, weight in zip(stakes, weights, strict=True):
        with np.errstate(divide="ignore"):  # a value below ``worst`` ruins the largest stakes
            logs = np.log(np.maximum(1.0 + one * (values - mean), 0.0))
        np.logaddexp(wealth, np.cumsum(logs, axis=-1) + math.log(weight), out=wealth)
    return wealth


def tuned_stake(values: Floats, mean: float, worst: float) -> tuple[float, float]:
    """Return the stake that would have grown the wealth most, and its growth for each value.

    One value of ``worst`` is added to those seen: what has not happened in n episodes may well
    happen once in the next n. So nothing is promising before n exceeds what is at stake.
    """
    seen = np.append(values, worst)
    stakes = np.linspace(0.0, 1.0 / (mean - worst), 41)[:-1]
    growth = _log_products(seen, mean, stakes) / seen.size
    best = int(growth.argmax())
    return float(stakes[best]), float(growth[best])


def lower_bound(values: Floats, worst: float, error: float, stake: float | None = None) -> float:
    """Return a lower bound of the mean that is wrong with probability ``error`` at most.

    It may be looked at after every value: all these bounds together are wrong no more often. The
    values [n] are independent and of one mean. See :func:`log_wealth`.
    """
    enough = -math.log(error)
    low, high = worst, float(values.mean()) if values.size else worst
    if not high > low:
        return worst
    for _ in range(_BISECTIONS):  # K falls with m: below `low` all is ruled out, above `high` none
        middle = (low + high) / 2
        if middle in (low, high):
            break
        if log_wealth(values, middle, worst, stake) >= enough:
            low = middle
        else:
            high = middle
    return low


def episodes_needed(margin: float, worst: float, error: float) -> int:
    """Return after how many episodes without any difference a margin can be confirmed at best."""
    if margin <= 0:
        raise ValueError(f"margin must be above 0, got {margin}")
    if -margin <= worst:
        return 0
    growth = -math.log1p(-margin / -worst)  # of the largest stake, at values of 0
    enough = -math.log(error) - math.log(TUNED)
    if growth * sys.maxsize < enough:  # no number of episodes tells so small a margin from 0
        return sys.maxsize
    return math.ceil(enough / growth)


def _log_products(values: Floats, mean: float, stakes: Floats) -> Floats:
    """Return the log wealth of each stake; a value below ``worst`` ruins the largest stakes."""
    with np.errstate(divide="ignore"):
        factors = np.maximum(1.0 + stakes[:, None] * (values - mean)[None, :], 0.0)
        logs: Floats = np.log(factors).sum(axis=1)
    return logs
