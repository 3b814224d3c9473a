"""What a person acts with: the keys under their hands, and how fast and in which mode they act."""

from typing import Any

from eutree.errors import InvalidArgumentError
from eutree.interaction.events import Command
from eutree.interaction.hands import Hands
from eutree.interaction.keys import START_KEYS, KeyMap
from eutree.interaction.pace import SPEEDS, Pace


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
