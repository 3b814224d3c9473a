"""Which episodes reached their task's goal, and where it lies."""

from collections.abc import Sequence

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.c45 import C45Settings, grow
from eutree.data import Episode
from eutree.trees.boxes import leaf_boxes

MARGIN = 1e-3  # around final observations where no test tells the goal, as a share of the box


def reached(episodes: Sequence[Episode]) -> Booleans:
    """Return which episodes reached the goal, shape [E].

    The environment says so by ``is_success``. Where it says nothing, an end is a good one if its
    reward is no less than what a step that goes on earns from there on average: an end that saves
    further cost is a goal, one that cuts earning short is not.
    """
    to_go = [np.cumsum(episode.rewards[::-1])[::-1] for episode in episodes]
    ongoing = [x[:-1] if e.terminated else x for x, e in zip(to_go, episodes, strict=True)]
    flat = np.concatenate([*ongoing, np.empty(0)])
    level = float(flat.mean()) if flat.size else 0.0
    return np.array(
        [
            bool(e.is_success)
            if e.is_success is not None
            else bool(e.terminated and len(e) and e.rewards[-1] >= level)
            for e in episodes
        ],
        dtype=np.bool_,
    )


def goal_boxes(episodes: Sequence[Episode], low: Floats, high: Floats) -> Floats:  # [G, 2, d]
    """Return where episodes reached the goal: the leaves of C4.5's tree of o' that say so.

    Args:
        episodes: Episodes, some of which reached it.
        low: Lower corner of the box, shape [d].
        high: Upper corner, shape [d].
    """
    good = [e for e, is_good in zip(episodes, reached(episodes), strict=True) if is_good]
    places = np.concatenate([episode.observations[1:] for episode in episodes])
    ends = np.concatenate(
        [(np.arange(len(e)) == len(e) - 1) & any(e is g for g in good) for e in episodes]
    ).astype(np.int64)
    grown = grow(places, ends, n_classes=2, settings=C45Settings.lossless())
    tree, labels = grown.to_decision_tree()
    leaf_low, leaf_high = (np.clip(x, low, high) for x in leaf_boxes(tree))
    positive = (labels == 1) & (leaf_low <= leaf_high).all(axis=1)
    if positive.any():
        return np.stack([leaf_low[positive], leaf_high[positive]], axis=1)
    final = places[ends == 1]
    wide = MARGIN * (high - low)
    bottom, top = final.min(axis=0) - wide, final.max(axis=0) + wide
    around: Floats = np.clip(np.stack([bottom, top])[np.newaxis], low, high)
    return around
