"""The course of an episode that a person plays: countdown, decisions, pauses, review, pictures.

It has no clock, takes no steps and stores nothing. It says which action is due, as the hands, the
pace and the pictures have it.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.interaction import GuardedEnv
from eutree.recording.controls import FRAME_SECONDS, Controls
from eutree.recording.episodes import Trial
from eutree.recording.events import Frame

OPENING, COUNTDOWN, PLAYING = "opening", "countdown", "playing"
PAUSED, REVIEW, FINISHED, FAILED = "paused", "review", "finished", "failed"
WATCHING = "watching"  # a tree drives
DRIVING = "driving"  # a tree drives, and the person may take over

REVIEW_SECONDS = 0.7  # a key pressed this soon after the end was meant for the episode
VIEWER_SECONDS = 1.5  # a viewer that draws nothing for so long has been lost
LAST_SECONDS = 1.0  # for a viewer to draw the last picture of an episode, before it is spoken of
_TOLERANCE = 1e-9


class Pictures:
    """Renders an environment and numbers the pictures from 1.

    One made with ``render_mode="rgb_array"``; with ``render_between(share)`` it moves between two
    steps.

    Attributes:
        given: Number of the last picture given out.
        drawn: Number of the last picture that the viewer reported as drawn.
        is_complete: Whether the full picture of the present step was given out.
        pixels: The last picture given out; empty before the first.
    """

    def __init__(self, env: GuardedEnv) -> None:
        self._env = env
        self._between: Callable[[float], Any] | None = getattr(
            env.env.unwrapped, "render_between", None
        )
        self.given = self.drawn = 0
        self.is_complete = False
        self.pixels: NDArray[np.uint8] = np.zeros((0, 0, 3), np.uint8)
        self._again: NDArray[np.uint8] | None = None  # due once more
        self._given_time = self._drawn_time = 0.0
        self._shared = 0.0  # share of the movement in the last picture

    def expect(self, again: NDArray[np.uint8] | None = None) -> None:
        """Take note that a picture is due: a new one, or one given out before ``again``."""
        self.is_complete, self._shared, self._again = False, 0.0, again

    def next(self, now: float, share: float) -> Frame | None:
        """Return a new picture if one is due; ``share`` of the movement is over."""
        share = share if self._between is not None else 1.0
        too_soon = now < self._given_time + FRAME_SECONDS - _TOLERANCE
        if self.is_complete or share <= self._shared or (share < 1.0 and too_soon):
            return None
        self._shared, self.is_complete = share, share >= 1.0
        if self.given == self.drawn:
            self._drawn_time = now  # from now on an answer is awaited
        self.given += 1
        late = now - self.due()
        # A small delay does not add up, or thirty pictures a second would become fewer.
        self._given_time = now - late if 0.0 <= late < FRAME_SECONDS / 2.0 else now
        moving = partial(self._between, share) if self._between and share < 1.0 else None
        self.pixels = self._env.picture(moving) if self._again is None else self._again
        return Frame(self.given, self.pixels)

    def due(self) -> float:
        """Return when the next picture of a movement is due."""
        return self._given_time + FRAME_SECONDS

    def saw(self, number: int, now: float) -> None:
        """Take note that the viewer has drawn a picture."""
        if self.drawn < number <= self.given:
            self.drawn, self._drawn_time = number, now

    def facts(self, speed: float) -> dict[str, float]:
        """Return the facts to store with a step: pictures drawn and given out, and the speed."""
        return {"frame": self.drawn, "picture": self.given, "speed": speed}

    def are_seen(self, now: float) -> bool:
        """Return whether the viewer has drawn all that was given out, or has had the time to."""
        return self.given == self.drawn or now > self._given_time + LAST_SECONDS

    def wait_from(self, now: float) -> None:
        """Give the viewer time from now on."""
        self._drawn_time = now

    def is_unanswered(self, now: float) -> bool:
        """Return whether the viewer has drawn nothing for too long."""
        return self.given > self.drawn and now > self._drawn_time + VIEWER_SECONDS


class Play:
    """An episode as it is played.

    Args:
        controls: The keys of the person, and their pace.
        pictures: The pictures that the person sees.
        countdown: Seconds before an episode; a third of it when it goes on after a pause.

    Attributes:
        state: One of the states above.
        message: The message to the person.
        trial: The episode; an unused one before the first.
    """

    def __init__(self, controls: Controls, pictures: Pictures, countdown: float) -> None:
        self.controls = controls
        self.pictures = pictures
        self.state = OPENING
        self.message = ""
        self.trial = Trial(None)
        self._countdown = countdown
        self._countdown_end = self._review_began = 0.0
        self._fresh = False  # the countdown is that of an episode's first decision
        self._awaits_key = False  # the first decision comes with the first action key

    @property
    def is_on(self) -> bool:
        """Whether the episode is counted down to, or played: action keys act."""
        return self.state in (COUNTDOWN, PLAYING, DRIVING)

    @property
    def is_running(self) -> bool:
        """Whether an episode has begun, or begins, that has not ended."""
        return (self.is_on or self.state == PAUSED) and not self.trial.is_over

    def was_reviewed(self, now: float) -> bool:
        """Return whether an episode ended long enough ago for a key to be meant for the next."""
        return self.state == REVIEW and now >= self._review_began + REVIEW_SECONDS

    def awaits_turn(self) -> bool:
        """Return whether a turn may be taken now."""
        return self.state == PLAYING and self.pictures.is_complete and not self.trial.is_over

    def show(self, trial: Trial) -> None:
        """Let the person see where an episode begins."""
        self.trial = trial
        self.pictures.expect()

    def count_in(self, now: float) -> None:
        """Count down to the first decision."""
        self.controls.start()
        self._fresh, self._awaits_key = True, False
        self.controls.pace.finish()
        self.count_down(now, 0.0 if self.controls.pace.turn_based else 1.0)

    def count_down(self, now: float, share: float = 1.0 / 3.0) -> None:
        """Count down to the next decision, for a share of the time that a first one has."""
        self.state, self.message = COUNTDOWN, ""
        self._countdown_end = now + share * self._countdown

    def pause(self, now: float) -> None:
        """Hold the episode where it is."""
        self.state = PAUSED
        self.controls.pace.stop(now)
        self._let_go(now)
        self.controls.held.clear()
        self.controls.turns = []

    def leave(self, reason: str, now: float) -> None:
        """Let all keys go, because nobody is there, and pause the episode."""
        self._let_go(now)
        self.controls.release()
        if self.state in (COUNTDOWN, PLAYING):
            if not self.trial.is_over:
                self.pause(now)
            self.message = reason

    def review(self, now: float) -> None:
        """Be over, by the person's wish."""
        self.controls.pace.finish()
        self.state, self._review_began, self.message = REVIEW, now, ""

    def key_down(self, key: str, frame: int, now: float) -> bool:
        """Take note of a key over the picture ``frame``; return whether it may be a command."""
        controls = self.controls
        if key in controls.held:
            return False
        controls.held[key] = None
        self._edge(key, frame, now, down=True)
        if not (self.is_on and key in controls.keys.keys):
            return True
        controls.press(key)
        if self.awaits_turn():
            controls.add_turn(controls.held)
        return False

    def key_up(self, key: str, frame: int, now: float) -> None:
        """Take note of a key that went up."""
        if key in self.controls.held:
            del self.controls.held[key]
            self._edge(key, frame, now, down=False)

    def decision(self, now: float) -> int | None:
        """Go on until ``now``; return the action whose time has come, if one's has."""
        controls, pace = self.controls, self.controls.pace
        if self.state == COUNTDOWN and now >= self._countdown_end - _TOLERANCE:
            self._play(now)
        if self.state != PLAYING:
            return None
        if self.pictures.is_unanswered(now) and not self.trial.is_over:
            self.leave("The page stopped answering.", now)
            return None
        if not (self.pictures.is_complete and pace.is_over(now)):
            return None
        if self.trial.is_over:
            controls.turns = []
            if self.pictures.are_seen(now):
                self.state, self._review_began = REVIEW, now
        elif self._awaits_key and not controls.is_active:
            return None
        elif not pace.turn_based:
            self._awaits_key = False
            return self.controls.chosen()
        elif controls.turns:
            action = self.controls.chosen()
            del controls.turns[0]
            return action
        return None

    def due(self, now: float) -> float:
        """Return when there next is something to do without a key."""
        pace = self.controls.pace
        if self.state == COUNTDOWN:
            left = self._countdown_end - now
            return now + (left % 1.0 or min(left, 1.0)) if left > 0.0 else now
        if self.state not in (PLAYING, WATCHING, DRIVING):
            return now + 1.0
        if self._awaits_key and self.state == PLAYING and self.pictures.is_complete:
            return now + 1.0
        if pace.shown(now) < 1.0:
            return self.pictures.due()
        if self.trial.is_over and not self.pictures.are_seen(now):
            return max(pace.due(now), now + FRAME_SECONDS)
        return pace.due(now) if self.pictures.is_complete and not self.awaits_turn() else now

    def picture(self, now: float) -> Frame | None:
        """Return a new picture if one is due."""
        # While a learner practises the environment is its own, and not to be touched.
        if self.state in (FINISHED, FAILED):
            return None
        share = self.controls.pace.shown(now) if self.trial.n_steps > 0 else 1.0
        return self.pictures.next(now, share)

    def view_fields(self, now: float) -> dict[str, Any]:
        """Return the view's fields on the episode."""
        left = self._countdown_end - now if self.state == COUNTDOWN else 0.0
        return {
            "state": self.state,
            "message": self.message,
            "countdown": int(np.ceil(left - _TOLERANCE)),
            "step": self.trial.n_steps,
            "coming": self.controls.chosen() if self.is_on else 0,
            "awaits_key": self.state == PLAYING and self._awaits_key,
            "size": self.pictures.pixels.shape[1::-1],
        }

    def _play(self, now: float) -> None:
        self.state = PLAYING
        self.pictures.wait_from(now)
        if not self._fresh or self.controls.pace.turn_based:
            self.controls.pace.resume(now)
        elif self.controls.keys.idle is None:
            self._awaits_key = True
        else:
            self.controls.pace.restart(now)
        self._fresh = False

    def _let_go(self, now: float) -> None:
        for key in list(self.controls.held):
            self._edge(key, self.pictures.drawn, now, down=False)

    def _edge(self, key: str, frame: int, now: float, *, down: bool) -> None:
        self.pictures.saw(frame, now)
        seen = min(max(frame, 0), self.pictures.given)  # no picture that was never given out
        self.trial.edge(key, now, seen, down=down)
