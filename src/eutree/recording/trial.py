"""The episode under way in a recording session: its rows, its key edges, how it ends."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.interaction.episode import ending_of, success_of
from eutree.recording.events import EpisodeAbandoned, EpisodeEnded, EpisodeStarted, StepTaken

STOPPED = "stopped"
MAX_EDGES = 20_000

Answer = tuple[Floats, float, bool, bool, dict[str, Any]]


class Trial:
    """One episode, from reset to end.

    Args:
        observation: What was sensed after reset, shape [d]; None if nothing is recorded.
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
        self._first = observation
        self._rows: list[StepTaken] = []
        self._info: dict[str, Any] = {}
        self._held = set(held)
        self._edges: list[list[Any]] = []
        self._edge_time = self._edge_frame = float("nan")

    @classmethod
    def unused(cls) -> "Trial":
        """Return a trial of which nothing is recorded."""
        return cls(None)

    @property
    def n_steps(self) -> int:
        """Number of steps taken."""
        return len(self._rows)

    @property
    def is_running(self) -> bool:
        """Whether steps can still be added."""
        return not self.is_over

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

    def finish(self) -> Episode:
        """Return the episode that the environment ended."""
        last = self._rows[-1]
        return self._episode(
            terminated=last.terminated,
            truncated=last.truncated,
            ending=ending_of(self._info, terminated=last.terminated),
            is_success=success_of(self._info),
        )

    def stop(self, ending: str = STOPPED) -> Episode:
        """Return the episode that a person, or a fault, ended: neither flag is set."""
        return self._episode(terminated=False, truncated=False, ending=ending, is_success=None)

    def started(self) -> EpisodeStarted:
        """Return what is to be stored at the start."""
        first = np.empty(0) if self._first is None else self._first
        return EpisodeStarted(first, self.seed, dict(self.extras))

    def ended(self, index: int, episode: Episode) -> EpisodeEnded:
        """Return what is to be stored at the end."""
        return EpisodeEnded(index, episode)

    def abandoned(self) -> EpisodeAbandoned:
        """End without a step."""
        self.is_over = True
        return EpisodeAbandoned()

    def _episode(self, **fields: Any) -> Episode:
        self.is_over = True
        rows = self._rows
        names = list(rows[0].steps)
        first = np.empty(0) if self._first is None else self._first
        return Episode(
            observations=np.array([first, *(row.observation for row in rows)]),
            actions=np.array([row.action for row in rows], dtype=np.int64),
            rewards=np.array([row.reward for row in rows]),
            seed=self.seed,
            steps={name: np.array([row.steps[name] for row in rows]) for name in names},
            extras={**self.extras, "edges": self._edges},
            **fields,
        )
