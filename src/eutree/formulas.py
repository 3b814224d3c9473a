"""Formulas of derived features: ``time_to_crossing = distance / speed``.

A formula is a number of one step, made of the features that stand before it::

    formula   = sum ["if" condition "else" formula]
    sum       = product {("+" | "-") product}
    product   = factor {("*" | "/") factor}
    factor    = "-" factor | NUMBER | FEATURE | "(" formula ")" | "abs" "(" formula ")"
              | ("min" | "max") "(" formula {"," formula} ")" | "last" "(" FEATURE ")"
    condition = test {("and" | "or") test}            ("and" binds more closely)
    test      = sum ("<" | "<=" | ">" | ">=") sum

Names with other signs than letters, digits, ``_`` and ``.`` stand in double quotes, as JSON
strings. The parser is our own: Python's compiles, which nothing read from a file may.

The meaning is exact, so that exported code computes the same doubles. Each operation is that of
IEEE 754; ``last`` is the value at the step before, and at an episode's first step the value itself;
``min(a, b)`` is b if b < a, else a; a quotient is kept within ``LARGEST_RATIO`` of 0, ``x / 0`` is
that bound with the sign of x, and ``0 / 0`` is 0.
"""

import itertools
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, NoReturn

import numpy as np

from eutree.errors import InvalidArgumentError, UnknownNameError, shown

LARGEST_RATIO = 1e9
MAX_FORMULA = 2_000  # characters
_MAX_TOKENS = 300  # names, numbers and signs
_MAX_NESTING = 30
_TOKEN = re.compile(
    r'\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<name>[^\W\d][\w.]*|"(?:[^"\\]|\\.)*")'
    r"|(?P<sign><=|>=|[-+*/(),<>])|(?P<wrong>\S))"
)
_WORDS = frozenset({"min", "max", "abs", "last", "if", "else", "and", "or"})
_RANKS, _ALONE = {"+": 1, "-": 1, "*": 2, "/": 2}, 4  # what binds more closely
_TESTS: Mapping[str, Callable[[Any, Any], Any]] = {
    "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal,
    "and": np.logical_and, "or": np.logical_or,
}  # fmt: skip


@dataclass(frozen=True)
class Formula:
    """A number, a feature, or an operation with formulas as its parts.

    Attributes:
        kind: ``"number"``, ``"feature"``, ``"last"``, ``"negative"``, or the operation's own sign
            or word; ``"if"`` has the condition, the formula if it holds, and the other one.
        parts: Operands of the operation.
        value: The number.
        index: Which feature it is, or is the last value of.
    """

    kind: str
    parts: "tuple[Formula, ...]" = ()
    value: float = 0.0
    index: int = -1

    def __iter__(self) -> "Iterator[Formula]":
        """Yield the formula and all its parts."""
        yield self
        for part in self.parts:
            yield from part

    def compute(
        self,
        now: Sequence[Any],
        last: Callable[[int], Any],
        operations: "Mapping[str, Callable[..., Any]] | None" = None,
    ) -> Any:
        """Return the formula's values, or what it is in words.

        Args:
            now: The features before it, each of shape [...], or what stands for such numbers.
            last: Gives the same of a feature, one step before.
            operations: How to do each operation on these, and what a ``"number"`` is among them;
                by default as on arrays.
        """
        operations = operations or _OPERATIONS
        if self.kind == "number":
            return operations["number"](self.value)
        if self.kind == "feature":
            return now[self.index]
        if self.kind == "last":
            return last(self.index)
        with np.errstate(all="ignore"):
            parts = [part.compute(now, last, operations) for part in self.parts]
            return operations[self.kind](*parts)

    @property
    def remembers(self) -> bool:
        """Whether it asks for a value of one step before."""
        return any(part.kind == "last" for part in self)

    def ago(self, steps: int, size: int, known: int) -> "Formula":
        """Return it of the features some steps ago, which stand ``size`` numbers a step behind.

        A ``last`` is one of those, too, but for that of the earliest of ``known`` steps.
        """
        if self.kind not in {"feature", "last"}:
            return replace(self, parts=tuple(part.ago(steps, size, known) for part in self.parts))
        steps += self.kind == "last"
        return Formula("feature", index=self.index + steps * size) if steps < known else self

    def unit(self, units: Sequence[str]) -> str:
        """Return the unit that follows from those of the features; empty where none does."""
        return _in_words(self._powers(units) or {})

    def _powers(self, units: Sequence[str]) -> "dict[str, int] | None":
        """Return the power of each unit in it; None for a mere number, which fits any."""
        if self.kind == "number":
            return None
        if not self.parts:
            return _powers_of(units[self.index])
        parts = self.parts[1:] if self.kind == "if" else self.parts
        found = [part._powers(units) for part in parts]
        if self.kind in "*/":
            sign = 1 if self.kind == "*" else -1
            powers = dict(found[0] or {})
            for symbol, power in (found[1] or {}).items():
                powers[symbol] = powers.get(symbol, 0) + sign * power
            return {symbol: power for symbol, power in powers.items() if power}
        known = [powers for powers in found if powers is not None]
        return known[0] if known and all(powers == known[0] for powers in known) else {}


def _ratio(a: Any, b: Any) -> Any:
    bound = np.where(a > 0.0, LARGEST_RATIO, np.where(a < 0.0, -LARGEST_RATIO, a))
    quotient = np.divide(a, b)
    quotient = np.where(quotient > LARGEST_RATIO, LARGEST_RATIO, quotient)
    quotient = np.where(quotient < -LARGEST_RATIO, -LARGEST_RATIO, quotient)
    return np.where(b == 0.0, bound, quotient)


_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    **_TESTS,
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": _ratio, "negative": np.negative,
    "min": lambda a, b: np.where(b < a, b, a), "max": lambda a, b: np.where(b > a, b, a),
    "abs": lambda a: np.where(a < 0.0, -a, a), "if": np.where, "number": np.float64,
}  # fmt: skip
_LEAST = 5e-324  # the smallest double above 0


def _on_ranges(kind: str, operation: Callable[..., Any]) -> Callable[..., Any]:
    """Return an operation on ranges: a least and a greatest value, and whether it may be NaN.

    On either side of 0 each operation, rounded or not, rises or falls with each of its operands.
    So its ends are among its results at theirs, and around 0 for those that turn or jump there.
    """

    def compute(*parts: Any) -> Any:
        around = {"/": (-_LEAST, 0.0, _LEAST), "abs": (-_LEAST, 0.0, _LEAST), "*": (0.0,)}
        at = around.get(kind, ())  # 0 times infinity is NaN
        ends = [(*part[:2], *(np.clip(x, *part[:2]) for x in at)) for part in parts]
        results = itertools.starmap(operation, itertools.product(*ends))
        found = np.stack(np.broadcast_arrays(*results))
        may_be_nan = np.any(np.broadcast_arrays(*(part[2] for part in parts)), axis=0)
        if found.dtype == bool:  # no comparison holds of NaN
            return found.all(axis=0) & ~may_be_nan, found.any(axis=0), False
        # Of a NaN the least and the greatest operation make the other number, or NaN.
        unknown = np.isnan(found).any(axis=0) | (may_be_nan & (kind in {"min", "max"}))
        return (
            np.where(unknown, -np.inf, found.min(axis=0)),
            np.where(unknown, np.inf, found.max(axis=0)),
            unknown | may_be_nan,
        )

    return compute


def _without_nan(compute: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *parts: compute(*((*part, False) for part in parts))[:2]


# For ``compute``, with ranges [...] in place of numbers: the doubles that it gives for any numbers
# within, and whether it may give NaN. They are exact where a formula names each feature once, else
# they may be wider.
ON_RANGES_OR_NAN: Mapping[str, Callable[..., Any]] = {
    **{kind: _on_ranges(kind, operation) for kind, operation in _OPERATIONS.items()},
    "number": lambda value: (np.float64(value), np.float64(value), False),
}
# The same without a word of NaN: a range that is not known is that of all numbers.
ON_RANGES: Mapping[str, Callable[..., Any]] = {
    **{kind: _without_nan(compute) for kind, compute in ON_RANGES_OR_NAN.items()},
    "number": lambda value: (np.float64(value),) * 2,
}


def declared(text: str) -> tuple[str, str]:
    """Return the label and the formula of a declaration, ``"gap [m] = b - a"``.

    Raises:
        InvalidArgumentError: It is none.
    """
    label, equals, formula = text.partition("=")
    if not equals or not label.strip() or not formula.strip() or label.rstrip()[-1] in "<>":
        raise InvalidArgumentError(
            f"a derived feature must be declared as NAME = FORMULA, got {shown(text)}"
        )
    return label.strip(), formula.strip()


def parse(text: str, names: Sequence[str]) -> Formula:
    """Return the formula that a text describes, of features with these names.

    Raises:
        InvalidArgumentError: The text is no formula; says where.
        UnknownNameError: It names no feature; names the nearest.
    """
    if len(text) > MAX_FORMULA:
        raise InvalidArgumentError(
            f"a formula must have at most {MAX_FORMULA:,} characters, got {len(text):,}"
        )
    return _FormulaParser(text, names).whole()


def in_formula(name: str) -> str:
    """Return a feature's name as it stands in a formula."""
    plain = re.fullmatch(r"[^\W\d][\w.]*", name) and name not in _WORDS
    return name if plain else json.dumps(name, ensure_ascii=False)


def renamed(text: str, names: Sequence[str], others: Sequence[str]) -> str:
    """Return a formula with other names for the features, written as they stand here.

    It has the brackets that it needs: what it is made of is parsed again as it was.
    """
    now = [(other, _ALONE) for other in others]
    found: tuple[str, int] = parse(text, names).compute(
        now, lambda j: (f"last({others[j]})", _ALONE), _IN_WORDS
    )
    return found[0]


def _within(part: tuple[str, int], least: int) -> str:
    """Return a part as it stands in another one, which needs what binds at least so closely."""
    return f"({part[0]})" if part[1] < least else part[0]


def _joined(kind: str, rank: int, *ranks: int) -> Callable[..., tuple[str, int]]:
    return lambda *parts: (f" {kind} ".join(map(_within, parts, ranks)), rank)


def _called(kind: str) -> Callable[..., tuple[str, int]]:
    return lambda *parts: (f"{kind}({', '.join(text for text, _ in parts)})", _ALONE)


# For ``compute``: the text of each part, and how closely it binds.
_IN_WORDS: Mapping[str, Callable[..., tuple[str, int]]] = {
    **{kind: _joined(kind, _ALONE, 1, 1) for kind in _TESTS},
    **{kind: _joined(kind, rank, rank, rank + 1) for kind, rank in _RANKS.items()},
    **{kind: _called(kind) for kind in ("min", "max", "abs")},
    "number": lambda at: (f"{at:g}" if float(f"{at:g}") == at else repr(at), _ALONE),
    "negative": lambda part: (f"-{_within(part, 3)}", 3),
    "if": lambda test, yes, no: (f"{_within(yes, 1)} if {test[0]} else {no[0]}", 0),
}


class _FormulaParser:
    def __init__(self, text: str, names: Sequence[str]) -> None:
        self.text, self.names = text, names
        self.tokens = [(str(match.lastgroup), match[match.lastgroup or 0])
                       for match in _TOKEN.finditer(text)]  # fmt: skip
        self.at = self.depth = 0

    def whole(self) -> Formula:
        if len(self.tokens) > _MAX_TOKENS:
            self._fail(f"at most {_MAX_TOKENS} names, numbers and signs")
        found = self.formula()
        if self.at < len(self.tokens):
            self._fail("its end")
        return found

    def formula(self) -> Formula:
        self.descend()
        found = self.sum()
        if self.taken("if"):
            condition = self.chain(("or",), lambda: self.chain(("and",), self.test))
            self.expect("else")
            found = Formula("if", (condition, found, self.formula()))
        self.depth -= 1
        return found

    def descend(self) -> None:
        self.depth += 1
        if self.depth > _MAX_NESTING:
            self._fail(f"at most {_MAX_NESTING} formulas inside one another")

    def sum(self) -> Formula:
        return self.chain("+-", lambda: self.chain("*/", self.factor))

    def chain(self, signs: Sequence[str], part: Callable[[], Formula]) -> Formula:
        found = part()
        while self.peek() in set(signs):
            found = Formula(self.next(), (found, part()))
        return found

    def test(self) -> Formula:
        left = self.sum()
        if self.peek() not in {"<", "<=", ">", ">="}:
            self._fail("a comparison")
        return Formula(self.next(), (left, self.sum()))

    def factor(self) -> Formula:
        kind, word = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        if kind == "number":
            self.at += 1
            if not math.isfinite(float(word)):
                self._fail("finite numbers")
            return Formula("number", value=float(word))
        if self.taken("-"):
            self.descend()
            found = Formula("negative", (self.factor(),))
            self.depth -= 1
            return found
        if self.taken("("):
            parts = [self.formula()]
        elif word in {"min", "max", "abs"}:
            self.at += 1
            self.expect("(")
            parts = [self.formula()]
            while word != "abs" and self.taken(","):
                parts.append(self.formula())
        elif word == "last":
            self.at += 1
            self.expect("(")
            parts = [Formula("last", index=self.feature())]
        else:
            return Formula("feature", index=self.feature())
        self.expect(")")
        if word == "abs":
            return Formula("abs", (parts[0],))
        return reduce(lambda found, part: Formula(word, (found, part)), parts)

    def feature(self) -> int:
        kind, word = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        if kind != "name" or word in _WORDS:
            self._fail("a number or a feature")
        self.at += 1
        if word.startswith('"'):
            try:
                word = json.loads(word)
            except ValueError:
                self._fail("a JSON string")
        if word not in self.names:
            raise UnknownNameError("feature", word, self.names, hint=f"In {shown(self.text)}.")
        return self.names.index(word)

    def peek(self) -> str:
        return self.tokens[self.at][1] if self.at < len(self.tokens) else ""

    def next(self) -> str:
        self.at += 1
        return self.tokens[self.at - 1][1]

    def taken(self, word: str) -> bool:
        found = self.peek() == word
        self.at += found
        return found

    def expect(self, word: str) -> None:
        if not self.taken(word):
            self._fail(f"{word!r}")

    def _fail(self, wanted: str) -> NoReturn:
        place = f"got {self.peek()!r}" if self.peek() else "got its end"
        raise InvalidArgumentError(f"formula {shown(self.text)} must have {wanted}, {place}")


_UNIT = re.compile(r"([*·/]?)\s*([^\d\s*·/^²³]+)(\^?-?\d{1,2}(?!\d)|²|³)?")
_POWERS = {2: "²", 3: "³"}


def _powers_of(unit: str) -> dict[str, int]:
    """Return the power of each symbol of a unit: m/s² is {"m": 1, "s": -2}."""
    found: dict[str, int] = {}
    for sign, symbol, power in _UNIT.findall(unit):
        exponent = {"": 1, "²": 2, "³": 3}.get(power) or int(power.lstrip("^"))
        found[symbol] = found.get(symbol, 0) + (-exponent if sign == "/" else exponent)
    return found


def _in_words(powers: Mapping[str, int]) -> str:
    """Return a unit: m/s² of {"m": 1, "s": -2}."""

    def product(sign: int) -> list[str]:
        return [
            symbol + ("" if sign * power == 1 else _POWERS.get(sign * power, f"^{sign * power}"))
            for symbol, power in powers.items()
            if sign * power > 0
        ]

    above, below = "·".join(product(1)), "/".join(product(-1))
    return f"{above or 1}/{below}" if below else above
