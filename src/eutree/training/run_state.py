"""Where a run stands, what happened in it so far, and who follows it or may end it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from eutree.learners import Step
from eutree.training.beginning import Listener
from eutree.training.phases import Position


class RunState:
    """What the phases of a run have in common.

    Args:
        stop: Asked before every step; True ends the run at the last finished episode.

    Attributes:
        at: Where the run stands between two phases.
        steps_of_episode: Steps of the episode under way, gathered or raced; 0 between two.
        events: What happened so far: updates, evaluations, races, and what the listener recorded.
        listener: Who is told of each step, if anyone.
        recorded: What the listener measured since the last finished episode, by name.
        stopped: Whether ``stop`` or the listener ended the run.
        whole: Whether the learner is between two phases, so that a checkpoint may be saved; False
            while, and after, an interruption struck in the middle of one.
    """

    def __init__(self, stop: Callable[[], bool] = lambda: False) -> None:
        self.at = Position()
        self.steps_of_episode = 0
        self.events: list[dict[str, Any]] = []
        self.listener: Listener | None = None
        self.recorded: dict[str, float | int | None] = {}
        self.stopped = False
        self.whole = True
        self._stop = stop
        self._gathering = False

    @property
    def num_timesteps(self) -> int:
        """Steps so far: gathered, raced, and those of the running episode."""
        return self.at.steps + self.at.racing_steps + self.steps_of_episode

    def move(self, **changes: Any) -> None:
        """Stand elsewhere from now on."""
        self.at = replace(self.at, **changes)

    def note(self, event: str, facts: dict[str, Any]) -> None:
        """Add an event that happened here and now."""
        here = {"event": event, "episode": self.at.episode, "steps": self.num_timesteps}
        self.events.append(here | facts)

    def note_what_was_recorded(self) -> None:
        """Add what the listener measured, if it did."""
        if self.recorded:
            self.note("record", {"values": dict(self.recorded)})
            self.recorded.clear()

    def must_stop(self) -> bool:
        """Return whether the run ends here; who may end it is asked."""
        self.stopped = self.stopped or self._stop()
        return self.stopped

    def step_taken(self, step: Step) -> None:
        """Tell the listener of a step; it may end the run."""
        if self.listener is not None:
            self.stopped = not self.listener.step_taken(step)

    def gathering_begins(self) -> None:
        """Tell the listener that episodes follow, if none came before."""
        if self.listener is not None and not self._gathering:
            self.listener.gathering_begins()
        self._gathering = True

    def gathering_ends(self) -> None:
        """Tell the listener that an update follows, or that the race is over."""
        if self.listener is not None and self._gathering:
            self.listener.gathering_ends()
            self.note_what_was_recorded()
        self._gathering = False
