"""Is one learner better than another, and does one thing follow another?

Runs on common seeds are compared in pairs: what the seeds have in common cancels. The test flips
the signs of the differences, which is exact under the hypothesis that the two learners could be
exchanged; all flips are made for up to 12 pairs, random ones for more. Ranks are compared by
Spearman's coefficient, with the interval of Bonett and Wright.

References: R. A. Fisher, *The Design of Experiments* (1935), section 21; D. G. Bonett, T. A.
Wright, *Sample size requirements for estimating Pearson, Kendall and Spearman correlations*,
Psychometrika 65 (2000).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eutree.evaluation.bootstrap import bootstrap
from eutree.evaluation.intervals import NORMAL, Estimate, Interval, check_confidence
from eutree.policy_search.rank_correlation import rank_correlation
from eutree.validation import check_seed, check_vector

_ALL_FLIPS = 12  # pairs up to which every flip of signs is made


@dataclass(frozen=True)
class PairedComparison:
    """Two learners on common seeds.

    Attributes:
        difference: Mean of first minus second.
        wins: Pairs in which the first is larger.
        losses: Pairs in which the second is larger.
        p_value: Of the two-sided sign-flip test of no difference.
    """

    difference: Estimate
    wins: int
    losses: int
    p_value: float


def compare_paired(
    first: ArrayLike,
    second: ArrayLike,
    *,
    confidence: float = 0.95,
    resamples: int = 9999,
    seed: int = 0,
) -> PairedComparison:
    """Compare two learners whose runs have seeds in common.

    Args:
        first: One value per run of the first learner, shape [N].
        second: The same for the second, in the same order of seeds.
        confidence: Of the interval of the difference.
        resamples: Draws of the bootstrap, and of sign flips if not all are made.
        seed: Source of chance.
    """
    one = check_vector("first", first)
    differences = one - check_vector("second", second, size=one.size)
    return PairedComparison(
        difference=bootstrap(differences, confidence=confidence, resamples=resamples, seed=seed),
        wins=int((differences > 0).sum()),
        losses=int((differences < 0).sum()),
        p_value=sign_flip_p_value(differences, resamples=resamples, seed=seed),
    )


def sign_flip_p_value(differences: ArrayLike, *, resamples: int = 9999, seed: int = 0) -> float:
    """Return the two-sided p-value of a zero mean, were all signs a matter of chance."""
    values = check_vector("differences", differences)
    values = values[values != 0]
    if not values.size:
        return 1.0
    observed = abs(float(values.sum())) * (1 - 1e-12)
    if values.size <= _ALL_FLIPS:
        bits = np.arange(2**values.size)[:, np.newaxis] >> np.arange(values.size)
        sums = np.abs((1.0 - 2.0 * (bits & 1)) @ values)
        return float((sums >= observed).mean())
    generator = np.random.default_rng(check_seed(seed))
    signs = 1.0 - 2.0 * generator.integers(0, 2, size=(resamples, values.size))
    exceeding = int((np.abs(signs @ values) >= observed).sum())
    return (1 + exceeding) / (1 + resamples)


def spearman(first: ArrayLike, second: ArrayLike, *, confidence: float = 0.95) -> Estimate:
    """Return Spearman's rank correlation with its interval; ties share their mean rank.

    Where one side is constant there is no correlation: 0, with the interval [-1, 1].
    """
    one = check_vector("first", first)
    other = check_vector("second", second, size=one.size)
    quantile = NORMAL.inv_cdf(0.5 + check_confidence(confidence) / 2)
    found = rank_correlation(one, other, quantile=quantile)
    value = 0.0 if math.isnan(found.value) else found.value
    return Estimate(value, Interval(found.low, found.high), one.size)
