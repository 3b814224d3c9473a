"""Trees in words: names made printable, one test as a condition, a whole tree as nested rules.

A name that could be misread, because it holds a quote, a bracket of a comment, a line break or an
invisible character, is written as a JSON string; every other name is written as it is. So each
text can be read back, and no name can end the comment or the line that it stands in.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from eutree.display import SAME, told_apart, usual_width
from eutree.features import Derivation, formulas_of
from eutree.formulas import renamed
from eutree.schema import Feature, Schema
from eutree.trees.tree import DecisionTree


class Digits:
    """The digits of the numbers of each feature.

    Shown are the thresholds of trees, and further values, by the number of their feature.
    """

    def __init__(
        self, schema: Schema, *trees: DecisionTree, others: Iterable[tuple[int, float]] = ()
    ) -> None:
        shown: list[set[float]] = [set() for _ in schema.features]
        pairs: list[tuple[int, float]] = []
        for tree in trees:
            inner = np.flatnonzero(tree.feature != tree.NO_FEATURE)
            pairs += zip(tree.feature[inner].tolist(), tree.threshold[inner].tolist(), strict=True)
        for feature, value in (*pairs, *others):
            shown[feature].add(value)
        self.widths = [
            usual_width(feature.low, feature.high, values)
            for feature, values in zip(schema.features, shown, strict=True)
        ]
        self._texts = [
            told_apart(values, width, down=True)
            for values, width in zip(shown, self.widths, strict=True)
        ]

    def text(self, feature: int, value: float) -> str:
        """Return a value of a feature."""
        known, width = self._texts[feature].get(value), self.widths[feature]
        return told_apart([value], width, down=True)[value] if known is None else known

    def at_most(self, feature: int, threshold: float) -> str:
        """Return a test: ``"<= 8.25"``, or ``"< 24"`` for a threshold hardly below 24.

        So the number that is shown is itself decided as it says.
        """
        text = self.text(feature, threshold)
        return f"{'<' if float(text) > threshold else '<='} {text}"

    def above(self, feature: int, threshold: float) -> str:
        """Return the opposite test."""
        text = self.text(feature, threshold)
        return f"{'>=' if float(text) > threshold else '>'} {text}"

    def are_one(self, feature: int, one: float, other: float) -> bool:
        """Return whether two values are nearer than a millionth of the feature's range."""
        return one == other or abs(one - other) <= SAME * self.widths[feature]


# Fine in every kind of text: letters, digits, single blanks, and signs that end nothing.
_PLAIN = re.compile(
    r"(?![ *])(?:[^\W_]|[-_ .,+%°²³µ·')\[\]|~!@;]|/(?![/*])|\*(?![/)])|\((?!\*))+(?<![ *])"
)
# Pairs of signs that mean something in a comment of some language, and the JSON escape itself.
_RISKY = re.compile(r"[*/?<>&$]")


def printable(name: str) -> str:
    """Return ``name`` on one line: as it is where that is safe, else as a JSON string."""
    safe = name.isprintable() and _PLAIN.fullmatch(name) and "--" not in name
    return name if safe else quoted(name)


def quoted(name: str) -> str:
    r"""Return ``name`` as a JSON string of visible characters.

    Signs that could open or close a comment, a tag or a trigraph are written ``\u002a``.
    """
    text = json.dumps(name, ensure_ascii=False)
    text = _RISKY.sub(lambda match: f"\\u{ord(match[0]):04x}", text).replace("--", "-\\u002d")
    return "".join(
        sign if sign.isprintable() else json.dumps(sign, ensure_ascii=True)[1:-1] for sign in text
    )


class AskedTest(NamedTuple):
    """A test of a tree as its words have it."""

    number: int  # which feature is tested
    # The feature, with the categories alone that the tests above leave to it: so after
    # ``mode is A`` the next test is ``mode is B``, not ``mode is A,B``
    feature: Feature
    threshold: float  # the largest value that goes left

    def condition(self, digits: Digits | None = None) -> str:
        """Return the left branch in words: ``opponent_1 <= 8.25 m``; exact without ``digits``."""
        one, cut = self.feature, self.threshold
        test = at_most(cut) if digits is None else digits.at_most(self.number, cut)
        return whole(one, -math.inf, cut) or f"{printable(one.name)} {test}{_of(one)}"

    def question(self, digits: Digits | None = None) -> str:
        """Return the test in words as a tree asks it: "open", where the condition is "not open"."""
        if self.is_reversed:
            return whole(self.feature, self.threshold, math.inf)
        return self.condition(digits)

    @property
    def is_reversed(self) -> bool:
        """Whether yes is the right branch: of a flag, or where it has fewer categories."""
        feature, cut = self.feature, self.threshold
        if feature.categories:
            n_left = math.floor(cut) - feature.low + 1.0
            return len(feature.categories) / 2 < n_left < len(feature.categories)
        return feature.is_flag and 0.0 <= cut < 1.0

    def answer(self, *, is_left: bool) -> str:
        """Return which answer leads to a branch."""
        return "yes" if is_left != self.is_reversed else "no"


def asked(schema: Schema, tree: DecisionTree, node: int) -> AskedTest:
    """Return the test of an inner node."""
    number, threshold = int(tree.feature[node]), float(tree.threshold[node])
    one, cut = schema.features[number], math.floor(threshold)
    low, high, child = one.low, one.high, node
    while one.categories and child:
        above = int(tree.parent[child])
        if tree.feature[above] == number and tree.left[above] == child:
            high = min(high, math.floor(tree.threshold[above]))
        elif tree.feature[above] == number:
            low = max(low, math.floor(tree.threshold[above]) + 1.0)
        child = above
    if low <= cut < high and (low, high) != (one.low, one.high):
        names = one.categories[int(low - one.low) : int(high - one.low) + 1]
        one = replace(one, low=low, high=high, categories=names)
    return AskedTest(number, one, threshold)


def whole(feature: Feature, low: float, high: float) -> str:
    """Return the whole numbers of (low, high] in the words of their kind.

    Nothing of a quantity, and of an interval that holds all numbers or none.

    >>> whole(Feature("tariff", low=0, high=3, is_integer=True), 1.5, math.inf)
    'tariff >= 2'
    """
    if not feature.is_integer:
        return ""
    first = max(feature.low, math.floor(low) + 1 if math.isfinite(low) else low)
    last = min(feature.high, math.floor(high) if math.isfinite(high) else high)
    if first > last or (first, last) == (feature.low, feature.high):
        return ""
    if feature.group:
        negation = "" if first else " not"
        return f"{printable(feature.group)} is{negation} {printable(feature.category)}"
    name, unit = printable(feature.name), _of(feature)
    if feature.categories:
        start, end = int(first - feature.low), int(last - feature.low) + 1
        names = feature.categories
        return choice(feature.name, names[start:end], others=names[:start] + names[end:])
    if feature.is_flag:
        return name if first else f"not {name}"
    if first == last:
        return f"{name} = {first:.0f}{unit}"
    if feature.low < first and last < feature.high:
        return f"{first:.0f} <= {name} <= {last:.0f}{unit}"
    return f"{name} >= {first:.0f}{unit}" if first > feature.low else f"{name} <= {last:.0f}{unit}"


def choice(name: str, categories: Sequence[str], *, others: Sequence[str]) -> str:
    """Return the condition on a choice: its categories, or "is not" the others if these are fewer.

    >>> choice("phase", "BD", others="AC"), choice("phase", "ABC", others="D")
    ('phase is B,D', 'phase is not D')
    """
    told, word = (others, "is not") if len(others) < len(categories) else (categories, "is")
    parts = (quoted(one) if "," in one else printable(one) for one in told)
    return f"{printable(name)} {word} {','.join(parts)}"


def _of(feature: Feature) -> str:
    return f" {printable(feature.unit)}" if feature.unit else ""


def at_most(threshold: float) -> str:
    """Return a test of a number in the fewest digits that say it exactly.

    >>> at_most(8.25), at_most(23.999999999999996)
    ('<= 8.25', '< 24.0')
    """
    following = math.nextafter(threshold, math.inf)
    # Between two neighbours there is no double: ``x <= 23.999999999999996`` is ``x < 24``.
    if math.isfinite(following) and len(repr(following)) + 8 <= len(repr(threshold)):
        return f"< {following!r}"
    return f"<= {threshold!r}"


def labelled(feature: Feature) -> str:
    """Return a feature's name with its unit, for example ``opponent_1 [m]``."""
    return printable(feature.name) + (f" [{printable(feature.unit)}]" if feature.unit else "")


def meaning(feature: Feature) -> str:
    """Return the names of a category's numbers, to follow its bounds; else nothing."""
    if feature.group:
        return f", one of {printable(feature.group)}"
    codes = (f"{feature.low + k:.0f} {printable(c)}" for k, c in enumerate(feature.categories))
    return f", {', '.join(codes)}" if feature.categories else ""


@dataclass(frozen=True)
class Syntax:
    """How a language writes nested rules; each entry gives one line without its indentation."""

    opening: Callable[[int], str]  # the first test of a chain, of the given node
    chained: Callable[[int], str]  # a further test of a chain, of the given node
    otherwise: str  # the line before the last branch of a chain
    closing: str  # the line that ends a chain; empty where the indentation does
    # The action at a leaf (or at a node that is cut off), of the given node
    leaf: Callable[[int], str]


def nested(
    tree: DecisionTree,
    syntax: Syntax,
    *,
    root: int = 0,
    cut: frozenset[int] = frozenset(),
    is_reversed: Callable[[int], bool] = lambda _: False,
) -> Iterator[tuple[int, str]]:
    """Yield the rules below ``root`` as pairs of indentation level and line.

    The right branch of a test continues its chain ("else if"), so that only left branches are
    indented; the other way round where ``is_reversed`` says so of a node. Nodes in ``cut`` are
    written like leaves.
    """
    work: list[tuple[int, str] | tuple[int, int, bool]] = [(0, root, False)]
    while work:
        item = work.pop()
        if len(item) == 2:
            yield item
            continue
        level, node, is_chained = item
        if _is_end(tree, node, root, cut):
            yield level, syntax.leaf(node)
            continue
        yield level, (syntax.chained if is_chained else syntax.opening)(node)
        told, rest = int(tree.left[node]), int(tree.right[node])
        if is_reversed(node):
            told, rest = rest, told
        if _is_end(tree, rest, root, cut):
            if syntax.closing:
                work.append((level, syntax.closing))
            work += [(level + 1, rest, False), (level, syntax.otherwise)]
        else:
            work.append((level, rest, True))
        work.append((level + 1, told, False))


def rules(tree: DecisionTree, schema: Schema, leaves: Sequence[str], *, exact: bool = False) -> str:
    """Return the tree as nested rules, of which ``leaves`` has the text of each leaf.

    ``exact`` thresholds have all their digits, in place of those that a reader needs.
    """
    digits = None if exact else Digits(schema, tree)

    syntax = Syntax(
        opening=lambda node: f"if {asked(schema, tree, node).question(digits)}:",
        chained=lambda node: f"else if {asked(schema, tree, node).question(digits)}:",
        otherwise="else:",
        closing="",
        leaf=lambda node: leaves[tree.leaf[node]],
    )
    lines = nested(tree, syntax, is_reversed=lambda node: asked(schema, tree, node).is_reversed)
    return "\n".join("    " * level + line for level, line in lines)


def definitions(tree: DecisionTree, schema: Schema) -> list[str]:
    """Return a line for each derived feature that the tree asks for, and those these are made of.

    >>> from eutree.schema import Feature, Schema
    >>> tree = DecisionTree.single_leaf(2).split(0, 1, 3.0)
    >>> definitions(tree, Schema((Feature("x", "m"),), ("go",)).derive(["double = 2 * x"]))
    ['where double [m] = 2 * x']
    """
    names = schema.feature_names
    printed = list(map(printable, names))
    found = ((schema.features[j], names[:j]) for j in derived_features(tree, schema))
    return [f"where {labelled(one)} = {renamed(one.formula, of, printed)}" for one, of in found]


def derived_features(tree: DecisionTree, schema: Schema) -> list[int]:
    """Return the derived features that the tree asks for, and those these are made of, in order."""
    known, tested = Derivation.of(schema), set(tree.feature.tolist()) & formulas_of(schema).keys()
    wanted = {j % (known.n_measured + len(known.formulas)) for j in tested}  # whatever the step
    for j, formula in reversed(list(enumerate(known.formulas, known.n_measured))):
        if j in wanted:  # each is made of those before it
            wanted |= {one.index for one in formula}
    return sorted(j for j in wanted if j >= known.n_measured)


def _is_end(tree: DecisionTree, node: int, root: int, cut: frozenset[int]) -> bool:
    """Return whether the rules below ``root`` end at ``node``."""
    return tree.feature[node] == tree.NO_FEATURE or (node in cut and node != root)
