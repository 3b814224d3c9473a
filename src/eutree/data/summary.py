"""What demonstrations show, and where they contradict themselves.

Near-equal observations: each feature's range within the demonstrations is cut into ``BINS`` equal
bins; two observations are near-equal if they share the bin of every feature. A group of
near-equal observations with more than one action is inconsistent, and its transitions with
another action than the group's most frequent one (the lowest of several) disagree. Sorting finds
the groups, so n transitions of d features take O(d n log n).
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.data.demonstrations import Demonstrations

FILLED = 0.5  # share of a feature's bounds below which the values seen bound a drawing


def bins_of(observations: Floats, low: Floats, high: Floats, n_bins: int) -> Integers:
    """Return the bin of each value, shape [N, d]; a feature without a range has bin 0."""
    # Halves, because high - low may overflow.
    width = high / 2 - low / 2
    zeros = np.zeros_like(observations)
    shares = np.divide(observations / 2 - low / 2, width, out=zeros, where=width > 0)
    return np.clip((shares * n_bins).astype(np.int64), 0, n_bins - 1)


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
    """Return between which values each feature is drawn; each of shape [d].

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


BINS = 50
COVERAGE_BINS = 10
MAX_EXAMPLES = 5


@dataclass(frozen=True)
class Coverage:
    """How much of one feature's range the demonstrations visit.

    Attributes:
        name: The feature.
        low: Smallest value seen.
        high: Largest value seen.
        share: Share of ``COVERAGE_BINS`` equal bins visited, between the schema's bounds where
            they are finite, else between the values seen.
    """

    name: str
    low: float
    high: float
    share: float


@dataclass(frozen=True)
class Conflict:
    """A group of near-equal observations with different actions.

    Attributes:
        observation: The mean observation of the group.
        counts: How often each action was taken there.
        places: Episode and step of the first transition of each action taken.
    """

    observation: tuple[float, ...]
    counts: tuple[int, ...]
    places: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Summary:
    """What ``summarize`` found; all of it is of the kept episodes.

    Attributes:
        success_rate: Share of successes; None where no success is reported.
        coverage: One entry for each feature.
        joint_cells: Cells of the joint grid of ``COVERAGE_BINS`` bins a feature that are visited.
        disagreement: Share of the transitions that disagree with their near-equals.
        n_conflicts: Number of inconsistent groups.
        conflicts: The groups with the most disagreeing transitions, at most ``MAX_EXAMPLES``.
    """

    success_rate: float | None
    coverage: tuple[Coverage, ...]
    joint_cells: int
    disagreement: float
    n_conflicts: int
    conflicts: tuple[Conflict, ...]


def summarize(demonstrations: Demonstrations) -> Summary:
    """Return results, coverage and inconsistencies of demonstrations."""
    observations, actions = demonstrations.observations, demonstrations.actions
    group, counts = _group_counts(observations, actions, demonstrations.schema.n_actions)
    disagreeing = counts.sum(axis=1) - counts.max(axis=1, initial=0)
    order = np.lexsort((np.arange(len(disagreeing)), -disagreeing))
    worst = [int(g) for g in order[:MAX_EXAMPLES] if disagreeing[g] > 0]
    places = _places_of(demonstrations)
    successes = [e.is_success for e in demonstrations if e.is_success is not None]
    coarse = bins_of(observations, *bounds_of(demonstrations), COVERAGE_BINS)
    return Summary(
        success_rate=sum(successes) / len(successes) if successes else None,
        coverage=_coverage(demonstrations, coarse),
        joint_cells=len(np.unique(coarse, axis=0)),
        disagreement=float(disagreeing.sum() / max(len(actions), 1)),
        n_conflicts=int((disagreeing > 0).sum()),
        conflicts=tuple(
            _conflict(observations, actions, np.flatnonzero(group == g), counts[g], places)
            for g in worst
        ),
    )


def _places_of(demonstrations: Demonstrations) -> list[tuple[int, int]]:
    """Return episode and step of each transition of the kept episodes."""
    return [
        (number, step)
        for number, episode in enumerate(demonstrations.episodes)
        if episode.kept
        for step in range(len(episode))
    ]


def _group_counts(
    observations: Floats, actions: Integers, n_actions: int
) -> tuple[Integers, Integers]:
    """Return the group of near-equals of each transition [N], and action counts of each [G, A]."""
    if not len(actions):
        return np.empty(0, np.int64), np.zeros((0, n_actions), np.int64)
    bins = bins_of(observations, observations.min(axis=0), observations.max(axis=0), BINS)
    _, group = np.unique(bins, axis=0, return_inverse=True)
    group = group.reshape(-1).astype(np.int64)
    counts = np.zeros((int(group.max()) + 1, n_actions), dtype=np.int64)
    np.add.at(counts, (group, actions), 1)
    return group, counts


def _coverage(demonstrations: Demonstrations, bins: Integers) -> tuple[Coverage, ...]:
    observations = demonstrations.observations
    return tuple(
        Coverage(
            name=name,
            low=float(observations[:, j].min()) if len(bins) else 0.0,
            high=float(observations[:, j].max()) if len(bins) else 0.0,
            share=len(np.unique(bins[:, j])) / COVERAGE_BINS,
        )
        for j, name in enumerate(demonstrations.schema.feature_names)
    )


def _conflict(
    observations: Floats,
    actions: Integers,
    rows: Integers,
    counts: Integers,
    places: list[tuple[int, int]],
) -> Conflict:
    firsts = [rows[actions[rows] == action][0] for action in np.flatnonzero(counts)]
    return Conflict(
        observation=tuple(observations[rows].mean(axis=0).tolist()),
        counts=tuple(counts.tolist()),
        places=tuple(places[row] for row in firsts),
    )
