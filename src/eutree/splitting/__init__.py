"""The exact best Kolmogorov-Smirnov split of a leaf, and whether it is better than noise."""

from eutree.splitting.maximal import critical_value, maximal_p
from eutree.splitting.naive import naive_p
from eutree.splitting.permutation import permutation_p
from eutree.splitting.search import KolmogorovSmirnov, best_split
from eutree.splitting.significance import (
    Maximal,
    Naive,
    Permutation,
    Significance,
    SignificanceTest,
)
from eutree.splitting.split import LeafSample, Split

__all__ = [
    "KolmogorovSmirnov",
    "LeafSample",
    "Maximal",
    "Naive",
    "Permutation",
    "Significance",
    "SignificanceTest",
    "Split",
    "best_split",
    "critical_value",
    "maximal_p",
    "naive_p",
    "permutation_p",
]
