"""The recording engine: a person acts in an environment, step by step, on anybody's clock.

A session has no clock and does no input or output. ``tick`` is told what time it is and what
happened since the last tick; it answers with what to show and what to store. So a page, a window
and a test drive the same engine.

What is stored is what the person saw:

* The picture of step t is given out before the action of step t is read.
* The first action is read one interval after the countdown, so that whoever reacts to what they
  see has the time to; without an idle action it is read when the first action key goes down.
* With each step go the time, the last picture that the viewer reported as drawn, the keys held,
  and when and over which picture they last changed. A late reaction stays in the data as it was.
* An episode that the person ends is ``"stopped"``, neither terminated nor truncated.
* When focus or connection is lost, all keys count as released and the episode pauses.

States::

    opening -> countdown -> playing -> review -> countdown ...      failed: the environment broke
                   ^           |         |
                   +-------- paused      +--> finished
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from eutree.data import Episode
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.interaction.events import (
    Away,
    Command,
    EpisodeChanged,
    Event,
    Frame,
    KeyDown,
    KeyUp,
    Output,
    Present,
    Seen,
    Tick,
    View,
)
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.hands import Hands
from eutree.interaction.keys import START_KEYS, KeyMap, keys_of_environment
from eutree.interaction.pace import QUICK, SPEEDS, Pace
from eutree.interaction.pictures import Pictures
from eutree.interaction.seeding import Stream, episode_seed
from eutree.interaction.settings import SessionSettings, frames_per_second
from eutree.interaction.tree_making import Wishes
from eutree.interaction.trial import Answer, Trial
from eutree.interaction.views import (
    episode_views,
    hands_fields,
    pace_fields,
    sensed,
    task_description,
)

OPENING, COUNTDOWN, PLAYING = "opening", "countdown", "playing"
PAUSED, REVIEW, FINISHED, FAILED = "paused", "review", "finished", "failed"

REVIEW_SECONDS = 0.7  # a key pressed this soon after the end was meant for the episode
_TOLERANCE = 1e-9


class Session:
    """A person's recording session in one environment.

    Args:
        env: The environment, made with ``render_mode="rgb_array"``.
        keys: What the keys mean; None for the environment's own keys, else a suggestion.
        settings: Everything else.
        recorded: Episodes recorded before, with their numbers, in order.
        free_start: The least number of a start that nobody else has taken, asked before each new
            one: two recorders may share a folder.
    """

    COMMANDS: ClassVar[tuple[str, ...]] = (
        "start", "pause", "end", "redo", "discard", "finish", "slower", "faster", "wait", "mode",
        "speed", "toggle", "turn_based", "keep", "drop", "bind", "make", "practise",
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
        if env.env.render_mode != "rgb_array":
            raise InvalidArgumentError(
                "env must be made with render_mode='rgb_array' so that a person sees it, "
                f"got {env.env.render_mode!r}"
            )
        self.settings = settings or SessionSettings()
        self.env = env
        self._hands = Hands(keys or keys_of_environment(env.env, env.schema))
        self.state = OPENING
        self.pace = Pace(self.settings.fps or frames_per_second(env))
        if self.settings.fps is None and self.pace.fps > QUICK:
            self.pace.speed = SPEEDS[0]
        self._task = task_description(env.env)
        self.episodes = [episode for _, episode in recorded]
        self._numbers = [number for number, _ in recorded]
        self._trial: Trial | None = None
        self._start = self.settings.first  # number of the present start
        self._free_start = free_start
        self._last: int | None = None  # place of this session's last episode in the list
        self._message = ""
        self._countdown_end = self._review_began = 0.0
        self._pictures = Pictures(env)
        self._fresh = False  # the countdown is that of an episode's first decision
        self._awaits_key = False  # the first decision comes with the first action key
        self.wishes = Wishes(self.settings.makes)
        self._outputs: list[Output] = []
        self.fault: EnvironmentFault | None = None  # what the environment did wrong

    @property
    def keys(self) -> KeyMap:
        """What the keys mean."""
        return self._hands.keys

    @property
    def is_over(self) -> bool:
        """Whether the session has ended."""
        return self.state in (FINISHED, FAILED)

    @property
    def n_kept(self) -> int:
        """Number of kept episodes."""
        return sum(episode.kept for episode in self.episodes)

    def tick(self, now: float, events: Iterable[Event] = ()) -> Tick:
        """Take in what happened until ``now``; return what to show and to store."""
        frame = None
        try:
            if self._trial is None and self.state == OPENING:
                self._prepare()
            for event in events:
                self._take(event, now)
            self._advance(now)
            frame = self._picture(now)
        except EnvironmentFault as error:
            self.fault = error
            self._break(str(error))
        outputs, self._outputs = self._outputs, []
        return Tick(self._view(now), frame, outputs)

    def due(self, now: float) -> float:
        """Return when ``tick`` next has something to do of its own accord."""
        if self.state == COUNTDOWN:
            left = self._countdown_end - now
            return now + (left % 1.0 or min(left, 1.0)) if left > 0.0 else now
        if self.state != PLAYING:
            return now + 1.0
        if self._awaits_key and self._pictures.is_complete:
            return now + 1.0
        if self.pace.shown(now) < 1.0:
            return self._pictures.due()
        return self.pace.due(now) if self._pictures.is_complete and not self._waits() else now

    def fail(self, reason: str) -> list[Output]:
        """End the session because of a fault outside; return what is still to be stored."""
        self._break(reason)
        outputs, self._outputs = self._outputs, []
        return outputs

    # ---- what happened

    def _take(self, event: Event, now: float) -> None:
        if self.is_over:
            return
        if isinstance(event, KeyDown):
            self._key_down(event, now)
        elif isinstance(event, KeyUp):
            self._key_up(event, now)
        elif isinstance(event, Seen):
            self._pictures.saw(event.frame, now)
        elif isinstance(event, Away):
            self._leave(event.reason, now)
        elif not isinstance(event, Present):
            self._obey(event, now)

    def _key_down(self, event: KeyDown, now: float) -> None:
        if event.key in self._hands.held:
            return
        self._hands.held[event.key] = None
        self._edge(event.key, now, event.frame, down=True)
        if self.state in (COUNTDOWN, PLAYING) and event.key in self.keys.keys:
            self._hands.press(event.key)
            if self.pace.turn_based and self._waits():
                self._hands.turn = list(self._hands.held)
            return
        command = self.keys.command(event.key)
        if self.state not in (COUNTDOWN, PLAYING) and event.key in START_KEYS:
            command = "start"
        if command is not None:
            self._obey(Command(command), now)

    def _key_up(self, event: KeyUp, now: float) -> None:
        if event.key in self._hands.held:
            del self._hands.held[event.key]
            self._edge(event.key, now, event.frame, down=False)

    def _edge(self, key: str, now: float, frame: int, *, down: bool) -> None:
        self._pictures.saw(frame, now)
        if self._trial is not None:
            seen = min(max(frame, 0), self._pictures.given)  # no picture that was never given out
            self._trial.edge(key, now, seen, down=down)

    def _leave(self, reason: str, now: float) -> None:
        for key in list(self._hands.held):
            self._edge(key, now, self._pictures.drawn, down=False)
        self._hands.release()
        if self.state in (COUNTDOWN, PLAYING) and self._trial is not None:
            if not self._trial.is_over:
                self._pause(now)
            self._message = reason

    # ---- commands

    def _obey(self, command: Command, now: float) -> None:
        name, value = command.name, command.value
        if name == "start":
            self._obey_start(now)
        elif name in ("make", "practise"):
            if self.n_kept and self.state in (OPENING, REVIEW):
                self.wishes.express(name)
        elif name in ("end", "redo", "discard", "finish", "pause", "wait", "mode"):
            getattr(self, f"_obey_{name}")(now)
        elif name in ("slower", "faster"):
            self.pace.shift_speed(now, 1 if name == "faster" else -1)
        elif name == "speed" and isinstance(value, int | float) and value in SPEEDS:
            self.pace.set_speed(now, float(value))
        elif name in ("toggle", "turn_based") and self.state not in (COUNTDOWN, PLAYING):
            self._set_mode(name, bool(value))
        elif name in ("keep", "drop") and isinstance(value, int | float) and value == int(value):
            self._mark(int(value), kept=name == "keep", comment="")
        elif name == "bind" and self.state == OPENING and isinstance(value, int | float):
            self._bind(int(value), command.key)

    def _obey_start(self, now: float) -> None:
        if self.state == OPENING or (
            self.state == REVIEW and now >= self._review_began + REVIEW_SECONDS
        ):
            if self._is_enough() and self.wishes.are_offered:
                self.wishes.express_first()
            elif self._is_enough() and self.state == REVIEW:
                self.state = FINISHED
            else:
                self._begin(now)
        elif self.state == PAUSED:
            self._count_down(now, self.settings.countdown / 3.0)

    def _is_enough(self) -> bool:
        return self.n_kept >= self.settings.target

    def _obey_pause(self, now: float) -> None:
        if self.state == PAUSED:
            self._obey_start(now)
        elif self.state in (COUNTDOWN, PLAYING) and self._trial and not self._trial.is_over:
            self._pause(now)
            self._message = ""

    def _obey_end(self, now: float) -> None:
        if self.state in (COUNTDOWN, PLAYING, PAUSED):
            self._stop(now, kept=True, comment="")
        elif self.state == REVIEW or (self.state == OPENING and self._is_enough()):
            self._begin(now)  # also when the target is reached: one more

    def _obey_redo(self, now: float) -> None:
        start = self._start  # it is advanced when an episode is kept
        if self.state in (COUNTDOWN, PLAYING, PAUSED) and not self._has_ended():
            self._stop(now, kept=False, comment="redone")
        elif self.state in (PLAYING, REVIEW) and self._last is not None:
            self._mark(self._last, kept=False, comment="redone")
            start -= 1
        else:
            return
        self._start = start
        self._begin(now, again=True)

    def _obey_discard(self, now: float) -> None:
        if self.state in (COUNTDOWN, PLAYING, PAUSED) and not self._has_ended():
            self._stop(now, kept=False, comment="discarded")
        elif self.state in (PLAYING, REVIEW) and self._last is not None:
            self._mark(self._last, kept=False, comment="discarded")

    def _obey_finish(self, now: float) -> None:
        if self.state in (COUNTDOWN, PLAYING):
            self._obey_pause(now)
        elif self.state == PAUSED:
            self._stop(now, kept=True, comment="")
        elif self.state in (OPENING, REVIEW):
            self.state = FINISHED

    def _obey_wait(self, now: float) -> None:
        if self.state == PLAYING and self.pace.turn_based and self._waits():
            self._hands.turn = []

    def _obey_mode(self, now: float) -> None:
        """Go on to the next mode: hold, toggle, turn-based."""
        if self.state not in (COUNTDOWN, PLAYING):
            toggle, turn_based = self._hands.toggle, self.pace.turn_based
            self._set_mode("toggle", not toggle and not turn_based)
            self._set_mode("turn_based", toggle)

    def _set_mode(self, name: str, value: bool) -> None:
        if name == "toggle":
            self._hands.set_toggle(value)
        else:
            self.pace.turn_based = value
            self.pace.finish()
            self._hands.turn = None

    def _bind(self, action: int, key: str) -> None:
        if 0 <= action < self.env.schema.n_actions:
            try:
                self._hands.keys = self.keys.with_key(key, action)
            except InvalidArgumentError as error:
                self._message = str(error)

    def _mark(self, index: int, *, kept: bool, comment: str) -> None:
        if 0 <= index < len(self.episodes) and self.episodes[index].kept != kept:
            changed = replace(self.episodes[index], kept=kept, comment=comment)
            self.episodes[index] = changed
            self._outputs.append(EpisodeChanged(index, changed))

    # ---- the course of an episode

    def _prepare(self) -> None:
        """Reset the environment for the picture of the opening screen."""
        self.env.reset(self._seed())
        self._pictures.expect()
        self._trial = Trial.unused()

    def _begin(self, now: float, *, again: bool = False) -> None:
        """Reset for the next episode, or for the same one again, and count down."""
        if not again:
            self._start = max(self._start, self._free_start())
        self._trial = Trial.unused()
        observation = self.env.reset(self._seed())
        extras = {**self._hands.facts(), **self.pace.facts(), "viewer": self.settings.viewer}
        self._trial = Trial(observation, self._seed(), extras, self._hands.held)
        self._outputs.append(self._trial.started())
        self._pictures.expect()
        self._count_in(now)

    def _count_in(self, now: float) -> None:
        """Count down to the first decision."""
        self._hands.start()
        self._fresh, self._awaits_key = True, False
        self.pace.finish()
        self._count_down(now, 0.0 if self.pace.turn_based else self.settings.countdown)

    def _play(self, now: float) -> None:
        """Begin to play, or go on."""
        self.state = PLAYING
        self._pictures.wait_from(now)
        if self._fresh and not self.pace.turn_based:
            if self.keys.idle is None:
                self._awaits_key = True
            else:
                self.pace.restart(now)
        else:
            self.pace.resume(now)
        self._fresh = False

    def _count_down(self, now: float, seconds: float) -> None:
        self.state, self._message = COUNTDOWN, ""
        self._countdown_end = now + seconds

    def _pause(self, now: float) -> None:
        self.state = PAUSED
        self.pace.stop(now)
        for key in list(self._hands.held):
            self._edge(key, now, self._pictures.drawn, down=False)
        self._hands.held.clear()
        self._hands.turn = None

    def _advance(self, now: float) -> None:
        if self.state == COUNTDOWN and now >= self._countdown_end - _TOLERANCE:
            self._play(now)
        if self.state != PLAYING or self._trial is None:
            return
        if self._pictures.is_unanswered(now) and not self._trial.is_over:
            self._leave("The page stopped answering.", now)
            return
        if not self._pictures.is_complete or self.pace.elapsed(now) < 1.0 - _TOLERANCE:
            return
        if self._trial.is_over:
            self.state, self._review_began = REVIEW, now
        elif self._awaits_key and not self._hands.is_active:
            return
        elif not self.pace.turn_based:
            self._awaits_key = False
            self._step(self._chosen(), now)
        elif self._hands.turn is not None:
            action, self._hands.turn = self._chosen(), None
            self._step(action, now)

    def _waits(self) -> bool:
        """Return whether a turn may be taken now."""
        return self.state == PLAYING and self._pictures.is_complete and not self._has_ended()

    def _has_ended(self) -> bool:
        return self._trial is not None and self._trial.is_over

    def _chosen(self) -> int:
        return self._hands.chosen(turn_based=self.pace.turn_based)

    def _step(self, action: int, now: float) -> None:
        trial = self._trial
        if trial is None:
            return
        pictures, speed = self._pictures, self.pace.speed
        measured = {"frame": pictures.drawn, "picture": pictures.given, "speed": speed}
        self._hands.action = action
        output = trial.step(action, self._answer(action), now, measured)
        self._outputs.append(output)
        self.pace.begin(now)
        self._pictures.expect()
        if output.terminated or output.truncated:
            self._keep(trial.finish())

    def _answer(self, action: int) -> Answer:
        """Take the step in the environment."""
        return self.env.step(action)

    def _keep(self, episode: Episode) -> None:
        """Put a finished episode into the list, to be stored at once."""
        self._last = len(self.episodes)
        self.episodes.append(episode)
        self._numbers.append(max(self._numbers, default=-1) + 1)
        self._start += 1
        if self._trial is not None:
            self._outputs.append(self._trial.ended(self._last, episode))

    def _stop(self, now: float, *, kept: bool, comment: str) -> None:
        """End the running episode, by the person's wish."""
        if self._trial is None or self._trial.is_over:
            return
        if self._trial.n_steps:
            self._keep(replace(self._trial.stop(), kept=kept, comment=comment))
        else:
            self._outputs.append(self._trial.abandoned())  # nothing was shown: the start is unused
            self._last = None
        self.pace.finish()
        self.state, self._review_began, self._message = REVIEW, now, ""

    def _break(self, reason: str) -> None:
        """End with a clear screen; the steps so far are stored, but not used."""
        trial = self._trial
        if trial is not None and trial.is_running:
            if trial.n_steps:
                self._keep(replace(trial.stop("fault"), kept=False, comment=reason))
            else:
                self._outputs.append(trial.abandoned())
        self.state, self._message = FAILED, reason

    def _seed(self) -> int:
        return episode_seed(self.settings.seed, self._start, Stream.PERSON)

    # ---- what to show

    def _picture(self, now: float) -> Frame | None:
        """Return a new picture if one is due."""
        moves = self._trial is not None and self._trial.n_steps > 0
        share = self.pace.shown(now) if moves else 1.0
        return None if self.is_over else self._pictures.next(now, share)

    def _view(self, now: float) -> View:
        left = self._countdown_end - now if self.state == COUNTDOWN else 0.0
        trial = self._trial
        return View(
            state=self.state,
            environment=self.env.name,
            message=self._message,
            countdown=int(np.ceil(left - _TOLERANCE)),
            step=trial.n_steps if trial is not None else 0,
            saved=self.n_kept,
            target=self.settings.target,
            episodes=episode_views(self._numbers, self.episodes),
            coming=self._chosen() if self.state in (COUNTDOWN, PLAYING) else 0,
            awaits_key=self.state == PLAYING and self._awaits_key,
            task=self._task,
            makes=self.settings.makes,
            **hands_fields(self._hands, self.env.schema),
            **pace_fields(self.pace, is_own=self.settings.fps is None),
            numbers=sensed(self.env.schema, trial) if self.settings.hud else None,
            size=self._pictures.size,
        )
