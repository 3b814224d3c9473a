"""A desktop window in which a person records: keyboard and gamepad, the same engine as the page."""

import os
import time
from dataclasses import dataclass, field
from typing import Any

from eutree.errors import MissingExtraError
from eutree.interaction.engine import Engine
from eutree.interaction.events import Away, Command, Event, KeyDown, KeyUp, Seen, Tick
from eutree.interaction.keys import NAMED_KEYS
from eutree.interaction.play import COUNTDOWN, PLAYING
from eutree.interaction.recorder import Recorder
from eutree.interaction.signals import orderly_end

LOST = "The window lost the focus."
TICK_SECONDS = 1.0 / 60.0
CHOOSE, CHANGE = "tab", "k"  # of the list of episodes
STICK = 0.5  # how far a stick must be pushed to count as an arrow key

_NAMES = {"return": "enter", "enter": "enter", "=": "+", "[+]": "+", "[-]": "-"}
_LETTERS = {4 + n: chr(ord("a") + n) for n in range(26)}  # scan codes: places on the keyboard
_DIGITS = {30 + n: str((n + 1) % 10) for n in range(10)}
_PLACES = {**_LETTERS, **_DIGITS, 45: "-", 46: "+", 55: "."}
_HAT = (("left", "right"), ("down", "up"))  # by axis: negative, positive
_STICK_KEYS = (("left", "right"), ("up", "down"))
_PAUSE_BUTTONS, _FIRST_START_BUTTON = (6, 8), 7


def record_in_window(recorder: Recorder) -> None:
    """Let a person record in a window until the session is over or the window is closed.

    Raises:
        MissingExtraError: pygame-ce is not installed.
        EnvironmentFault: The environment broke its contract; what was recorded is stored.
        FileError: The folder can no longer be written; what was recorded before is stored.
    """
    with orderly_end():
        window = Window(recorder)
        try:
            window.run()
        finally:
            recorder.close()
            window.close()
    recorder.raise_failure()


@dataclass
class Gamepad:
    """What a gamepad's buttons, hat and sticks mean: keys that go down and up.

    Attributes:
        action_keys: Keys that the first buttons press, in the order of the actions.
    """

    action_keys: list[str]
    _down: dict[tuple[str, int], str] = field(default_factory=dict)

    def button(self, number: int, *, down: bool) -> list[Event]:
        """Return what a button means."""
        if number < min(len(self.action_keys), 4):
            key = self.action_keys[number]
            return [KeyDown(key) if down else KeyUp(key)]
        if not down:
            return []
        if number in _PAUSE_BUTTONS:
            return [Command("pause")]
        return [Command("start")] if number == _FIRST_START_BUTTON else []

    def axis(self, kind: str, number: int, value: float) -> list[Event]:
        """Return what a stick or a hat means: an arrow key while it is pushed."""
        if number > 1:
            return []
        names = (_HAT if kind == "hat" else _STICK_KEYS)[number]
        wanted = "" if abs(value) < STICK else names[value > 0]
        held = self._down.get((kind, number), "")
        if wanted == held:
            return []
        self._down[(kind, number)] = wanted
        changes: list[Event] = [KeyUp(held)] if held else []
        return [*changes, KeyDown(wanted)] if wanted else changes

    def release(self) -> None:
        """Forget what is pushed."""
        self._down.clear()


class Window:
    """The window: its loop, what its events mean, and its clock.

    Args:
        recorder: What is shown and driven.

    Attributes:
        is_closed: Whether the person has closed the window.
    """

    def __init__(self, recorder: Engine) -> None:
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame
        except ImportError:
            raise MissingExtraError("pygame-ce", "record") from None
        from eutree.interaction.window_screen import Screen

        self._pygame: Any = pygame
        self.recorder = recorder
        pygame.display.init()
        pygame.joystick.init()
        self._screen = Screen()
        self._clock = pygame.time.Clock()
        self._began = time.monotonic()
        self._frame = 0
        keys = recorder.session.play.controls.keys
        actions = range(recorder.session.env.schema.n_actions)
        first = [
            keys.keys_of(action)[0].split("+")[0] for action in actions if keys.keys_of(action)
        ]
        self._gamepad = Gamepad(first)
        self._joysticks: dict[int, Any] = {}  # held, or pygame forgets them
        self._down: dict[int, str] = {}  # names of the keys held, by their place on the keyboard
        self.is_closed = False

    def run(self) -> None:
        """Play the session; a finished one shows its last screen until a key is pressed."""
        while not (self.recorder.session.is_over or self.is_closed):
            self.tick()
            self.pause()
        if not self.is_closed:
            self._linger()

    def tick(self) -> Tick:
        """Take in the window's events, let the session act, and draw what it says."""
        events: list[Event] = [Seen(self._frame)]
        for event in self._pygame.event.get():
            events += self._meaning(event)
        tick = self.recorder.tick(time.monotonic() - self._began, events)
        self._screen.draw(tick)
        if tick.frame is not None:
            self._frame = tick.frame.number
        return tick

    def pause(self) -> None:
        """Wait for the time of the next tick."""
        self._clock.tick(1.0 / TICK_SECONDS)

    def close(self) -> None:
        """Close the window and let go of the display."""
        self._pygame.joystick.quit()
        self._pygame.display.quit()

    def _linger(self) -> None:
        """Keep the last screen until a key or the window's button is pressed."""
        pygame = self._pygame
        self._screen.draw(self.recorder.session.tick(time.monotonic() - self._began))
        while not any(event.type in (pygame.QUIT, pygame.KEYDOWN) for event in pygame.event.get()):
            self.pause()

    def _meaning(self, event: Any) -> list[Event]:
        """Return what an event of pygame means to the session."""
        pygame = self._pygame
        if event.type == pygame.QUIT:
            self.is_closed = True
            return [Away(LOST)]
        if event.type == pygame.WINDOWFOCUSLOST:
            self._gamepad.release()
            return [Away(LOST)]
        if event.type == pygame.MOUSEBUTTONDOWN:
            row = self._screen.episode_at(event.pos)
            return [] if row is None else self._choose(row)
        if event.type in (pygame.KEYDOWN, pygame.KEYUP):
            key = self._key(event)
            if event.type == pygame.KEYDOWN and key in (CHOOSE, CHANGE) and not self._runs():
                return self._choose_older() if key == CHOOSE else self._change()
            kind = KeyDown if event.type == pygame.KEYDOWN else KeyUp
            return [kind(key, self._frame)] if key else []
        return self._gamepad_meaning(event)

    def _key(self, event: Any) -> str:
        """Return the name of a key: on its way up the same as on its way down."""
        place = getattr(event, "scancode", event.key)
        if event.type == self._pygame.KEYUP and place in self._down:
            return self._down.pop(place)
        self._down[place] = key_name(self._pygame.key.name(event.key), place)
        return self._down[place]

    def _runs(self) -> bool:
        """Whether an episode runs, so that keys act."""
        return self.recorder.session.state in (COUNTDOWN, PLAYING)

    def _choose(self, row: int) -> list[Event]:
        """Mark an episode of the list as the one that can be changed."""
        if not self._runs():
            self._screen.chosen = row
        return []

    def _choose_older(self) -> list[Event]:
        """Mark the episode before the marked one; after the first comes the last again."""
        count = len(self.recorder.session.episodes)
        before = count if self._screen.chosen is None else self._screen.chosen
        return self._choose((before - 1) % count) if count else []

    def _change(self) -> list[Event]:
        """Discard the marked episode, or keep it again."""
        chosen, episodes = self._screen.chosen, self.recorder.session.episodes
        if chosen is None or chosen >= len(episodes):
            return []
        return [Command("drop" if episodes[chosen].kept else "keep", float(chosen))]

    def _gamepad_meaning(self, event: Any) -> list[Event]:
        pygame, meant = self._pygame, list[Event]()
        if event.type == pygame.JOYDEVICEADDED:
            joystick = pygame.joystick.Joystick(event.device_index)
            self._joysticks[joystick.get_instance_id()] = joystick
        elif event.type == pygame.JOYDEVICEREMOVED:
            self._joysticks.pop(event.instance_id, None)
            self._gamepad.release()
            meant = [Away("The gamepad was disconnected.")]
        elif event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
            meant = self._gamepad.button(event.button, down=event.type == pygame.JOYBUTTONDOWN)
        elif event.type == pygame.JOYAXISMOTION:
            meant = self._gamepad.axis("stick", event.axis, event.value)
        elif event.type == pygame.JOYHATMOTION:
            for axis in (0, 1):
                meant += self._gamepad.axis("hat", axis, event.value[axis])
        return [self._over_picture(event) for event in meant]

    def _over_picture(self, event: Event) -> Event:
        """Add which picture was on the screen when a key went down or up."""
        if isinstance(event, KeyDown | KeyUp):
            return type(event)(event.key, self._frame)
        return event


def key_name(name: str, place: int = 0) -> str:
    """Return our name of the key that pygame calls ``name``; empty if it has none.

    Where a layout types no Latin letters (Cyrillic, Greek), the key is named after its place.
    """
    key = _NAMES.get(name, name)
    if len(key) == 1 and not key.isascii():
        key = _PLACES.get(place, key)
    return key if len(key) == 1 or key in NAMED_KEYS else ""
