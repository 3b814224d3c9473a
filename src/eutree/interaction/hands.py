"""What a person's hands do: the keys held, and the action that they mean."""

from typing import Any

from eutree.interaction.keys import KeyMap


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
