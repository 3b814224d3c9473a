"""The language of properties that ``verify`` answers.

Its grammar::

    property   = ("never" | "always") ACTION ["when" conditions]
               | "monotone" ACTION "in" ["falling"] FEATURE ["when" conditions]
               | ["no"] "dead leaves"
    conditions = condition {"and" condition}
    condition  = [NUMBER COMPARISON] FEATURE COMPARISON NUMBER
    COMPARISON = "<" | "<=" | ">" | ">=" | "="

Names with signs such as ``<``, or such as ``when``, stand in double quotes, as JSON strings.
"""

import json
import re
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.inspection.regions import Region, before
from eutree.schema import Schema

_TOKEN = re.compile(r'\s*("(?:[^"\\]|\\.)*"|<=|>=|<|>|=|[^\s<>=]+)')
_FLIPPED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "=": "="}
KINDS = ("never", "always", "monotone", "no dead leaves")


@dataclass(frozen=True)
class Property:
    """A question about a policy.

    Attributes:
        kind: ``"never"``, ``"always"``, ``"monotone"`` or ``"no dead leaves"``.
        region: Where the conditions hold.
        action: The action in question; -1 for dead leaves.
        feature: The feature of monotonicity; else -1.
        falls: Whether the feature is lowered instead of raised.
        text: The property as it was given.
    """

    kind: str
    region: Region
    action: int = -1
    feature: int = -1
    falls: bool = False
    text: str = ""


def parse(text: str, schema: Schema) -> Property:
    """Return the property that a text describes, in the names of a schema.

    Raises:
        InvalidArgumentError: The text is no property; says where.
        UnknownNameError: It names no feature or action of the schema; names the nearest.
    """
    return _Parser(text, schema).property()


def conditions(text: str, schema: Schema) -> Region:
    """Return where conditions hold, such as ``-2 <= position <= 2 and speed < 1``.

    Raises:
        InvalidArgumentError: The text is none; says where.
        UnknownNameError: It names no feature of the schema; names the nearest.
    """
    return _Parser(text, schema).everything()


class _Parser:
    def __init__(self, text: str, schema: Schema) -> None:
        self.text, self.schema = text, schema
        self.tokens = _TOKEN.findall(text)
        self.at = 0
        self.low = np.full(schema.n_features, -np.inf)
        self.high = np.full(schema.n_features, np.inf)

    def property(self) -> Property:
        kind = self._next("a property")
        if kind == "no" or kind == "dead":
            for word in ("dead", "leaves")[kind == "dead" :]:
                self._expect(word)
            found = Property("no dead leaves", self._region(), text=self.text)
            self._end()
            return found
        if kind not in KINDS:
            raise UnknownNameError("property", kind, KINDS)
        action = self._name("action", self.schema.actions)
        feature, falls = -1, False
        if kind == "monotone":
            self._expect("in")
            falls = self._peek() == "falling"
            self.at += falls
            feature = self._name("feature", self.schema.feature_names)
        if self._peek() == "when":
            self.at += 1
            self._conditions()
        self._end()
        return Property(kind, self._region(), action, feature, falls, self.text)

    def everything(self) -> Region:
        """Return where the conditions hold of which the text consists."""
        self._conditions()
        self._end()
        return self._region()

    def _conditions(self) -> None:
        self._condition()
        while self._peek() == "and":
            self.at += 1
            self._condition()

    def _condition(self) -> None:
        bounds: list[tuple[str, float]] = []
        number = _number(self._peek())
        if number is not None:
            self.at += 1
            bounds.append((_FLIPPED[self._comparison()], number))
        feature = self._name("feature", self.schema.feature_names)
        if number is None or self._peek() in _FLIPPED:
            comparison = self._comparison()
            token = self._next("a number")
            right = _number(token)
            if right is None:
                self._fail(f"a number, got {token!r}")
            bounds.append((comparison, right))
        for comparison, value in bounds:
            self._narrow(feature, comparison, value)

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

    def _region(self) -> Region:
        if not (self.low < self.high).all():
            self._fail("conditions that some observation meets")
        return Region(_copy(self.low), _copy(self.high))

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


def _number(token: str) -> float | None:
    try:
        value = float(token)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def _copy(values: Floats) -> Floats:
    return np.array(values)
