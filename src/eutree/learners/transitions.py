"""A history as the transitions that a world model is fitted to."""

import numpy as np

from eutree.arrays import Booleans, Integers
from eutree.learners.history import TERMINAL, History
from eutree.world_model import Transitions


def transitions_of(history: History, n_actions: int) -> Transitions:
    """Return a history as planning sees it; what a gap divides counts as two episodes."""
    return Transitions(
        history.observations,
        history.actions.astype(np.int64),
        history.rewards,
        history.next_observations,
        history.entered == TERMINAL,
        as_whole(history.episodes.astype(np.int64), history.continues),
        n_actions,
    )


def as_whole(episodes: Integers, continues: Booleans) -> Integers:
    """Return numbers of episodes [N] such that what a gap divides counts as two."""
    gaps = ~continues
    gaps[1:] &= episodes[1:] == episodes[:-1]
    gaps[:1] = False
    whole: Integers = episodes + np.cumsum(gaps)
    return whole
