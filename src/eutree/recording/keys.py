"""Keys by their names, the actions they mean, and the keys that control a recording.

A key's name is that of the page: ``"space"``, ``"left"``, ``"a"``.
The action of the keys held is a pure function of their names, in the order they went down in.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.schema import Schema
from eutree.validation import check_integer

# Codes of pygame 2 and, where Gymnasium still has them, of pygame 1.
_NAMES_OF_CODES = {
    9: "tab",
    13: "enter",
    27: "escape",
    32: "space",
    127: "delete",
    8: "backspace",
    **dict(enumerate(("up", "down", "right", "left"), 273)),
    **dict(enumerate(("right", "left", "down", "up"), 1073741903)),
}
NAMED_KEYS = (*sorted(set(_NAMES_OF_CODES.values())), *(f"f{n}" for n in range(1, 13)))
_IDLE_NAMES = ("stop", "none", "nothing", "noop", "no-op", "coast", "stay", "wait", "idle")
_ARROWS = {
    **dict.fromkeys(("left", "west"), "left"),
    **dict.fromkeys(("right", "east"), "right"),
    **dict.fromkeys(("up", "north", "forward", "forwards", "main", "gas"), "up"),
    **dict.fromkeys(("down", "south", "backward", "backwards", "back", "brake"), "down"),
}
# Words that belong to the verb before them, unless that is one of motion: pick up, shut down.
_PARTICLES = ("up", "down", "back", "forward")
_MOTIONS = ("accelerate", "climb", "drive", "fly", "go", "head", "jump", "look", "move", "pull",
            "push", "roll", "run", "slide", "step", "steer", "swim", "tilt", "turn",
            "walk")  # fmt: skip
_BESIDE_ARROWS = ("space", "enter")  # for acts at the place where one has moved to
_NO_KEY = "none"

# The first key of each row that is no action key is the one that counts.
CONTROL_KEYS = {
    "pause": ("p", "f8"),
    "end": ("e", "f2"),  # no arrow key: a reflex must not end an episode
    "redo": ("r", "f3"),
    "discard": ("delete", "x", "f4"),
    "finish": ("escape", "f10"),
    "slower": ("-", "f6"),
    "faster": ("+", "f7"),
    "mode": ("m", "f9"),
    "wait": ("down", ".", "enter"),  # turn-based mode: one step without an action key
}
START_KEYS = ("enter", "space")


@dataclass(frozen=True)
class KeyMap:
    """Which action the held keys mean.

    Attributes:
        combinations: Sets of keys and the action of each.
        idle: Action while no key of the map is held; None keeps the last action.
        chosen: Whether a person or the environment chose the keys (else they are a suggestion).
    """

    combinations: tuple[tuple[frozenset[str], int], ...]
    idle: int | None = None
    chosen: bool = True

    @property
    def keys(self) -> tuple[str, ...]:
        """All keys that mean something, sorted."""
        return tuple(sorted({key for keys, _ in self.combinations for key in keys}))

    def action(self, held: Sequence[str], last: int) -> int:
        """Return the action of the keys ``held``, given in the order in which they went down.

        The largest combination that is held counts; among equals the one pressed last.
        """
        places = {key: place for place, key in enumerate(held)}
        matches = [
            (len(keys), max(places[key] for key in keys), action)
            for keys, action in self.combinations
            if keys <= places.keys()
        ]
        if matches:
            return max(matches)[2]
        return last if self.idle is None else self.idle

    def keys_of(self, action: int) -> list[str]:
        """Return the keys of an action as texts: ``["space", "left+up"]``."""
        own = [keys for keys, meaning in self.combinations if meaning == action]
        smallest = [keys for keys in own if not any(other < keys for other in own)]
        return sorted("+".join(sorted(keys)) for keys in smallest)

    def with_key(self, key: str, action: int) -> "KeyMap":
        """Return the map in which ``key`` alone means ``action``, and no other key does.

        An action that would be left without a key has the one that ``action`` had.
        """
        new, own = frozenset([check_key(key)]), self.keys_of(action)
        others = [one for one in self.combinations if one[1] != action and not new & one[0]]
        lost = {meaning for _, meaning in self.combinations} - {action, *(a for _, a in others)}
        if len(lost) == len(own) == 1 and own[0] in self.keys:
            others.append((frozenset(own), lost.pop()))
        idle = None if self.idle == action else self.idle
        return KeyMap((*others, (new, action)), idle)

    def controls(self) -> dict[str, str]:
        """Return the key of each control command, none of them an action key."""
        taken = set(self.keys)
        found: dict[str, str] = {}
        for command, names in CONTROL_KEYS.items():
            free = [key for key in names if key not in taken]
            if free:
                found[command] = free[0]
                taken.add(free[0])
        return found

    def command(self, key: str) -> str | None:
        """Return the control command of a key, or None."""
        return next((name for name, own in self.controls().items() if own == key), None)


def check_key(name: str) -> str:
    """Return the name of a key, in lower case, or raise UnknownNameError."""
    key = {" ": "space", "=": "+"}.get(name, name.lower())
    if (len(key) == 1 and key.isprintable()) or key in NAMED_KEYS:
        return key
    raise UnknownNameError("key", name, NAMED_KEYS)


def parse_keys(text: str, schema: Schema) -> KeyMap:
    """Return the map that ``left=0,right=go,left+up=2,none=1`` describes; names may have commas.

    Raises:
        InvalidArgumentError: An entry is not KEY=ACTION, or names an unknown key or action.
    """
    combinations: dict[frozenset[str], int] = {}
    idle: int | None = None
    parts, most = text.split(","), 1 + max(name.count(",") for name in schema.actions)
    while parts:
        entry = parts[0]
        keys, equals, first = (part.strip() for part in entry.rpartition("="))
        for count in range(min(most, len(parts)), 0, -1):  # the longest name counts
            action = ",".join([first, *parts[1:count]]).rstrip()
            if action in schema.actions:
                break
        del parts[:count]
        if not equals or not keys or not action:
            raise InvalidArgumentError(
                f"keys must be KEY=ACTION pairs such as left=0,right=1, got {entry!r}"
            )
        number = _action(action, schema)
        if keys.lower() == _NO_KEY:
            idle = number
        else:
            names = keys.split("+") if len(keys) > 1 else [keys]
            held = frozenset(check_key(key) for key in names)
            if combinations.setdefault(held, number) != number:
                raise InvalidArgumentError(f"keys must give a key one action, got {text!r}")
    if not combinations:
        raise InvalidArgumentError(f"keys must give at least one action a key, got {text!r}")
    return _with_idle(combinations, idle, schema, chosen=True)


def keys_of_environment(env: gymnasium.Env[Any, Any], schema: Schema) -> KeyMap:
    """Return the environment's own ``get_keys_to_action()``, else a suggestion."""
    own = getattr(env.unwrapped, "get_keys_to_action", None)
    combinations: dict[frozenset[str], int] = {}
    idle: int | None = None
    for codes, action in (own() if callable(own) else {}).items():
        names = [_name(code) for code in (codes if isinstance(codes, tuple) else (codes,))]
        number = check_integer("an action of get_keys_to_action()", action)
        if number >= schema.n_actions or None in names:
            continue
        if names:
            combinations[frozenset(str(name) for name in names)] = number
        else:
            idle = number
    if combinations:
        return _with_idle(combinations, idle, schema, chosen=True)
    return suggested_keys(schema)


def suggested_keys(schema: Schema) -> KeyMap:
    """Return keys that suit the names of the actions.

    Arrows where a name says a direction, then Space and Enter for other acts; digits where no name
    says one.
    """
    idle = _idle_by_name(schema)
    arrows = [
        None if action == idle else _arrow(name) for action, name in enumerate(schema.actions)
    ]
    others = list(_BESIDE_ARROWS) if any(arrows) else []
    combinations: dict[frozenset[str], int] = {}
    for action, arrow in enumerate(arrows):
        if action == idle:
            continue
        digit = str(action + 1) if action < 9 else chr(ord("a") + action - 9)
        key = arrow or (others.pop(0) if others else digit)
        if frozenset([key]) in combinations:
            key = digit
        combinations[frozenset([key])] = action
    return KeyMap(tuple(combinations.items()), idle, chosen=False)


def _arrow(name: str) -> str | None:
    """Return the arrow key of the direction that an action's name says, if it says one."""
    words = re.findall("[a-z]+", name.lower())
    said = [
        _ARROWS[word]
        for place, word in enumerate(words)
        if word in _ARROWS
        and not (word in _PARTICLES and place and words[place - 1] not in _MOTIONS)
    ]
    sideways = [arrow for arrow in said if arrow in ("left", "right")]
    return next(iter(sideways or said), None)


def _with_idle(
    combinations: Mapping[frozenset[str], int], idle: int | None, schema: Schema, *, chosen: bool
) -> KeyMap:
    """Return the map; idle is the action of that name, else the only one that no key means."""
    if idle is None:
        free = [a for a in range(schema.n_actions) if a not in combinations.values()]
        by_name = _idle_by_name(schema)
        idle = free[0] if by_name is None and len(free) == 1 else by_name
    return KeyMap(tuple(combinations.items()), idle, chosen)


def _idle_by_name(schema: Schema) -> int | None:
    names = [name.lower() for name in schema.actions]
    return next((i for i, name in enumerate(names) if name in _IDLE_NAMES), None)


def _action(text: str, schema: Schema) -> int:
    if text in schema.actions:
        return schema.actions.index(text)
    if re.fullmatch("[0-9]{1,9}", text) and int(text) < schema.n_actions:
        return int(text)
    known = [*schema.actions, *map(str, range(schema.n_actions))]
    raise UnknownNameError("action", text, known)


def _name(code: object) -> str | None:
    """Return the name of a key given as a character, a name or a code of pygame."""
    if isinstance(code, str):
        return check_key(code)
    number = check_integer("a key of get_keys_to_action()", code)
    if number in _NAMES_OF_CODES:
        return _NAMES_OF_CODES[number]
    return chr(number).lower() if 33 <= number < 127 else None  # the printable characters
