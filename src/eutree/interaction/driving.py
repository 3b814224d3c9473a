"""A tree drives in the recorder's own picture, scene after scene; nothing of it is stored."""

from eutree.interaction.events import Command, DrivingView
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.play import OPENING, REVIEW, WATCHING, Play
from eutree.interaction.scenes import Course, Programme
from eutree.interaction.trial import Trial

READ_SECONDS = 1.5  # after the end of an episode of which nothing is to be read


class Driving:
    """What a tree shows while a person watches.

    After an episode of which there is something to read it waits for a key; after any other it goes
    on by itself.

    Args:
        env: The environment of the session.
        play: What the person sees, and at which pace.
    """

    def __init__(self, env: GuardedEnv, play: Play) -> None:
        self._env, self._play = env, play
        self._programme: Programme | None = None
        self._is_new = self._is_paused = False
        self._number = 0
        self._course: Course | None = None
        self._over_at: float | None = None
        self._ending = ""
        self._success: bool | None = None
        self._before: tuple[str, Trial] = (OPENING, Trial.unused())

    @property
    def is_on(self) -> bool:
        """Whether the tree drives at present."""
        return self._play.state == WATCHING

    @property
    def is_offered(self) -> bool:
        """Whether there is a tree to watch."""
        return self._programme is not None

    def offer(self, programme: Programme) -> None:
        """Show these episodes, as soon as no episode of the person is under way."""
        self._programme, self._is_new = programme, True

    def obey(self, command: Command, now: float) -> bool:
        """Obey a command if it is about what is watched; return whether it was."""
        name = command.name
        if name == "watch":
            self._is_new = self.is_offered
        elif not self.is_on or name not in ("start", "pause", "redo", "end", "discard", "finish"):
            return False
        elif name == "finish":
            self._stop()
        elif name == "end" or (name == "start" and self._over_at is not None):
            self._go_on(now, self._number + 1)
        elif name == "redo":
            self._go_on(now, self._number)
        elif name == "pause" or self._is_paused:
            self._pause(now, on=not self._is_paused)
        return True

    def leave(self, now: float) -> None:
        """Wait, because nobody looks."""
        if self.is_on:
            self._pause(now, on=True)

    def advance(self, now: float) -> None:
        """Take the tree's next step if it is due, or go on to the next episode."""
        play = self._play
        if self._is_new and (self.is_on or play.state in (OPENING, REVIEW)):
            self._begin(now)
        if not self.is_on or self._is_paused:
            return
        if play.pictures.is_unanswered(now):
            self._pause(now, on=True)
        elif self._over_at is not None:
            if not self._why and now >= self._over_at + READ_SECONDS:
                self._go_on(now, self._number + 1)
        elif play.pictures.is_complete and play.controls.pace.is_over(now):
            self._step(now)

    def view(self) -> DrivingView | None:
        """Return what the page shows of it; None while the person is the one who acts."""
        if not self.is_on or self._programme is None or self._course is None:
            return None
        return DrivingView(
            number=self._number + 1,
            of=len(self._programme.scenes),
            note=self._programme.note,
            is_over=self._over_at is not None,
            is_paused=self._is_paused,
            ending=self._ending,
            success=self._success,
            why=self._why,
            nodes=self._course.nodes,
            tests=self._course.tests,
        )

    @property
    def _why(self) -> str:
        """What went wrong in the episode that is over."""
        failed = self._over_at is not None and self._success is not True
        return self._programme.scenes[self._number].why if failed and self._programme else ""

    def _begin(self, now: float) -> None:
        if not self.is_on:
            self._before = (self._play.state, self._play.trial)
        self._is_new = False
        self._go_on(now, 0)

    def _go_on(self, now: float, number: int) -> None:
        """Begin an episode; after the last one it is the person's turn again."""
        if self._programme is None or number >= len(self._programme.scenes):
            self._stop()
            return
        self._number, self._over_at, self._is_paused = number, None, False
        self._ending, self._success = "", None
        seed = self._programme.scenes[number].seed
        self._course = Course(self._programme.policy)
        play = self._play
        play.show(Trial(self._env.reset(seed), seed))
        play.state, play.message = WATCHING, ""
        play.pictures.wait_from(now)
        play.controls.hands.start()
        play.controls.pace.restart(now)  # the first step is an interval away

    def _step(self, now: float) -> None:
        play = self._play
        if self._course is None or play.trial.observation is None:
            return
        if play.trial.is_over:
            if play.pictures.are_seen(now):
                self._over_at = now
            return
        action = self._course.decide(play.trial.observation)
        play.controls.hands.action = action
        row = play.trial.step(action, self._env.step(action), now, {})
        if row.terminated or row.truncated:
            episode = play.trial.finish()
            self._ending, self._success = episode.ending, episode.is_success
        play.controls.pace.begin(now)
        play.pictures.expect()

    def _pause(self, now: float, *, on: bool) -> None:
        self._is_paused = on
        pace = self._play.controls.pace
        pace.stop(now) if on else pace.resume(now)
        self._play.pictures.wait_from(now)

    def _stop(self) -> None:
        """Give the person the picture back."""
        self._play.state, self._play.trial = self._before
        self._play.controls.pace.finish()
        self._play.controls.hands.start()
