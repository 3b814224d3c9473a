"""The episode under way: what a learner keeps of it until it has ended."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.data import Episode
from eutree.learners.history import History
from eutree.learners.learner import Step

_FIRST_ROOM = 64  # steps


@dataclass(frozen=True, eq=False)
class FinishedEpisode:
    """An episode as arrays.

    Attributes:
        observations: Observations, the first one included.
        actions: Actions.
        rewards: Their rewards.
        shown: Whether each action was a demonstration.
        terminated: Whether the task ended it.
    """

    observations: Floats  # [T + 1, d]
    actions: Integers  # [T]
    rewards: Floats  # [T]
    shown: Booleans  # [T]
    terminated: bool


class EpisodeBuffer:
    """Collects the steps of an episode.

    Attributes:
        observations: Observations with spare room, shape [C + 1, d]; another array after growing.
        present: The present observation, shape [d].
        generator: Source of all chance of the episode.
    """

    def __init__(self) -> None:
        self._size = 0
        self._terminated = False
        self.observations = np.empty((0, 0))
        self._actions: list[int] = []
        self._rewards: list[float] = []
        self._shown: list[int] = []

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return self._size

    def start(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]."""
        self.clear()
        if self.observations.shape[1] != observation.size:
            self.observations = np.empty((_FIRST_ROOM + 1, observation.size))
        self.observations[0] = self.present = observation
        self.generator = generator

    def add(self, step: Step) -> None:
        """Take a step."""
        self._actions.append(step.action)
        self._rewards.append(step.reward)
        if step.shown:
            self._shown.append(self._size)
        self._terminated = step.terminated
        self._size += 1
        if self._size == len(self.observations):
            self.observations = np.concatenate([self.observations, self.observations])
        self.observations[self._size] = self.present = step.observation

    def clear(self) -> None:
        """Forget the episode."""
        self._size = 0
        self._actions, self._rewards, self._shown = [], [], []

    def finish(self) -> FinishedEpisode:
        """Return the episode, which has ended, and forget it."""
        shown = np.zeros(self._size, dtype=np.bool_)
        if self._shown:
            shown[self._shown] = True
        episode = FinishedEpisode(
            observations=self.observations[: self._size + 1].copy(),
            actions=np.array(self._actions, dtype=np.int64),
            rewards=np.array(self._rewards, dtype=np.float64),
            shown=shown,
            terminated=bool(self._terminated),
        )
        self.clear()
        return episode


def store(
    history: History,
    episode: FinishedEpisode,
    leaves: Int32s | None = None,  # [T + 1]
    generator: np.random.Generator | None = None,
) -> None:
    """Append an episode to the store of transitions; ``generator`` serves a bounded one.

    Without ``leaves`` the store has a single one.
    """
    history.append_episode(
        episode.observations,
        episode.actions,
        episode.rewards,
        _single_leaf(episode.actions) if leaves is None else leaves,
        terminated=episode.terminated,
        demonstrated=episode.shown,
        generator=generator,
    )


def store_demonstrations(history: History, episodes: Iterable[Episode]) -> None:
    """Append demonstrations to a store of a single leaf."""
    for episode in episodes:
        history.append_episode(
            episode.observations,
            episode.actions,
            episode.rewards,
            _single_leaf(episode.actions),
            terminated=episode.terminated,
            demonstrated=True,
        )


def _single_leaf(actions: Integers) -> Int32s:
    return np.zeros(len(actions) + 1, dtype=np.int32)
