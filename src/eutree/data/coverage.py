"""Where in observation space demonstrations were, and which actions were taken there.

Each feature's range, between the schema's bounds where both are finite and else between the values
seen, is cut into ``GRID_BINS`` equal bins. Where the values seen fill less than half of the bounds,
as where velocities might be ten and never are, bins lie between the values seen: else a drawing
would be void and all that happened would fall in two bins. The two features of the map are chosen
by mutual information of bins and actions: the feature that tells most about the action alone, then
the one that adds most to it. So d features take O(d n) and no pair is left to chance.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers, frozen
from eutree.data.demonstrations import Demonstrations

GRID_BINS = 20
FILLED = 0.5  # share of a feature's bounds below which the values seen bound its bins


@dataclass(frozen=True, eq=False)
class Histogram:
    """How often each bin of one feature was visited, with which action.

    Attributes:
        feature: Index of the feature.
        low: Lower end of the first bin.
        high: Upper end of the last bin.
        counts: Transitions by bin and action.
    """

    feature: int
    low: float
    high: float
    counts: Integers  # [GRID_BINS, A]


@dataclass(frozen=True, eq=False)
class CoverageMap:
    """How often each cell of two features was visited, with which action.

    Attributes:
        features: Indices of both features, the more informative first.
        information: Bits that the cells tell about the action.
        counts: Transitions by bin of the first feature, bin of the second, and action.
    """

    features: tuple[int, int]
    information: float
    counts: Integers  # [GRID_BINS, GRID_BINS, A]

    @property
    def share(self) -> float:
        """Share of the cells that were visited."""
        return float((self.counts.sum(axis=2) > 0).mean())


def histograms(demonstrations: Demonstrations) -> tuple[Histogram, ...]:
    """Return one histogram for each feature, of the kept episodes."""
    low, high = drawn_bounds(demonstrations)
    bins = bins_of(demonstrations.observations, low, high, GRID_BINS)
    return tuple(
        Histogram(
            feature=j,
            low=float(low[j]),
            high=float(high[j]),
            counts=_counts(bins[:, j], demonstrations.actions, GRID_BINS, demonstrations),
        )
        for j in range(demonstrations.schema.n_features)
    )


def coverage_map(demonstrations: Demonstrations) -> CoverageMap | None:
    """Return the map over the two features that tell most about the action; None if d = 1."""
    n_features = demonstrations.schema.n_features
    if n_features < 2:
        return None
    actions = demonstrations.actions
    bins = bins_of(demonstrations.observations, *drawn_bounds(demonstrations), GRID_BINS)
    alone = [_counts(bins[:, j], actions, GRID_BINS, demonstrations) for j in range(n_features)]
    first = int(np.argmax([mutual_information(counts) for counts in alone]))
    others = [j for j in range(n_features) if j != first]
    cells = [
        _counts(bins[:, first] * GRID_BINS + bins[:, j], actions, GRID_BINS**2, demonstrations)
        for j in others
    ]
    information = [mutual_information(counts) for counts in cells]
    best = int(np.argmax(information))
    shape = (GRID_BINS, GRID_BINS, demonstrations.schema.n_actions)
    return CoverageMap(
        features=(first, others[best]),
        information=information[best],
        counts=frozen(cells[best].reshape(shape)),
    )


def mutual_information(counts: Integers) -> float:
    """Return how many bits the row of a table of counts, shape [n, A], tells about the column."""
    total = counts.sum()
    if not total:
        return 0.0
    joint = counts / total
    independent = joint.sum(axis=1, keepdims=True) * joint.sum(axis=0, keepdims=True)
    some = joint > 0
    return float((joint[some] * np.log2(joint[some] / independent[some])).sum())


def bins_of(observations: Floats, low: Floats, high: Floats, n_bins: int) -> Integers:
    """Return the bin of each value, shape [N, d]; a feature without a range has bin 0."""
    shares = shares_of(observations, low, high)
    return np.clip((shares * n_bins).astype(np.int64), 0, n_bins - 1)


def shares_of(observations: Floats, low: Floats, high: Floats) -> Floats:
    """Return where between ``low`` (0) and ``high`` (1) each value lies, shape [N, d].

    A feature without a range is 0 everywhere.
    """
    # Halves, because high - low may overflow.
    width = high / 2 - low / 2
    zeros = np.zeros_like(observations)
    return np.divide(observations / 2 - low / 2, width, out=zeros, where=width > 0)


def bounds_of(demonstrations: Demonstrations) -> tuple[Floats, Floats]:
    """Return the schema's bounds where both are finite, else the range seen; each of shape [d]."""
    observations, features = demonstrations.observations, demonstrations.schema.features
    low = np.array([feature.low for feature in features])
    high = np.array([feature.high for feature in features])
    if not len(observations):
        return np.zeros_like(low), np.zeros_like(high)
    bounded = np.isfinite(low) & np.isfinite(high)
    return (
        np.where(bounded, low, observations.min(axis=0)),
        np.where(bounded, high, observations.max(axis=0)),
    )


def drawn_bounds(demonstrations: Demonstrations) -> tuple[Floats, Floats]:
    """Return between which values each feature is drawn and cut into bins; each of shape [d].

    These are its bounds or, where the values seen fill less than half of them, the values seen.
    """
    low, high = bounds_of(demonstrations)
    observations = demonstrations.observations
    if not len(observations):
        return low, high
    seen = observations.min(axis=0), observations.max(axis=0)
    # Halves, because high - low may overflow. A feature that never moved keeps its bounds.
    width, reach = high / 2 - low / 2, seen[1] / 2 - seen[0] / 2
    narrow = (reach > 0) & (reach < FILLED * width)
    # Adding 0 makes a -0 that was recorded, or is a bound, a 0.
    return np.where(narrow, seen[0], low) + 0.0, np.where(narrow, seen[1], high) + 0.0


def _counts(
    cells: Integers, actions: Integers, n_cells: int, demonstrations: Demonstrations
) -> Integers:
    """Return the transitions by cell and action, shape [n_cells, A]."""
    n_actions = demonstrations.schema.n_actions
    flat = np.bincount(cells * n_actions + actions, minlength=n_cells * n_actions)
    return frozen(flat.astype(np.int64).reshape(n_cells, n_actions))
