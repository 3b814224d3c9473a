"""The episodes of a session, each from a start of its own, and the outputs to be stored.

The actions to imitate in them may change: segments that hurt are cut, flipped, or shown again.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.data.episode import AGAIN, ALLOWED, CUT, STOPPED, TAUGHT, masks_of
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import Stream, ending_of, success_of
from eutree.recording.events import (
    EpisodeAbandoned,
    EpisodeChanged,
    EpisodeEnded,
    EpisodeStarted,
    EpisodeView,
    Output,
    SessionSettings,
    StepTaken,
)
from eutree.recording.scenes import Scene
from eutree.recording.tree_making import HurtView, Segment
from eutree.recording.views import episode_views

MAX_EDGES = 20_000

Answer = tuple[Floats, float, bool, bool, dict[str, Any]]


class Trial:
    """One episode, from reset to end.

    Args:
        observation: The observation after reset, shape [d]; None if nothing is recorded.
        seed: Seed given to reset.
        extras: Facts about the episode; ``"keys"`` names the keys whose state goes with each step.
        held: Keys held at reset.
    """

    def __init__(
        self,
        observation: Floats | None,
        seed: int = 0,
        extras: dict[str, Any] | None = None,
        held: Iterable[str] = (),
    ) -> None:
        self.seed = seed
        self.extras = extras or {}
        self.is_over = observation is None
        self.observation = observation
        self._first = np.empty(0) if observation is None else observation
        self._rows: list[StepTaken] = []
        self._info: dict[str, Any] = {}
        self._held = set(held)
        self._edges: list[list[Any]] = []
        self._edge_time = self._edge_frame = float("nan")

    @property
    def n_steps(self) -> int:
        """Number of steps taken."""
        return len(self._rows)

    def edge(self, key: str, now: float, frame: int, *, down: bool) -> None:
        """Take note of a key that went down or up over the picture ``frame``."""
        if self.is_over:
            return
        (self._held.add if down else self._held.discard)(key)
        self._edge_time, self._edge_frame = now, float(frame)
        if len(self._edges) < MAX_EDGES:
            self._edges.append([key, down, now, frame])

    def step(self, action: int, answer: Answer, now: float, measured: dict[str, Any]) -> StepTaken:
        """Add a step and return it."""
        observation, reward, terminated, truncated, self._info = answer
        steps = {
            "time": now,
            "keys": [key in self._held for key in self.extras.get("keys", ())],
            "edge_time": self._edge_time,
            "edge_frame": self._edge_frame,
            **measured,
        }
        row = StepTaken(
            action, reward, observation, terminated, truncated and not terminated, steps
        )
        self._rows.append(row)
        self.observation = observation
        return row

    def finish(self, ending: str = "") -> Episode:
        """Return the episode; ``ending`` where the environment has not ended it."""
        self.is_over, rows, last = True, self._rows, self._rows[-1]
        names = [name for name in rows[0].steps if name != ALLOWED]
        steps = {name: np.array([row.steps[name] for row in rows]) for name in names}
        allowed = masks_of([row.steps.get(ALLOWED) for row in rows])  # said at some alone, perhaps
        return Episode(
            observations=np.array([self._first, *(row.observation for row in rows)]),
            actions=np.array([row.action for row in rows], dtype=np.int64),
            rewards=np.array([row.reward for row in rows]),
            terminated=last.terminated,
            truncated=last.truncated,
            seed=self.seed,
            ending=ending or ending_of(self._info, terminated=last.terminated),
            is_success=None if ending else success_of(self._info),
            steps=steps if allowed is None else {**steps, ALLOWED: allowed},
            extras={**self.extras, "edges": self._edges},
        )


class Recording:
    """The episodes of one session in one environment, after those recorded before.

    Args:
        env: The environment in which the person acts.
        settings: The seed, the first start, and how many episodes are wanted.
        recorded: Episodes recorded before, with their numbers, in order.
        free_start: The least number of a start that nobody else has taken, asked before each new
            one: two recorders may share a folder.

    Attributes:
        episodes: All episodes, discarded ones included.
        numbers: The number of each episode in its folder.
        number: That of the episode under way, as far as known; its folder has the last word.
        last: Place of this session's last episode in the list; None before the first, and after
            one that the person ended before its first step.
        start: Number of the present start. It is advanced when an episode is stored.
        missing: An episode with a situation not shown yet, to begin one like it; None if none is
            known.
    """

    def __init__(
        self,
        env: GuardedEnv,
        settings: SessionSettings,
        recorded: Sequence[tuple[int, Episode]] = (),
        free_start: Callable[[], int] = lambda: 0,
    ) -> None:
        self._env = env
        self._settings = settings
        self._free_start = free_start
        self._outputs: list[Output] = []
        self.episodes = [episode for _, episode in recorded]
        self.numbers = [number for number, _ in recorded]
        self.number = 0
        self.last: int | None = None
        self.start = settings.first
        self.missing: Scene | None = None
        self._chosen: int | None = None  # seed of a start that the person chose

    @property
    def n_kept(self) -> int:
        """Number of kept episodes that the person played alone."""
        return sum(episode.kept and episode.by_hand is None for episode in self.episodes)

    @property
    def is_enough(self) -> bool:
        """Whether as many episodes are kept as are wanted."""
        return self.n_kept >= self._settings.target

    def views(self) -> list[EpisodeView]:
        """Return the lines of the list of episodes."""
        return episode_views(self.numbers, self.episodes, self._env.env)

    def take_outputs(self) -> list[Output]:
        """Return the outputs to be stored, once."""
        outputs, self._outputs = self._outputs, []
        return outputs

    def preview(self) -> Trial:
        """Reset the environment for a first picture; nothing is recorded."""
        self._env.reset(self._seed())
        return Trial(None)

    def choose_start(self, chosen: int | None = None) -> None:
        """Go on to a start that nobody has taken, or to one that the person chose by its seed."""
        self.start, self._chosen = max(self.start, self._free_start()), chosen

    def begin(self, extras: dict[str, Any], held: Sequence[str]) -> Trial:
        """Reset the environment for an episode, of which facts and the keys held are known."""
        observation = self._env.reset(self._seed())
        if self._chosen is not None:
            extras = {**extras, "chosen_start": True}
        trial = Trial(observation, self._seed(), extras, held)
        self.number = max(self.numbers, default=-1) + 1
        self._outputs.append(EpisodeStarted(observation, trial.seed, dict(extras)))
        return trial

    def taken(self, action: int) -> int:
        """Return the action that is taken for one: where it is masked, the first allowed one."""
        allowed = self._env.allowed
        return action if allowed is None or allowed[action] else int(allowed.argmax())

    def step(self, trial: Trial, action: int, now: float, measured: dict[str, Any]) -> int:
        """Take a step in the environment; store the episode if it ends there.

        Return the action that was ``taken``.
        """
        action, allowed = self.taken(action), self._env.allowed
        if allowed is not None:
            measured = {**measured, ALLOWED: allowed.tolist()}
        if trial.extras.get(AGAIN):
            measured = {TAUGHT: action, **measured}
        output = trial.step(action, self._env.step(action), now, measured)
        self._outputs.append(output)
        if output.terminated or output.truncated:
            self._keep(trial.finish())
        return action

    def stop(self, trial: Trial, *, kept: bool, comment: str = "", ending: str = STOPPED) -> None:
        """End an episode by the person's wish, or for the reason ``ending``."""
        if trial.n_steps:
            self._keep(replace(trial.finish(ending), kept=kept, comment=comment))
        else:  # nothing was shown: the start is unused
            trial.is_over = True
            self._outputs.append(EpisodeAbandoned())

    def mark(self, index: int, *, kept: bool, comment: str = "") -> None:
        """Keep or discard an episode of the list."""
        if 0 <= index < len(self.episodes) and self.episodes[index].kept != kept:
            self.change(index, replace(self.episodes[index], kept=kept, comment=comment))

    def change(self, index: int, changed: Episode) -> None:
        """Put another episode in the place of one of the list."""
        self.episodes[index] = changed
        self._outputs.append(EpisodeChanged(index, changed))

    def _keep(self, episode: Episode) -> None:
        """Put a finished episode into the list, to be stored at once."""
        self.last, self.missing = len(self.episodes), None
        self.episodes.append(episode)
        self.numbers.append(self.number)
        self.start += 1
        self._outputs.append(EpisodeEnded(self.last, episode))

    def _seed(self) -> int:
        if self._chosen is not None:
            return self._chosen
        return episode_seed(self._settings.seed, self.start, Stream.PERSON)


class Lessons:
    """The segments that hurt, and the changes to them; the actions taken stay in the episodes."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.hurts: tuple[HurtView, ...] = ()  # set by the search that found them
        self.again: Segment | None = None  # that the next episode shows again
        self._before: dict[int, Episode] = {}  # the episodes that were changed last, as they were

    def teach(self, numbers: Iterable[int], how: str | None) -> bool:
        """Cut or flip groups of ``hurts``; return whether there was anything to change.

        ``how`` is ``"cut"`` or ``"flip"``; None for the proposal of each.
        """
        self._before = {}
        for number in numbers:
            for one in self._segments(number):
                self._teach(one, how or self.hurts[number].what)
        return bool(self._before)

    def take_back(self) -> None:
        """Let the steps that were cut or flipped last be imitated as before."""
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
        changed = episode.teaching_in(one.start, one.stop, one.becomes if how == "flip" else None)
        self._recording.change(one.episode, changed)

    def _segments(self, number: int) -> tuple[Segment, ...]:
        """Return the segments of a number by place in the list, if they are those of it still."""
        hurt = self.hurts[number].segments if 0 <= number < len(self.hurts) else ()
        episodes = self._recording.episodes
        # Another recorder's episodes in the same folder have no place.
        places = {file: place for place, file in enumerate(self._recording.numbers)}
        segments = tuple(replace(one, episode=places.get(one.episode, -1)) for one in hurt)
        are_there = all(
            one.episode >= 0
            and episodes[one.episode].kept
            and set(episodes[one.episode].actions[one.start : one.stop].tolist()) == {one.action}
            for one in segments
        )
        return segments if are_there else ()
