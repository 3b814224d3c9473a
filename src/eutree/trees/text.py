"""Trees in words: names made printable, one test as a condition, a whole tree as nested rules.

A name that could be misread, because it holds a quote, a bracket of a comment, a line break or an
invisible character, is written as a JSON string; every other name is written as it is. So each
text can be read back, and no name can end the comment or the line that it stands in.
"""

import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from eutree.schema import Feature, Schema
from eutree.trees.digits import Digits
from eutree.trees.tree import DecisionTree

# Fine in every kind of text: letters, digits, single blanks, and signs that end nothing.
_PLAIN = re.compile(
    r"(?! )(?:[^\W_]|[-_ .,+%°²³µ·')\[\]|~!@;]|/(?![/*])|\*(?![/)])|\((?!\*))+(?<! )"
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


def condition(schema: Schema, feature: int, threshold: float, digits: Digits | None = None) -> str:
    """Return one test in words, for example ``opponent_1 <= 8.25 m``.

    Args:
        schema: Names and units.
        feature: Which feature is tested.
        threshold: The largest value that passes.
        digits: Which digits are shown; without, the number is exact.
    """
    name, unit = schema.features[feature].name, schema.features[feature].unit
    test = at_most(threshold) if digits is None else digits.at_most(feature, threshold)
    return f"{printable(name)} {test}" + (f" {printable(unit)}" if unit else "")


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


@dataclass(frozen=True)
class Syntax:
    """How a language writes nested rules; each entry gives one line without its indentation.

    Attributes:
        opening: The first test of a chain, of the given node.
        chained: A further test of a chain, of the given node.
        otherwise: What stands before the last branch of a chain.
        closing: What ends a chain; empty where the indentation does.
        leaf: What is done at a leaf (or at a node that is cut off), of the given node.
    """

    opening: Callable[[int], str]
    chained: Callable[[int], str]
    otherwise: str
    closing: str
    leaf: Callable[[int], str]


def nested(
    tree: DecisionTree, syntax: Syntax, *, root: int = 0, cut: frozenset[int] = frozenset()
) -> Iterator[tuple[int, str]]:
    """Yield the rules below ``root`` as pairs of indentation level and line.

    The right branch of a test continues its chain ("else if"), so that only left branches are
    indented. Nodes in ``cut`` are written like leaves.
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
        right = int(tree.right[node])
        if _is_end(tree, right, root, cut):
            if syntax.closing:
                work.append((level, syntax.closing))
            work += [(level + 1, right, False), (level, syntax.otherwise)]
        else:
            work.append((level, right, True))
        work.append((level + 1, int(tree.left[node]), False))


def rules(tree: DecisionTree, schema: Schema, leaves: Sequence[str], *, exact: bool = False) -> str:
    """Return the tree as nested rules.

    Args:
        tree: The tree.
        schema: Names and units of its features.
        leaves: What to write at each leaf.
        exact: Whether thresholds have all their digits, in place of those that a reader needs.
    """
    digits = None if exact else Digits(schema, tree)

    def test(node: int) -> str:
        return condition(schema, int(tree.feature[node]), float(tree.threshold[node]), digits)

    syntax = Syntax(
        opening=lambda node: f"if {test(node)}:",
        chained=lambda node: f"else if {test(node)}:",
        otherwise="else:",
        closing="",
        leaf=lambda node: leaves[tree.leaf[node]],
    )
    return "\n".join("    " * level + line for level, line in nested(tree, syntax))


def _is_end(tree: DecisionTree, node: int, root: int, cut: frozenset[int]) -> bool:
    """Return whether the rules below ``root`` end at ``node``."""
    return tree.feature[node] == tree.NO_FEATURE or (node in cut and node != root)
