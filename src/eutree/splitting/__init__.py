"""The exact best Kolmogorov-Smirnov split of a leaf, and whether it is better than noise."""

from eutree.splitting.laws import critical_value, maximal_p, naive_p
from eutree.splitting.search import KolmogorovSmirnov, LeafSample, Split, best_split
from eutree.splitting.significance import (
    Maximal,
    Naive,
    Permutation,
    SignificanceTest,
    permutation_p,
)

__all__ = [
    "KolmogorovSmirnov", "LeafSample", "Maximal", "Naive", "Permutation", "SignificanceTest",
    "Split", "best_split", "critical_value", "maximal_p", "naive_p", "permutation_p",
]  # fmt: skip
