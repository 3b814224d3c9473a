"""A tree drives in the recorder's own picture: to be watched, or to be corrected.

*Watched*, it shows the episodes that judged it, scene after scene, and nothing is stored.
*Corrected*, it drives from fresh starts: the person holds a key to act and lets go to hand back.
Each episode is stored with the steps in which the person acted (``steps["by_hand"]``), the tree is
fitted again to all that is stored, and the new one drives on.
"""

import math
from dataclasses import replace

from eutree.interaction import GuardedEnv
from eutree.recording.episodes import Recording, Trial
from eutree.recording.events import Command, DrivingView
from eutree.recording.play import DRIVING, OPENING, REVIEW, REVIEW_SECONDS, WATCHING, Play
from eutree.recording.scenes import Course, Programme
from eutree.recording.views import told

READ_SECONDS = 1.5  # after the end of an episode of which nothing is to be read
_COMMANDS = ("start", "pause", "redo", "end", "discard", "finish")


class Driving:
    """The driving of a tree while a person watches, or corrects it.

    After an episode whose failure is explained it waits for a key; after any other it goes on
    by itself.
    """

    def __init__(self, env: GuardedEnv, play: Play, recording: Recording) -> None:
        self._env, self._play, self._recording = env, play, recording
        self._programme: Programme | None = None
        self._is_new = self.is_paused = self._by_hand = False
        self._number = self._n_by_hand = 0
        self._course: Course | None = None
        self._began_at, self._follows = 0.0, False  # after a driven episode that is stored
        self._over_at: float | None = None  # inf until the page was told
        self._changed_at: float | None = None  # what is stored; until the tree is fitted again
        self._ending = ""
        self._success: bool | None = None
        self._before = (OPENING, Trial(None), play.pictures.pixels)

    @property
    def is_on(self) -> bool:
        """Whether the tree drives at present."""
        return self._play.state in (WATCHING, DRIVING)

    @property
    def waits(self) -> bool:
        """Whether the tree drives, but not at this moment: it is paused, or at an end."""
        return self.is_on and (self.is_paused or self._over_at is not None)

    @property
    def can_watch(self) -> bool:
        """Whether there is something to watch."""
        return self._programme is not None and bool(self._programme.scenes)

    @property
    def can_correct(self) -> bool:
        """Whether there is a tree that the person may correct."""
        return self._programme is not None and self._programme.refit is not None

    def offer(self, programme: Programme) -> None:
        """Show these episodes, as soon as no episode of the person is under way."""
        self._programme = programme
        self._is_new = bool(programme.scenes)

    def obey(self, command: Command, now: float) -> bool:
        """Obey a command if it is about the tree that drives; return whether it was."""
        name = command.name
        if name == "watch":
            self._is_new = self.can_watch
        elif name == "correct":
            if self.can_correct and self._play.state in (OPENING, REVIEW, WATCHING):
                self._begin(now, DRIVING)
        elif not self.is_on or name not in _COMMANDS:
            return False
        elif name == "finish":
            self._stop()
        elif name in ("end", "discard") or (name == "start" and self._over_at is not None):
            if not self._drop(now, "discarded" if name == "discard" else ""):
                self._go_on(now, self._number + 1)
        elif name == "redo" and self._play.state == WATCHING:
            self._go_on(now, self._number)
        elif name == "pause" or (name == "start" and self.is_paused):
            self._pause(now, on=not self.is_paused)
        return True

    def leave(self, now: float) -> None:
        """Wait, because nobody looks."""
        if self.is_on:
            self._pause(now, on=True)

    def advance(self, now: float) -> None:
        """Take the next step if it is due, or go on to the next episode."""
        play, programme = self._play, self._programme
        # What becomes of an episode is stored behind the tick in which that is decided.
        is_behind = self._changed_at is not None and now > self._changed_at
        if is_behind and programme is not None and play.state in (OPENING, REVIEW, DRIVING):
            self._changed_at = None
            programme = self._refit(programme)
            if self._over_at is None:
                self._course = Course(programme.policy)
        if self._is_new and play.state in (OPENING, REVIEW, WATCHING):
            self._begin(now, WATCHING)
        if not self.is_on or self.is_paused:
            return
        if play.pictures.is_unanswered(now):
            self._pause(now, on=True)
        elif self._over_at == math.inf:
            self._over_at = now
        elif self._over_at is not None:
            if not self._why and now >= self._over_at + READ_SECONDS:
                self._go_on(now, self._number + 1)
        elif play.pictures.is_complete and play.controls.pace.is_over(now):
            self._step(now)

    def view(self) -> DrivingView | None:
        """Return its fields on the page; None while the person alone acts."""
        if not self.is_on or self._programme is None or self._course is None:
            return None
        return DrivingView(
            number=self._number + 1,
            of=len(self._programme.scenes) if self._play.state == WATCHING else 0,
            action=self._course.action,
            by_hand=self._by_hand,
            n_by_hand=self._n_by_hand,
            note=self._programme.note,
            is_over=self._over_at is not None,
            is_paused=self.is_paused,
            ending=self._ending,
            success=self._success,
            why=self._why,
            nodes=self._course.nodes,
            tests=self._course.tests,
        )

    @property
    def _why(self) -> str:
        """The cause of the failure in the watched episode that is over."""
        programme, is_over = self._programme, self._over_at is not None
        if programme is None or self._play.state != WATCHING or not is_over or self._success:
            return ""
        return programme.scenes[self._number].why

    def _begin(self, now: float, state: str) -> None:
        if not self.is_on:
            self._before = (self._play.state, self._play.trial, self._play.pictures.pixels)
        self._is_new = False
        self._play.state = state
        self._go_on(now, 0)

    def _go_on(self, now: float, number: int) -> None:
        """Begin an episode; after the last one it is the person's turn again."""
        programme, play = self._programme, self._play
        watched = play.state == WATCHING
        if programme is None or (watched and number >= len(programme.scenes)):
            self._stop()
            return
        self._number, self._over_at, self.is_paused = number, None, False
        self._began_at, self._follows = now, number > 0 and play.trial.n_steps > 0
        self._ending, self._success, self._by_hand, self._n_by_hand = "", None, False, 0
        self._course = Course(programme.policy)
        play.controls.start()
        if watched:
            seed = programme.scenes[number].seed
            play.show(Trial(self._env.reset(seed), seed))
        else:
            self._recording.choose_start()
            play.show(self._recording.begin(play.controls.facts(), list(play.controls.held)))
        play.message = ""
        play.pictures.wait_from(now)
        play.controls.pace.restart(now)  # the first step is an interval away

    def _step(self, now: float) -> None:
        play, trial = self._play, self._play.trial
        if self._course is None or trial.observation is None:
            return
        if trial.is_over:
            if play.pictures.are_seen(now):
                # It is read from the next tick on: to fit a tree may take more than a second.
                self._over_at = math.inf
                if play.state == DRIVING and self._programme is not None:
                    self._refit(self._programme)
            return
        action = self._decided(self._course.decide(trial.observation, self._env.allowed))
        if play.state == WATCHING:
            row = trial.step(action, self._env.step(action), now, {})
            episode = trial.finish() if row.terminated or row.truncated else None
        else:
            measured = {**play.pictures.facts(play.controls.pace.speed), "by_hand": self._by_hand}
            action = self._recording.step(trial, action, now, measured)
            episode = self._recording.episodes[-1] if trial.is_over else None
        play.controls.action = action
        if episode is not None:
            self._ending, self._success = told(episode, self._env.env)
        play.controls.pace.begin(now)
        play.pictures.expect()

    def _decided(self, action: int) -> int:
        """Return the tree's action, or the person's where a key is held: the one pressed last."""
        controls, wait = self._play.controls, self._play.controls.keys.controls().get("wait")
        acting = [key for key in controls.held if key in (wait, *controls.keys.keys)]
        self._by_hand = self._play.state == DRIVING and (controls.is_active or wait in acting)
        self._n_by_hand += self._by_hand
        if self._by_hand and acting[-1:] == [wait]:  # the action without a key
            return controls.keys.action([], controls.action)
        return controls.chosen() if self._by_hand else action

    def _refit(self, programme: Programme) -> Programme:
        """Let the tree of all that is stored by now drive on."""
        if programme.refit is not None:
            programme = self._programme = replace(programme, policy=programme.refit())
        return programme

    def _drop(self, now: float, comment: str) -> bool:
        """End the driven episode that is under way, or discard the one that is over.

        Return whether that was the one before it, as the next one had hardly begun: it goes on.
        """
        recording, trial, last = self._recording, self._play.trial, self._recording.last
        if self._play.state != DRIVING or (trial.is_over and not comment):
            return False
        self._changed_at = now
        is_late = bool(comment) and self._follows and not trial.is_over
        is_late &= trial.n_steps == 0 or now < self._began_at + REVIEW_SECONDS
        if last is not None and (trial.is_over or (is_late and recording.episodes[last].kept)):
            recording.mark(last, kept=False, comment=comment)
            return is_late
        recording.stop(trial, kept=not comment, comment=comment)
        return False

    def _pause(self, now: float, *, on: bool) -> None:
        self.is_paused = on
        controls = self._play.controls
        controls.pace.stop(now) if on else controls.pace.resume(now)
        if on:
            controls.release()
        self._play.pictures.wait_from(now)

    def _stop(self) -> None:
        """Give the person the picture back."""
        play, was, driven = self._play, self._play.state, self._play.trial.n_steps
        if was == DRIVING and not play.trial.is_over:
            self._recording.stop(play.trial, kept=False, comment="left early")
        self.is_paused = False
        play.state, play.trial, pixels = self._before
        if was == WATCHING or play.state == OPENING or not driven:  # else it is the last episode's
            play.pictures.expect(pixels)
        play.controls.pace.finish()
        play.controls.start()
