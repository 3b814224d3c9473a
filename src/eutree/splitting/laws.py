"""The laws of the tests: of one cut as if it had been fixed before, and of the best of all cuts.

``naive_p`` is the two-sample Kolmogorov-Smirnov test of the stopping criterion of the paper, read
literally; the best of many cuts is not a fixed cut, and on noise this p-value is far too small.
"""

import math
from bisect import bisect_right
from functools import lru_cache

import numpy as np

from eutree.splitting._maximal_ks_table import SIZES, TAILS, VALUES, VALUES_SHARE_10
from eutree.validation import check_integer, check_number

_TERMS = 100
_SMALLEST = 0.04  # below it 1 - Q is under 1e-300 and the alternating series needs many terms


def naive_p(statistic: float, n_left: int, n_right: int) -> float:
    """Return the chance that two samples of one continuous distribution are at least D apart.

    It is the limit law at (sqrt(e) + 0.12 + 0.11 / sqrt(e)) * D with e = n_left * n_right /
    (n_left + n_right), Stephens' correction.

    Args:
        statistic: D, from 0 to 1.
        n_left: Size of one sample.
        n_right: Size of the other sample.
    """
    check_number("statistic", statistic, low=0.0, high=1.0)
    check_integer("n_left", n_left, low=1)
    check_integer("n_right", n_right, low=1)
    root = math.sqrt(n_left * n_right / (n_left + n_right))
    return kolmogorov_tail((root + 0.12 + 0.11 / root) * statistic)


def kolmogorov_tail(x: float) -> float:
    """Return Q(x) = 2 * sum over j of (-1)^(j - 1) exp(-2 j^2 x^2), Kolmogorov's limit law."""
    if x < _SMALLEST:
        return 1.0
    if x < 1.0:  # the other expansion of the same theta function converges fast here
        terms = (math.exp(-(((2 * j - 1) * math.pi / x) ** 2) / 8) for j in range(1, 8))
        return 1.0 - math.sqrt(2 * math.pi) / x * math.fsum(terms)
    total = 0.0
    for j in range(1, _TERMS):
        term = math.exp(-2.0 * (j * x) ** 2)
        if term == 0.0:
            break
        total += term if j % 2 else -term
    return 2.0 * total


# Under the null hypothesis the maximum of K over the cuts of one attribute is a rank statistic:
# with no ties it has one distribution for each number n of tuples, for returns of any distribution.
# The table comes from ``benchmarks/maximal_ks_table.py``. Values are interpolated linearly in log
# n; between tabulated tail probabilities log p is linear in K^2. Beyond the smallest one,
#
#     p(K) = p0 * (K / K0)^2 * exp(-2 (K^2 - K0^2)),
#
# the tail of one two-sample test times the usual factor K^2 of a maximum over a continuum of
# cuts. Below the smallest tabulated n the table is used as it stands there, which is
# conservative, and so is the table under ties; beyond the largest one the values hardly grow and
# the last row is used. A minimum share per side lowers the values a little; a second table for 10
# % is used where the minimum side is at least that.


_SHARE = 0.1
_LOG_SIZES: list[float] = np.log(SIZES).tolist()
_LOG_TAILS = np.log((1.0, *TAILS))


@lru_cache(maxsize=4096)
def quantiles(n: int, min_side: int = 1) -> tuple[float, ...]:
    """Return the values of max K that noise exceeds with the probabilities ``TAILS``."""
    table = VALUES_SHARE_10 if min_side >= _SHARE * n else VALUES
    logs = _LOG_SIZES
    at = math.log(min(max(n, SIZES[0]), SIZES[-1]))
    low = min(bisect_right(logs, at), len(SIZES) - 1) - 1
    part = (at - logs[low]) / (logs[low + 1] - logs[low])
    return tuple(float(a + part * (b - a)) for a, b in zip(table[low], table[low + 1], strict=True))


def maximal_p(scaled_statistic: float, n: int, *, min_side: int = 1) -> float:
    """Return the chance that the best cut of one attribute reaches K on noise.

    Args:
        scaled_statistic: K of the best cut, at least 0.
        n: Number of tested tuples.
        min_side: Fewest tuples on each side of a cut.
    """
    check_number("scaled_statistic", scaled_statistic, low=0.0)
    check_integer("n", n, low=2)
    check_integer("min_side", min_side, low=1)
    squares = [0.0] + [value * value for value in quantiles(n, min_side)]
    square = scaled_statistic * scaled_statistic
    if square > squares[-1]:
        return TAILS[-1] * (square / squares[-1]) * math.exp(-2.0 * (square - squares[-1]))
    return math.exp(float(np.interp(square, squares, _LOG_TAILS)))


def critical_value(n: int, alpha: float, *, min_side: int = 1) -> float:
    """Return the K with ``maximal_p(K, n) == alpha``, the inverse of that function."""
    check_number("alpha", alpha, low=0.0, high=1.0, low_open=True)
    check_integer("n", n, low=2)
    check_integer("min_side", min_side, low=1)
    return _critical_value(n, alpha, min_side)


@lru_cache(maxsize=4096)
def _critical_value(n: int, alpha: float, min_side: int) -> float:
    squares = [0.0] + [value * value for value in quantiles(n, min_side)]
    if alpha >= TAILS[-1]:
        return math.sqrt(float(np.interp(-math.log(alpha), -_LOG_TAILS, squares)))
    # p is decreasing beyond the table (its K exceeds 1), so a fixed point iteration converges.
    square = last = squares[-1]
    for _ in range(60):
        square = last + 0.5 * (math.log(TAILS[-1] / alpha) + math.log(square / last))
    return math.sqrt(square)
