"""The recording engine: a person acts in an environment, step by step, on any clock.

A session has no clock and does no input or output. ``tick`` is given the time and the events since
the last tick; it answers with the view to show and the outputs to store. So a page and
a test drive the same engine.

The stored episode is the one that the person saw:

* The picture of step t is given out before the action of step t is read.
* The first action is read one interval after the countdown, so that a person can react to the first
  picture; without an idle action it is read when the first action key goes down.
* With each step go the time, the last picture that the viewer reported as drawn, the keys held,
  and when and over which picture they last changed. A late reaction stays in the data as it was.
* An episode that the person ends is ``"stopped"``, neither terminated nor truncated.
* When focus or connection is lost, all keys count as released and the episode pauses.

States::

    opening -> countdown -> playing -> review -> countdown ...      failed: the environment broke
                   ^           |         |
                   +-------- paused      +--> finished

While a tree drives (:mod:`eutree.recording.driving`) the state is ``"watching"``, or
``"driving"`` where the person may take over; then it is opening or review again, as before.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import ClassVar

from eutree.data import Episode
from eutree.data.episode import AGAIN
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.interaction import GuardedEnv
from eutree.recording.controls import QUICK, SPEEDS, Controls, Pace, frames_per_second, takes_turns
from eutree.recording.driving import Driving
from eutree.recording.episodes import Lessons, Recording
from eutree.recording.events import (
    ActionView,
    Away,
    Command,
    Event,
    KeyDown,
    KeyUp,
    Present,
    Seen,
    SessionSettings,
    Tick,
    View,
)
from eutree.recording.keys import START_KEYS, KeyMap, keys_of_environment
from eutree.recording.play import (
    DRIVING,
    FAILED,
    FINISHED,
    OPENING,
    PAUSED,
    PLAYING,
    REVIEW,
    WATCHING,
    Pictures,
    Play,
)
from eutree.recording.tree_making import Wishes
from eutree.recording.views import ENDLESS, never_ends, sensed, task_description

FEW = 2  # demonstrations before the page names a situation not shown yet
EDITS = ("cut", "flip", "all", "again", "undo", "accept")  # of the demonstrations


def check_is_seen(env: GuardedEnv) -> None:
    """Raise InvalidArgumentError unless an environment draws what a person has to see."""
    if env.env.render_mode != "rgb_array":
        raise InvalidArgumentError(
            "env must be made with render_mode='rgb_array' so that a person sees it, "
            f"got {env.env.render_mode!r}"
        )


class Session:
    """A person's recording session in one environment.

    Args:
        env: The environment, made with ``render_mode="rgb_array"``.
        keys: The meaning of the keys; None for the environment's own keys, else a suggestion.
        settings: Seed, target and pace, as a page or a command has them.
        recorded: Episodes recorded before, with their numbers, in order.
        free_start: The least number of a start that nobody else has taken, asked before each new
            one: two recorders may share a folder.

    Attributes:
        env: The environment.
        settings: The settings of the session.
        play: The course of the present episode.
        recording: The episodes.
        lessons: The steps to be imitated, and the changes to them.
        wishes: The person's wishes for the demonstrations.
        driving: The tree that the person watches, if there is one.
        task: The task in the environment's own words; may be empty.
        fault: The environment's breach of its contract; None as long as there is none.
        allowed: The commands that are obeyed; None for all.
    """

    COMMANDS: ClassVar[tuple[str, ...]] = (
        "start", "pause", "end", "redo", "discard", "finish", "slower", "faster", "wait", "mode",
        "speed", "toggle", "turn_based", "keep", "drop", "bind", "make", "practise", "stay",
        "watch", "correct", "choose", "missing", "hurting", "cut", "flip",
        "all", "again", "undo", "accept",
    )  # fmt: skip

    def __init__(
        self,
        env: GuardedEnv,
        *,
        keys: KeyMap | None = None,
        settings: SessionSettings | None = None,
        recorded: Sequence[tuple[int, Episode]] = (),
        free_start: Callable[[], int] = lambda: 0,
    ) -> None:
        check_is_seen(env)
        self.settings = settings or SessionSettings()
        self.env = env
        pace = Pace(self.settings.fps or frames_per_second(env))
        if self.settings.fps is None and pace.fps > QUICK:
            pace.speed = SPEEDS[0]
        controls = Controls(keys or keys_of_environment(env.env, env.schema), pace)
        if self.settings.fps is None and takes_turns(env, controls.keys):
            controls.set_mode(Command("turn_based", 1.0))
        self.play = Play(controls, Pictures(env), self.settings.countdown)
        self.recording = Recording(env, self.settings, recorded, free_start)
        self.lessons = Lessons(self.recording)
        self.wishes = Wishes(self.settings.makes)
        self.driving = Driving(env, self.play, self.recording)
        self.task = task_description(env.env)
        if never_ends(env.env):
            self.task = f"{self.task} {ENDLESS}".strip()
        self.fault: EnvironmentFault | None = None
        self.allowed: Collection[str] | None = None
        self._is_prepared = False

    @property
    def state(self) -> str:
        """The state of the session: one of those above."""
        return self.play.state

    @property
    def is_over(self) -> bool:
        """Whether the session has ended."""
        return self.state in (FINISHED, FAILED)

    @property
    def episodes(self) -> list[Episode]:
        """All episodes, discarded ones included."""
        return self.recording.episodes

    def tick(self, now: float, events: Iterable[Event] = ()) -> Tick:
        """Take in the events until ``now``; return the view to show and the outputs to store."""
        frame, known = None, self.recording.n_kept
        try:
            if self.state == OPENING and not self._is_prepared:
                self.play.show(self.recording.preview())
                self._is_prepared = True
            for event in events:
                self._take(event, now)
            self._advance(now)
            frame = self.play.picture(now)
            if FEW <= known < self.recording.n_kept < self.settings.target:
                self.wishes.look = True
        except EnvironmentFault as error:
            self.fault = error
            self.fail(str(error))
        return Tick(self._view(now), frame, self.recording.take_outputs())

    def due(self, now: float) -> float:
        """Return when ``tick`` next has something to do of its own accord."""
        return self.play.due(now)

    def fail(self, reason: str) -> None:
        """End with a clear screen after a fault; the steps so far are stored, but not used."""
        if not self.play.trial.is_over:
            self.recording.stop(self.play.trial, kept=False, comment=reason, ending="fault")
        self.play.state, self.play.message = FAILED, reason

    def _take(self, event: Event, now: float) -> None:
        if self.is_over:
            return
        if isinstance(event, KeyDown):
            playing = self.play.is_on and not self.driving.waits
            command = self.play.controls.command(event.key, playing=playing)
            # The key that lets a tree drive on does not act, even where it is an action's.
            goes_on = self.driving.is_paused and event.key in START_KEYS
            if (goes_on or self.play.key_down(event.key, event.frame, now)) and command is not None:
                self._obey(command, now)
        elif isinstance(event, KeyUp):
            self.play.key_up(event.key, event.frame, now)
        elif isinstance(event, Seen):
            self.play.pictures.saw(event.frame, now)
        elif isinstance(event, Away):
            self.driving.leave(now)
            self.play.leave(event.reason, now)
        elif not isinstance(event, Present):
            self._obey(event, now)

    def _obey(self, command: Command, now: float) -> None:
        name, value, play = command.name, command.value, self.play
        if self.allowed is not None and name not in self.allowed:
            return
        if (name != "finish" and self.wishes.stay()) or self.driving.obey(command, now):
            return
        if name in ("start", "pause", "end", "redo", "discard", "finish"):
            getattr(self, f"_obey_{name}")(now)
        elif name in ("make", "practise", "choose", "hurting", *EDITS):
            known = any(episode.kept for episode in self.episodes)
            if known and self.state in (OPENING, REVIEW, WATCHING):
                self._wish(name, int(value or 0), now)
        elif name == "missing":
            if self.recording.missing is not None and self.play.was_reviewed(now):
                self._begin(now, chosen=self.recording.missing.seed)
        elif name in ("slower", "faster", "speed"):
            play.controls.set_speed(command, now)
        elif name in ("mode", "toggle", "turn_based"):
            if not play.is_on:
                play.controls.set_mode(command)
        elif name == "wait":
            if play.awaits_turn():
                play.controls.add_turn(())
        elif name in ("keep", "drop") and isinstance(value, int | float) and value == int(value):
            self.recording.mark(int(value), kept=name == "keep")
        elif name == "bind" and self.state == OPENING and value in range(self.env.schema.n_actions):
            play.message = play.controls.bind(command.key, int(value or 0))

    def _wish(self, name: str, value: int, now: float) -> None:
        """Take up a wish for the demonstrations; segments cut or flipped are stored first."""
        if name not in EDITS:
            self.wishes.express(name, value)
        elif self.wishes.is_busy:
            return
        elif name in ("cut", "flip", "all"):
            numbers = range(len(self.lessons.hurts)) if name == "all" else (value,)
            if self.lessons.teach(numbers, None if name == "all" else name):
                self.wishes.express("without")
        elif name == "again":
            if self.lessons.choose_segment(value):
                self.driving.obey(Command("finish"), now)
                self._begin(now, again=True)
        else:
            if name == "undo":
                self.lessons.take_back()
            self.wishes.express(name)

    def _obey_start(self, now: float) -> None:
        if self.state == OPENING and self.driving.can_correct and not self.recording.n_kept:
            self.driving.obey(Command("correct"), now)
        elif self.state == OPENING or self.play.was_reviewed(now):
            if self.recording.is_enough and self.wishes.are_offered:
                self.wishes.express_first()
            elif self.recording.is_enough and self.state == REVIEW:
                self.play.state = FINISHED
            else:
                self._begin(now)
        elif self.state == PAUSED:
            self.play.count_down(now)

    def _obey_pause(self, now: float) -> None:
        if self.state == PAUSED:
            self._obey_start(now)
        elif self.play.is_on and not self.play.trial.is_over:
            self.play.pause(now)
            self.play.message = ""

    def _obey_end(self, now: float) -> None:
        if self.play.is_on or self.state == PAUSED:
            self._stop(now, kept=True)
        elif self.play.was_reviewed(now) or (self.state == OPENING and self.recording.is_enough):
            self._begin(now)  # also when the target is reached: one more

    def _obey_redo(self, now: float) -> None:
        # The start is advanced when an episode is kept.
        start = self.recording.start - (not self.play.is_running)
        if self._obey_discard(now, "redone"):
            self.recording.start = start
            self._begin(now, again=True)

    def _obey_discard(self, now: float, comment: str = "discarded") -> bool:
        if self.play.is_running:
            self._stop(now, kept=False, comment=comment)
        elif self.state in (PLAYING, REVIEW) and self.recording.last is not None:
            self.recording.mark(self.recording.last, kept=False, comment=comment)
        else:
            return False
        return True

    def _obey_finish(self, now: float) -> None:
        if self.play.is_on:
            self._obey_pause(now)
        elif self.state == PAUSED:
            self._stop(now, kept=False, comment="left early")
        elif self.state in (OPENING, REVIEW) and self.wishes.leave():
            self.play.state = FINISHED

    def _begin(self, now: float, *, again: bool = False, chosen: int | None = None) -> None:
        """Reset for the next episode, for the same one again or one by its seed; count down."""
        if not again:
            self.recording.choose_start(chosen)
            self.lessons.again = None
        controls = self.play.controls
        extras = {**controls.facts(), "viewer": self.settings.viewer}
        if self.lessons.again is not None:
            extras[AGAIN] = True
        trial = self.recording.begin(extras, list(controls.held))
        self.lessons.go_there(trial, now, self.play.pictures.facts(controls.pace.speed))
        self.play.show(trial)
        self.play.count_in(now)

    def _stop(self, now: float, *, kept: bool, comment: str = "") -> None:
        if not self.play.trial.is_over:
            self.recording.stop(self.play.trial, kept=kept, comment=comment)
            if not self.play.trial.n_steps:
                self.recording.last = None
            self.play.review(now)

    def _advance(self, now: float) -> None:
        """Take the step that is due, the tree's or the person's."""
        play = self.play
        self.driving.advance(now)
        action = play.decision(now)
        if action is not None:
            measured = play.pictures.facts(play.controls.pace.speed)
            play.controls.action = self.recording.step(play.trial, action, now, measured)
            play.controls.pace.begin(now)
            play.pictures.expect()

    def _view(self, now: float) -> View:
        controls, schema = self.play.controls, self.env.schema
        keys, pace = controls.keys, controls.pace
        episodes, play = self.recording.views(), self.play.view_fields(now)
        if self.state in (PLAYING, DRIVING) and self.play.trial.is_over:
            # Nothing is said of an end that is still to be seen.
            episodes = episodes[: self.recording.last]
        return View(
            environment=self.env.name,
            saved=sum(episode.kept and episode.by_hand is None for episode in episodes),
            target=self.settings.target,
            episodes=episodes,
            last=self.recording.last,
            leaving=self.wishes.is_leaving,
            task=self.task,
            makes=self.settings.makes,
            missing="" if self.recording.missing is None else self.recording.missing.why,
            can_watch=self.driving.can_watch,
            can_correct=self.driving.can_correct,
            driving=self.driving.view(),
            numbers=sensed(schema, self.play.trial.observation) if self.settings.hud else None,
            action=controls.action,
            held=list(controls.held),
            toggle=controls.toggle,
            keys_chosen=keys.chosen,
            actions=[
                ActionView(name, keys.keys_of(action), action == keys.idle)
                for action, name in enumerate(schema.actions)
            ],
            controls=keys.controls(),
            speed=pace.speed,
            turn_based=pace.turn_based,
            interval=pace.interval,
            beat=pace.beat,
            is_slowed=self.settings.fps is None and pace.fps > QUICK and pace.speed < 1.0,
            **play | {"coming": self.recording.taken(play["coming"])},
        )
