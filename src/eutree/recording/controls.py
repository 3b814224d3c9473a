"""What a person acts with: the keys under their hands, and how fast and in which mode they act."""

from typing import Any

from eutree.errors import InvalidArgumentError
from eutree.recording.events import Command
from eutree.recording.keys import START_KEYS, KeyMap
from eutree.recording.pace import SPEEDS, Pace


class Hands:
    """The keys held at present, in the three modes: hold, toggle, turn-based.

    Args:
        keys: What the keys mean.

    Attributes:
        keys: What the keys mean.
        held: Keys that are down, in the order in which they went down.
        action: The last action taken.
        toggle: Whether a key switches its action on and off.
        turn: The keys of a turn that waits to be taken; None if none does.
    """

    def __init__(self, keys: KeyMap) -> None:
        self.keys = keys
        self.held: dict[str, None] = {}
        self.toggle = False
        self.turn: list[str] | None = None
        self._switched: int | None = None  # the action that is on, in the toggle mode
        self.action = self._idle()

    def start(self) -> None:
        """Begin an episode: nothing is switched on, and the idle action was the last one."""
        self.action, self._switched, self.turn = self._idle(), None, None

    def press(self, key: str) -> None:
        """Take note of an action key, for the mode in which holding it is not what counts."""
        if self.toggle:
            action = self.keys.action([key], self.action)
            self._switched = None if self._switched == action else action

    def release(self) -> None:
        """Let go of everything."""
        self.held.clear()
        self._switched = None

    def set_toggle(self, value: bool) -> None:
        """Choose whether keys switch their actions on and off."""
        self.toggle, self._switched = value, None

    def facts(self) -> dict[str, Any]:
        """Return what is stored with an episode: the keys that act, and whether they switch."""
        return {"keys": list(self.keys.keys), "toggle": self.toggle}

    @property
    def is_active(self) -> bool:
        """Whether an action key is held, or switched on."""
        if self.toggle:
            return self._switched is not None
        return any(key in self.keys.keys for key in self.held)

    def chosen(self, *, turn_based: bool) -> int:
        """Return the action that the hands mean, of the waiting turn if there is one."""
        if self.toggle and not turn_based:
            idle = self.action if self.keys.idle is None else self.keys.idle
            return idle if self._switched is None else self._switched
        held = list(self.held) if self.turn is None else self.turn
        return self.keys.action(held, self.action)

    def _idle(self) -> int:
        return self.keys.idle or 0


class Controls:
    """Hands and pace, and the commands that set them.

    Args:
        keys: What the keys mean.
        pace: When steps are due.

    Attributes:
        hands: The keys held.
        pace: When steps are due.
    """

    def __init__(self, keys: KeyMap, pace: Pace) -> None:
        self.hands = Hands(keys)
        self.pace = pace

    @property
    def keys(self) -> KeyMap:
        """What the keys mean."""
        return self.hands.keys

    def chosen(self) -> int:
        """Return the action that the hands mean."""
        return self.hands.chosen(turn_based=self.pace.turn_based)

    def command(self, key: str, *, playing: bool) -> Command | None:
        """Return the command that a key means, while an episode is played or between two."""
        name = "start" if not playing and key in START_KEYS else self.keys.command(key)
        return None if name is None else Command(name)

    def facts(self) -> dict[str, Any]:
        """Return what is stored with an episode."""
        return {**self.hands.facts(), **self.pace.facts()}

    def set_speed(self, command: Command, now: float) -> None:
        """Obey ``slower``, ``faster`` or ``speed``."""
        if command.name != "speed":
            self.pace.shift_speed(now, 1 if command.name == "faster" else -1)
        elif isinstance(command.value, int | float) and command.value in SPEEDS:
            self.pace.set_speed(now, float(command.value))

    def set_mode(self, command: Command) -> None:
        """Obey ``toggle`` or ``turn_based``; ``mode`` goes on: hold, toggle, turn-based."""
        if command.name == "mode":
            toggle = self.hands.toggle
            self.hands.set_toggle(not toggle and not self.pace.turn_based)
            self._set_turn_based(toggle)
        elif command.name == "toggle":
            self.hands.set_toggle(bool(command.value))
        else:
            self._set_turn_based(bool(command.value))

    def bind(self, key: str, action: int) -> str:
        """Let a key mean an action from now on; return why it cannot, or ""."""
        try:
            self.hands.keys = self.keys.with_key(key, action)
        except InvalidArgumentError as error:
            return str(error)
        return ""

    def _set_turn_based(self, value: bool) -> None:
        self.pace.turn_based = value
        self.pace.finish()
        self.hands.turn = None
