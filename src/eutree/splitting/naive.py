"""The p-value of a two-sample Kolmogorov-Smirnov test of one cut, as if it had been fixed before.

The best of many cuts is not a fixed cut: on noise this p-value is far too small. It is what the
paper's stopping criterion uses, read literally.
"""

import math
from typing import Literal

from eutree.splitting._kernels_lattice import chance_of_leaving
from eutree.validation import check_choice, check_integer, check_number

_TERMS = 100
_SMALLEST = 0.04  # below it 1 - Q is under 1e-300 and the alternating series needs many terms


def naive_p(
    statistic: float,
    n_left: int,
    n_right: int,
    *,
    method: Literal["asymptotic", "exact"] = "asymptotic",
) -> float:
    """Return the chance that two samples of one continuous distribution are at least D apart.

    Args:
        statistic: D, from 0 to 1.
        n_left: Size of one sample.
        n_right: Size of the other sample.
        method: ``"asymptotic"`` uses the limit law at (sqrt(e) + 0.12 + 0.11 / sqrt(e)) * D with
            e = n_left * n_right / (n_left + n_right), Stephens' correction; ``"exact"`` counts
            lattice paths in time n_left * n_right.
    """
    check_number("statistic", statistic, low=0.0, high=1.0)
    check_integer("n_left", n_left, low=1)
    check_integer("n_right", n_right, low=1)
    check_choice("method", method, ("asymptotic", "exact"))
    if method == "exact":
        lattice = n_left * n_right // math.gcd(n_left, n_right)
        steps = round(statistic * lattice)
        return chance_of_leaving(n_left, n_right, steps * (n_left * n_right // lattice))
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
