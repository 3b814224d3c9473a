"""The language of properties that ``verify`` answers.

Its grammar::

    property   = ("never" | "always") decision ["when" conditions]
               | "monotone" (ACTION | QUANTITY) "in" ["falling"] FEATURE ["when" conditions]
               | ["no"] "dead leaves"
    decision   = ACTION | QUANTITY COMPARISON NUMBER
    conditions = condition {"and" condition}
    condition  = [NUMBER COMPARISON] FEATURE COMPARISON NUMBER
               | ["not"] FLAG
               | CHOICE "is" ["not"] CATEGORY {"," CATEGORY}
    COMPARISON = "<" | "<=" | ">" | ">=" | "="

A QUANTITY is set by the actions, the valve of ``valve 25 %``. A CHOICE is a one-hot group or a
feature whose values have names. Names with signs such as ``<``, or such as ``when``, stand in
double quotes, as JSON strings.
"""

import itertools
import json
import math
import operator
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.features import formulas_of, parts_of
from eutree.inspection.regions import Region, before, is_box
from eutree.schema import Schema
from eutree.trees.text import printable

_TOKEN = re.compile(r'\s*("(?:[^"\\]|\\.)*"|<=|>=|<|>|=|[^\s<>=]+)')
_COMMA = re.compile(r',(?=(?:[^"\\]|\\.|"(?:[^"\\]|\\.)*")*$)')  # outside of quotes
_FLIPPED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "=": "="}
_HOLDS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "=": operator.eq
}  # fmt: skip
KINDS = ("never", "always", "monotone", "no dead leaves")


@dataclass(frozen=True)
class Property:
    """A question about a policy.

    Attributes:
        kind: ``"never"``, ``"always"``, ``"monotone"`` or ``"no dead leaves"``.
        regions: Where the conditions hold: boxes that do not meet, one unless categories are named
            that are no neighbours.
        actions: The actions in question; none for dead leaves.
        feature: The feature of monotonicity; else -1.
        falls: Whether the feature is lowered instead of raised.
        text: The property as it was given.
        control: The quantity of monotonicity; -1 where it is an action that must stay.
    """

    kind: str
    regions: tuple[Region, ...]
    actions: frozenset[int] = frozenset()
    feature: int = -1
    falls: bool = False
    text: str = ""
    control: int = -1

    def ranks(self, schema: Schema) -> Floats:
        """Return the rank of each action, which must not fall: its quantity, or 1 if kept, [A]."""
        if self.control >= 0:
            return np.array(schema.action_values, dtype=np.float64)[:, self.control]
        return np.isin(np.arange(schema.n_actions), list(self.actions)).astype(np.float64)


def parse(text: str, schema: Schema) -> Property:
    """Return the property that a text describes, in the names of a schema.

    Raises:
        InvalidArgumentError: The text is no property; says where.
        UnknownNameError: It names no feature or action of the schema; names the nearest.
    """
    return _PropertyParser(text, schema).property()


def conditions(text: str, schema: Schema) -> Region:
    """Return where conditions hold, such as ``-2 <= position <= 2 and speed < 1``.

    Raises:
        InvalidArgumentError: The text is none; says where.
        UnknownNameError: It names no feature of the schema; names the nearest.
    """
    regions = _PropertyParser(text, schema).everything()
    if len(regions) > 1:
        raise InvalidArgumentError(f"conditions {text!r} must name neighbouring categories")
    return regions[0]


class _PropertyParser:
    def __init__(self, text: str, schema: Schema) -> None:
        self.text, self.schema = text, schema
        self.tokens = _TOKEN.findall(text)
        self.at = 0
        self.low = np.full(schema.n_features, -np.inf)
        self.high = np.full(schema.n_features, np.inf)
        self.runs: dict[int, list[tuple[float, float]]] = {}  # of codes, by feature

    def property(self) -> Property:
        kind = self._next("a property")
        if kind == "no" or kind == "dead":
            for word in ("dead", "leaves")[kind == "dead" :]:
                self._expect(word)
            found = Property("no dead leaves", self._regions(), text=self.text)
            self._end()
            return found
        if kind not in KINDS:
            raise UnknownNameError("property", kind, KINDS)
        controls = tuple(control.name for control in self.schema.controls)
        name = self._name("action", self.schema.actions + controls)
        actions, feature, falls, control = frozenset({name}), -1, False, -1
        if name >= self.schema.n_actions:
            control = name - self.schema.n_actions
            actions = frozenset() if kind == "monotone" else self._levels(control)
        if kind == "monotone":
            self._expect("in")
            falls = self._peek() == "falling"
            self.at += falls
            feature = self._name("feature", self.schema.feature_names)
            if self.schema.features[feature].group or self.schema.features[feature].categories:
                self._fail("a feature that can be raised after 'in', got a category")
        if self._peek() == "when":
            self.at += 1
            self._conditions()
        self._end()
        control = control if kind == "monotone" else -1
        return Property(kind, self._regions(), actions, feature, falls, self.text, control)

    def everything(self) -> tuple[Region, ...]:
        """Return where the conditions hold of which the text consists."""
        self._conditions()
        self._end()
        return self._regions()

    def _levels(self, control: int) -> frozenset[int]:
        """Return the actions that set a quantity as the next words say: ``<= 25``."""
        holds = _HOLDS[self._comparison()]
        value = self._amount(self.schema.controls[control].unit)
        levels = [values[control] for values in self.schema.action_values]
        # Levels are shown with few digits: one that is as close as that is the value.
        gaps = [0.0 if math.isclose(level, value) else level - value for level in levels]
        found = frozenset(action for action, gap in enumerate(gaps) if holds(gap, 0.0))
        if not found or len(found) == len(levels):
            self._fail(f"some but not all of {sorted(set(levels))} in what it says of the quantity")
        return found

    def _conditions(self) -> None:
        self._condition()
        while self._peek() == "and":
            self.at += 1
            self._condition()

    def _condition(self) -> None:
        bounds: list[tuple[str, float]] = []
        number = finite(self._peek())
        if number is not None:
            self.at += 1
            bounds.append((_FLIPPED[self._comparison()], number))
        elif self._peek() == "not":
            self.at += 1
            return self._set_flag(self._name("feature", self.schema.feature_names), 0.0)
        groups = tuple(self.schema.groups)
        feature = self._name("feature", self.schema.feature_names + groups)
        if number is None and self._peek() == "is":
            return self._choose(feature)
        if number is None and self._peek() not in _FLIPPED:
            return self._set_flag(feature, 1.0)
        if feature >= self.schema.n_features:
            self._fail(f"'is' after {groups[feature - self.schema.n_features]!r}")
        if number is None or self._peek() in _FLIPPED:
            comparison = self._comparison()
            bounds.append((comparison, self._amount(self.schema.features[feature].unit)))
        for comparison, value in bounds:
            self._narrow(feature, comparison, value)
        return None

    def _set_flag(self, feature: int, value: float) -> None:
        if feature >= self.schema.n_features or not self.schema.features[feature].is_flag:
            self._comparison()  # which is missing
        self._narrow(feature, "=", value)

    def _choose(self, place: int) -> None:
        """Restrict a feature whose values have names, or a group, to some of its categories."""
        self._expect("is")
        is_not = self._peek() == "not"
        self.at += is_not
        features = self.schema.features
        if place >= len(features):
            name = list(self.schema.groups)[place - len(features)]
            members = self.schema.groups[name]
            known = tuple(features[member].category for member in members)
        else:
            name, members, known = features[place].name, (), features[place].categories
        if not known:
            self._fail(f"a comparison after {name!r}, whose values have no names")
        named = self._categories(known)
        left = [code for code, category in enumerate(known) if (category in named) != is_not]
        for code, member in enumerate(members):
            if code not in left:
                self._narrow(member, "=", 0.0)
        if not members:
            codes = features[place].low + np.array(left, dtype=np.float64)
            runs = np.split(codes, np.flatnonzero(np.diff(codes) > 1.0) + 1)
            these = [(float(run[0] - 1.0), float(run[-1])) for run in runs if run.size]
            others = self.runs.get(place, [(-np.inf, np.inf)])
            both = [(max(a, c), min(b, d)) for a, b in others for c, d in these]
            self.runs[place] = [(low, high) for low, high in both if low < high]

    def _categories(self, known: tuple[str, ...]) -> set[str]:
        """Return the categories that are named next, with commas between them."""
        start, named = self.at, set()
        while self._peek() not in ("", "and"):
            self.at += 1
        for text in _COMMA.split(" ".join(self.tokens[start : self.at])):
            word = (
                json.loads(text) if re.fullmatch(r'\s*"(?:[^"\\]|\\.)*"\s*', text) else text.strip()
            )
            if word not in known:
                raise UnknownNameError("category", word, known)
            named.add(word)
        return named

    def _narrow(self, feature: int, comparison: str, value: float) -> None:
        """Restrict the box: exclusive below, inclusive above, hence the neighbouring doubles."""
        smaller = float(before(np.array([value]))[0])
        if comparison in ("<", "<="):
            bound = smaller if comparison == "<" else value
            self.high[feature] = min(self.high[feature], bound)
        elif comparison in (">", ">="):
            bound = smaller if comparison == ">=" else value
            self.low[feature] = max(self.low[feature], bound)
        else:
            self._narrow(feature, "<=", value)
            self._narrow(feature, ">=", value)

    def _regions(self) -> tuple[Region, ...]:
        """Return the boxes in which all conditions hold."""
        found = []
        for sides in itertools.product(*self.runs.values()):
            low, high = self.low.copy(), self.high.copy()
            for feature, (first, last) in zip(self.runs, sides, strict=True):
                low[feature], high[feature] = max(low[feature], first), min(high[feature], last)
            if is_box(low, high):
                found.append(Region(low, high))
        if not found:
            self._fail("conditions that some observation meets")
        return tuple(found)

    def _comparison(self) -> str:
        token = self._next("a comparison")
        if token not in _FLIPPED:
            self._fail(f"one of {', '.join(_FLIPPED)}, got {token!r}")
        return token

    def _name(self, kind: str, names: tuple[str, ...]) -> int:
        token = self._next(f"a name of {kind}")
        for more in range(len(self.tokens) - self.at, 0, -1):  # the longest name with blanks
            words = " ".join([token, *self.tokens[self.at : self.at + more]])
            if words in names:
                self.at += more
                return names.index(words)
        if token.startswith('"'):
            try:
                token = json.loads(token)
            except ValueError:
                self._fail(f"a JSON string, got {token}")
        if token not in names:
            raise UnknownNameError(kind, token, names)
        return names.index(token)

    def _amount(self, unit: str) -> float:
        """Return the next number, and pass over its unit, which may follow."""
        token = self._next("a number")
        value = finite(token)
        if value is None:
            self._fail(f"a number, got {token!r}")
        words = unit.split()
        if self.tokens[self.at : self.at + len(words)] == words:
            self.at += len(words)
        return value

    def _peek(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def _next(self, what: str) -> str:
        if self.at == len(self.tokens):
            self._fail(f"{what} at its end")
        self.at += 1
        return str(self.tokens[self.at - 1])

    def _expect(self, word: str) -> None:
        token = self._next(repr(word))
        if token != word:
            self._fail(f"{word!r}, got {token!r}")

    def _end(self) -> None:
        if self.at < len(self.tokens):
            self._fail(f"its end, got {self.tokens[self.at]!r}")

    def _fail(self, wanted: str) -> NoReturn:
        raise InvalidArgumentError(f"property {self.text!r} must have {wanted}")


def finite(token: str) -> float | None:
    """Return the number that a word is; None where it is none, or not finite."""
    try:
        value = float(token)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def check_says_all(asked: Property, schema: Schema, tested: Iterable[int] | None = None) -> None:
    """Raise InvalidArgumentError for a monotone property of what derived features are made of.

    Nothing but the feature may change, and they change with it, where tests ask for these (any, if
    ``tested`` is None).
    """
    names, formulas = list(map(printable, schema.feature_names)), formulas_of(schema)
    for number in sorted(formulas if tested is None else tested):
        if asked.kind == "monotone" and asked.feature in parts_of({number}, formulas):
            raise InvalidArgumentError(
                f"{asked.text!r} must be about a feature alone: {names[number]}, which tests may "
                f"ask for, is made of {names[asked.feature]}"
            )
