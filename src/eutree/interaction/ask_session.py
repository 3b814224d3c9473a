"""A session in which a learner asks a person to act for a stretch.

The same engine as a recording: keys, pace, pictures, pauses. But nothing is reset and nothing is
stored here: an episode is under way already, and each step goes to the learner. States::

    waiting -> asked -> countdown -> playing -> waiting ...
                  |         ^          |
                  |         +- paused -+      no answer in time, or no page is open: waiting
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import gymnasium

from eutree.interaction.events import Away, Command, Event, Present, Tick, View
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.keys import KeyMap, parse_keys
from eutree.interaction.play import ASKED, FAILED, FINISHED, PAUSED, REVIEW, WAITING
from eutree.interaction.recording import Recording
from eutree.interaction.requests import HANDED_BACK, Request, Stretch
from eutree.interaction.session import Session
from eutree.interaction.settings import SessionSettings
from eutree.interaction.trial import Trial

GRACE_SECONDS = 5.0  # for a page that was closed or reloaded to come back
_COMMANDS = ("start", "pause", "finish", "slower", "faster", "speed", "mode", "wait", "toggle",
             "turn_based", "bind")  # fmt: skip
_SHOWN = ("pause", "finish", "slower", "faster", "mode", "wait")


class _Stretches(Recording):
    """Steps of stretches: nothing is stored here, for the learner has it.

    Attributes:
        stretch: The stretch under way; None between two.
    """

    stretch: Stretch | None = None

    def step(self, trial: Trial, action: int, now: float, measured: dict[str, Any]) -> None:
        """Let the learner take a step."""
        if self.stretch is not None:
            trial.step(action, self.stretch.step(action), now, measured)
            trial.is_over = self.stretch.is_over


class AskSession(Session):
    """A person's desk while a learner learns.

    Args:
        env: The environment that is learned in, made with ``render_mode="rgb_array"``.
        keys: What the keys mean; None for the environment's own, else a suggestion.
        settings: Pace, countdown and so on; targets and seeds mean nothing here.
        patience: Seconds in which a request, or a pause, must be answered.

    Attributes:
        said: How the last stretch was left: ``HANDED_BACK`` by the person or for want of an
            answer, empty while it is under way.
    """

    def __init__(
        self,
        env: GuardedEnv,
        *,
        keys: KeyMap | None = None,
        settings: SessionSettings | None = None,
        patience: float = 60.0,
    ) -> None:
        super().__init__(env, keys=keys, settings=settings)
        self.play.state = WAITING
        self.said = HANDED_BACK
        self._stretches = _Stretches(env, self.settings)
        self.recording = self._stretches
        self._patience = patience
        self._deadline = 0.0
        self._left: float | None = None  # when the last viewer left; None while one is there
        self._request: Request | None = None

    def ask(self, request: Request, stretch: Stretch, now: float) -> None:
        """Show the situation and wait for the person."""
        self._request, self._stretches.stretch, self.said = request, stretch, ""
        self.play.state, self.play.message = ASKED, request.text
        self.play.show(Trial.unused())
        self._deadline = self._latest(now)

    def fail(self, reason: str) -> None:
        """End with a clear screen, because of a fault."""
        self.play.state, self.play.message, self.said = FAILED, reason, HANDED_BACK

    def _latest(self, now: float) -> float:
        """Return until when an answer is awaited: briefly where nobody is there to give it."""
        patience = now + self._patience
        return patience if self._left is None else min(patience, self._left + GRACE_SECONDS)

    @contextmanager
    def _waiting_in_pauses(self, now: float) -> Iterator[None]:
        """Let patience begin anew where a pause begins."""
        before = self.state
        yield
        if self.state == PAUSED != before:
            self._deadline = self._latest(now)

    def _take(self, event: Event, now: float) -> None:
        if isinstance(event, Command) and event.name not in _COMMANDS:
            return
        with self._waiting_in_pauses(now):
            super()._take(event, now)
        if isinstance(event, Away) and event.gone:
            self._left = now
            self._deadline = min(self._deadline, now + GRACE_SECONDS)
        elif isinstance(event, Present):
            self._left = None
            self._deadline = now + self._patience

    def _obey(self, command: Command, now: float) -> None:
        if command.name in _COMMANDS:
            super()._obey(command, now)

    def _obey_start(self, now: float) -> None:
        if self.state == ASKED and self._request is not None:
            controls = self.play.controls
            extras = {"keys": list(controls.keys.keys)}
            observation = self._request.observations[-1]
            self.play.trial = Trial(observation, 0, extras, controls.hands.held)
            self.play.count_in(now)
        else:
            super()._obey_start(now)

    def _obey_finish(self, now: float) -> None:
        self._hand_back()

    def _advance(self, now: float) -> None:
        if self.state in (ASKED, PAUSED) and now >= self._deadline:
            self._hand_back()
        with self._waiting_in_pauses(now):
            super()._advance(now)
        if self.state == REVIEW:  # the last step's movement has been shown
            self._hand_back()

    def _hand_back(self) -> None:
        if self.said:
            return
        self.said, self.play.state, self.play.message = HANDED_BACK, WAITING, ""
        self.play.controls.hands.held.clear()
        self._stretches.stretch = None

    def _view(self, now: float) -> View:
        view = super()._view(now)
        request = self._request
        left = max(self._deadline - now, 0.0)
        return replace(
            view,
            saved=0 if request is None else request.number,
            target=self.settings.target if request is None else request.of,
            countdown=int(left + 1) if self.state in (ASKED, PAUSED) else view.countdown,
            controls={name: key for name, key in view.controls.items() if name in _SHOWN},
        )


class Desk:
    """Where requests wait for a session to take them up: the engine of a page.

    Args:
        env: The environment that is learned in, made with ``render_mode="rgb_array"``.
        keys: What the keys mean, as text or as a map; None for the environment's own.
        settings: Pace, countdown and so on.
        patience: Seconds in which a request must be answered.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        *,
        keys: str | KeyMap | None = None,
        settings: SessionSettings | None = None,
        patience: float = 60.0,
    ) -> None:
        guarded = GuardedEnv(env)
        if isinstance(keys, str):
            keys = parse_keys(keys, guarded.schema)
        self._asks = AskSession(guarded, keys=keys, settings=settings, patience=patience)
        self.session: Session = self._asks
        self._next: tuple[Request, Stretch] | None = None
        self._finished = False

    @property
    def is_open(self) -> bool:
        """Whether a request waits or is being answered."""
        return self._next is not None or not self._asks.said

    def put(self, request: Request, stretch: Stretch) -> None:
        """Lay a request on the desk; the next tick takes it up."""
        self._next = (request, stretch)

    def finish(self) -> None:
        """Let the next tick be the last one."""
        self._finished = True

    def tick(self, now: float, events: Iterable[Event] = ()) -> Tick:
        """Take up what lies there; let the session act."""
        if self._finished:
            self.session.play.state = FINISHED
        if self._next is not None:
            self._asks.ask(*self._next, now)
            self._next = None
        return self.session.tick(now, events)
