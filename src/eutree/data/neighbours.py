"""Whether like situations were answered alike: each observation and its nearest elsewhere.

Successive observations of one episode are near each other and mostly have the same action, so they
say nothing; the nearest observation of *another* episode does. Features are scaled by their range
within the demonstrations; the distance is the largest difference of any feature, as a share of its
range. A person who acts by a sharp rule also differs from neighbours across its boundary, more so
where demonstrations are sparse, so the share is given also for the near-equal neighbours alone.

Every pair is compared, which takes O(d n^2); of more than ``MAX_ROWS`` transitions only evenly
spaced ones are asked about.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.data.coverage import shares_of
from eutree.data.demonstrations import Demonstrations

MAX_ROWS = 4000
MAX_PAIRS = 10
NEAR = 0.02  # of the range of every feature
_BLOCK = 256


@dataclass(frozen=True)
class Contradiction:
    """Two near-equal observations of different episodes with different actions.

    Attributes:
        distance: Largest difference of a feature, as a share of its range.
        places: Episode and step of both.
        actions: The action of both.
    """

    distance: float
    places: tuple[tuple[int, int], tuple[int, int]]
    actions: tuple[int, int]


@dataclass(frozen=True)
class Neighbours:
    """What the nearest neighbours say.

    Attributes:
        disagreement: Share of the transitions whose nearest neighbour in another episode has
            another action; None with fewer than two episodes.
        n_near: How many of the transitions asked about have a neighbour at most ``NEAR`` away.
        near_disagreement: The share among these alone; None if there are none.
        contradictions: The nearest pairs with different actions that are at most ``NEAR`` apart,
            one for each pair of episodes, at most ``MAX_PAIRS``.
    """

    disagreement: float | None
    n_near: int
    near_disagreement: float | None
    contradictions: tuple[Contradiction, ...]


def compare_neighbours(demonstrations: Demonstrations) -> Neighbours:
    """Compare each transition of the kept episodes with its nearest one of another episode."""
    places = places_of(demonstrations)
    if len({episode for episode, _ in places}) < 2:
        return Neighbours(None, 0, None, ())
    observations, actions = demonstrations.observations, demonstrations.actions
    scaled = shares_of(observations, observations.min(axis=0), observations.max(axis=0))
    episodes = np.array([episode for episode, _ in places])
    asked = np.unique(np.linspace(0, len(actions) - 1, min(len(actions), MAX_ROWS)).astype(int))
    nearest, distance = _nearest(scaled, episodes, asked)
    differs = actions[asked] != actions[nearest]
    order = np.argsort(distance, kind="stable")
    found: dict[tuple[int, int], Contradiction] = {}
    for i in order[differs[order] & (distance[order] <= NEAR)].tolist():
        rows = sorted((int(asked[i]), int(nearest[i])))
        pair = (int(episodes[rows[0]]), int(episodes[rows[1]]))
        if pair not in found:
            found[pair] = Contradiction(
                distance=float(distance[i]),
                places=(places[rows[0]], places[rows[1]]),
                actions=(int(actions[rows[0]]), int(actions[rows[1]])),
            )
        if len(found) == MAX_PAIRS:
            break
    near = differs[distance <= NEAR]
    return Neighbours(
        disagreement=float(differs.mean()),
        n_near=len(near),
        near_disagreement=float(near.mean()) if len(near) else None,
        contradictions=tuple(found.values()),
    )


def places_of(demonstrations: Demonstrations) -> list[tuple[int, int]]:
    """Return episode and step of each transition of the kept episodes."""
    return [
        (number, step)
        for number, episode in enumerate(demonstrations.episodes)
        if episode.kept
        for step in range(len(episode))
    ]


def _nearest(scaled: Floats, episodes: Integers, asked: Integers) -> tuple[Integers, Floats]:
    """Return the row nearest to each of ``asked`` in another episode, and how far; the lowest."""
    nearest = np.empty(len(asked), dtype=np.int64)
    distance = np.empty(len(asked))
    for first in range(0, len(asked), _BLOCK):
        rows = asked[first : first + _BLOCK]
        gaps = np.zeros((len(rows), len(scaled)))
        for j in range(scaled.shape[1]):
            np.maximum(gaps, np.abs(scaled[rows, j, None] - scaled[None, :, j]), out=gaps)
        gaps[episodes[rows, None] == episodes[None, :]] = np.inf
        best = gaps.argmin(axis=1)
        nearest[first : first + len(rows)] = best
        distance[first : first + len(rows)] = gaps[np.arange(len(rows)), best]
    return nearest, distance
