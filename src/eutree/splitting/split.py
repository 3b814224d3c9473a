"""What a search looks at and what it finds: the tuples of a leaf, and one cut of it."""

import math
from dataclasses import dataclass

from eutree.arrays import Floats, Integers


@dataclass(frozen=True, slots=True)
class LeafSample:
    """The tuples of one leaf, as clean arrays of equal length.

    Attributes:
        observations: Attributes of each tuple, C-ordered and finite.
        returns: q of each tuple (Eq. 2), finite.
        actions: Action of each tuple.
        episodes: Episode of each tuple, or None if it is not known.
    """

    observations: Floats  # [N, d]
    returns: Floats  # [N]
    actions: Integers  # [N]
    episodes: Integers | None = None  # [N]


@dataclass(frozen=True, slots=True)
class Split:
    """The best cut that a search found: ``x[feature] <= threshold`` goes left.

    Attributes:
        feature: Attribute that is cut.
        threshold: A number t with left value <= t < right value for the two neighbours of the cut.
        statistic: D, the two-sample Kolmogorov-Smirnov distance of the returns on both sides.
        scaled_statistic: K = D * sqrt(n_left * n_right / (n_left + n_right)).
        n_left: Tuples of the tested sample on the left side.
        n_right: Tuples of the tested sample on the right side.
        action: Action whose tuples are the tested sample; None if all tuples of the leaf are.
    """

    feature: int
    threshold: float
    statistic: float
    scaled_statistic: float
    n_left: int
    n_right: int
    action: int | None = None


def scaled_distance(statistic: float, n_left: int, n_right: int) -> float:
    """Return K of a two-sample Kolmogorov-Smirnov distance D between samples of these sizes."""
    return statistic * math.sqrt(n_left * n_right / (n_left + n_right))
