"""The episode under way, which a learner keeps until it has ended."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.data import Episode
from eutree.data.episode import masks_of
from eutree.learners.history import TERMINAL, History
from eutree.learners.learner import Step
from eutree.world_model import Transitions


class FinishedEpisode(NamedTuple):
    """An episode as arrays."""

    observations: Floats  # [T + 1, d] the first one included
    actions: Integers  # [T]
    rewards: Floats  # [T]
    terminated: bool  # whether the task ended it
    allowed: Booleans | None = None  # [T, A] actions allowed at each step; None where all were


class EpisodeBuffer:
    """Collects the steps of an episode, whose source of all chance is ``generator``."""

    def __init__(self) -> None:
        self._steps: list[Step] = []

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return len(self._steps)

    def start(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]."""
        self._steps.clear()
        self._first = self.present = observation  # [d]
        self.generator = generator

    def add(self, step: Step) -> None:
        """Take a step."""
        self._steps.append(step)
        self.present = step.observation

    def clear(self) -> None:
        """Forget the episode."""
        self._steps.clear()

    def finish(self) -> FinishedEpisode:
        """Return the episode, which has ended, and forget it."""
        columns = Step(*zip(*self._steps, strict=True))
        observations = np.concatenate([self._first, *columns.observation])
        episode = FinishedEpisode(
            observations=observations.reshape(len(self._steps) + 1, -1),
            actions=np.array(columns.action, dtype=np.int64),
            rewards=np.array(columns.reward),
            terminated=self._steps[-1].terminated,
            allowed=masks_of([step.allowed for step in self._steps]),
        )
        self._steps.clear()
        return episode


def random_action(generator: np.random.Generator, n_actions: int, allowed: Booleans | None) -> int:
    """Return a random action, of those that are allowed, shape [A]."""
    if allowed is None:
        return int(generator.integers(n_actions))
    return int(generator.choice(np.flatnonzero(allowed)))


def store(
    history: History,
    episode: FinishedEpisode | Episode,
    leaves: Int32s | None = None,  # [T + 1]
    generator: np.random.Generator | None = None,
    *,
    demonstrated: bool = False,
) -> Booleans:
    """Append an episode to the store, and return which of its transitions are stored, shape [T].

    Without ``leaves`` the store has a single one; ``generator`` serves a bounded one.
    """
    return history.append_episode(
        episode.observations,
        episode.actions,
        episode.rewards,
        np.zeros(len(episode.actions) + 1, dtype=np.int32) if leaves is None else leaves,
        terminated=episode.terminated,
        demonstrated=demonstrated,
        generator=generator,
        allowed=episode.allowed,
    )


def store_demonstrations(history: History, episodes: Iterable[Episode]) -> None:
    """Append demonstrations to a store of a single leaf."""
    for episode in episodes:
        store(history, episode, demonstrated=True)


def transitions_of(history: History, n_actions: int) -> Transitions:
    """Return a history as planning sees it; the pieces beside a gap count as two episodes."""
    episodes, gaps = history.episodes.astype(np.int64), ~history.continues
    gaps[1:] &= episodes[1:] == episodes[:-1]
    gaps[:1] = False
    return Transitions(
        history.observations,
        history.actions.astype(np.int64),
        history.rewards,
        history.next_observations,
        history.entered == TERMINAL,
        episodes + np.cumsum(gaps),
        n_actions,
        allowed=history.columns.get("allowed"),
    )
