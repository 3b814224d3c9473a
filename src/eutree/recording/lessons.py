"""What is to be imitated of the episodes: segments that hurt are cut, flipped, or shown again."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from eutree.data import Episode
from eutree.data.episode import CUT, TAUGHT
from eutree.recording.episodes import Recording, Trial
from eutree.recording.tree_making import HurtView, Segment


class Lessons:
    """The segments that hurt, and what becomes of them; what was done stays in the episodes.

    Args:
        recording: The episodes.

    Attributes:
        hurts: Segments that cost the tree its success; whoever has found them sets them.
        again: The segment that the next episode shows again; None for none.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.hurts: tuple[HurtView, ...] = ()
        self.again: Segment | None = None
        self._before: dict[int, Episode] = {}  # what was changed last, as it was

    def teach(self, numbers: Iterable[int], how: str | None) -> bool:
        """Cut or flip segments that hurt; return whether there was anything to change.

        Args:
            numbers: Their numbers.
            how: ``"cut"`` or ``"flip"``; None for what is proposed for each.
        """
        self._before = {}
        for number in numbers:
            for one in self._segments(number):
                self._teach(one, how or self.hurts[number].what)
        return bool(self._before)

    def take_back(self) -> None:
        """Let what was cut or flipped last be imitated as before."""
        for index, episode in self._before.items():
            self._recording.change(index, self._recording.episodes[index].teaching(episode.taught))
        self._before = {}

    def choose_segment(self, number: int) -> bool:
        """Let the next episode show a segment that hurts again; return whether that can be."""
        one = next(iter(self._segments(number)), None)
        seed = None if one is None else self._recording.episodes[one.episode].seed
        if seed is not None:
            self._recording.choose_start(seed)
            self.again = one
        return seed is not None

    def go_there(self, trial: Trial, now: float, measured: dict[str, Any]) -> None:
        """Do as was done before the segment to show again, which teaches nothing once more.

        It ends where the environment is not where it was then.
        """
        if self.again is None:
            return
        shown = self._recording.episodes[self.again.episode]
        for action, seen in zip(
            shown.actions[: self.again.start], shown.observations, strict=False
        ):
            if trial.is_over or not np.array_equal(np.asarray(trial.observation), seen):
                return
            self._recording.step(trial, int(action), now, {**measured, TAUGHT: CUT})

    def _teach(self, one: Segment, how: str) -> None:
        if how not in ("cut", "flip"):
            return  # it is to be shown again: nothing was found to be better
        episode = self._recording.episodes[one.episode]
        self._before.setdefault(one.episode, episode)
        becomes = one.becomes if how == "flip" else None
        changed = episode.teaching_in(one.start, one.stop, becomes)
        self._recording.change(one.episode, changed)

    def _segments(self, number: int) -> tuple[Segment, ...]:
        """Return the segments of a number, if they are those of the list of episodes still."""
        segments = self.hurts[number].segments if 0 <= number < len(self.hurts) else ()
        episodes = self._recording.episodes
        are_there = all(
            one.episode < len(episodes)
            and episodes[one.episode].kept
            and set(episodes[one.episode].actions[one.start : one.stop].tolist()) == {one.action}
            for one in segments
        )
        return segments if are_there else ()
