"""Drawn trees: where nodes stand and which colours leaves have; in Graphviz's and TikZ's words.

The root is at the left, and each leaf has a row. SVG is in a module of its own.
"""

import colorsys
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.export._code import ASSUMPTION, filled
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.trees.text import asked, printable
from eutree.trees.tree import depths


@dataclass(frozen=True, eq=False)
class Layout:
    """Places of all nodes; no two nodes share a place and no two branches cross."""

    # Row of each node, from 0 at the top; an inner node is midway between its children
    row: Floats  # [M]
    column: Integers  # [M]; number of tests above each node
    n_rows: int  # number of rows, one for each leaf


def layout(tree: DecisionTree) -> Layout:
    """Return the places of all nodes, the "yes" branch above the "no" branch."""
    row, next_row = np.zeros(tree.n_nodes), 0
    for node in tree.preorder():
        if tree.feature[node] == tree.NO_FEATURE:
            row[node], next_row = next_row, next_row + 1
    for node in reversed(range(tree.n_nodes)):  # children come after their parents
        if tree.feature[node] != tree.NO_FEATURE:
            row[node] = (row[tree.left[node]] + row[tree.right[node]]) / 2
    return Layout(row, depths(tree.parent), next_row)


def column_lefts(
    places: Layout, widths: Sequence[float], *, gap: float, margin: float = 0.0
) -> list[float]:
    """Return the left end of each node: columns as wide as their widest node, ``gap`` apart."""
    widest = [0.0] * (int(places.column.max()) + 1)
    for column, width in zip(places.column.tolist(), widths, strict=True):
        widest[column] = max(widest[column], width)
    starts = [margin]
    for width in widest:
        starts.append(starts[-1] + width + gap)
    return [starts[column] for column in places.column.tolist()]


def text_width(text: str) -> float:
    """Return about how many pixels ``text`` takes at 12 px in a common sans-serif font."""
    return sum(
        12.5 if unicodedata.east_asian_width(sign) in "WF"
        else 3.8 if sign in " .,:;'|!()[]iljtfr"
        else 10.2 if sign in "mwMW%@"
        else 7.2
        for sign in text
    )  # fmt: skip


def words_of_test(policy: TreePolicy, node: int) -> str:
    """Return the test of an inner node with its exact threshold."""
    return asked(policy.schema, policy.tree, node).question()


def words_of_leaf(policy: TreePolicy, node: int) -> str:
    """Return the name of the action of a leaf's node."""
    return printable(policy.schema.actions[policy.actions[policy.tree.leaf[node]]])


def branches(policy: TreePolicy) -> Iterator[tuple[int, int, str]]:
    """Yield parent, child and "yes" or "no" for each branch, in preorder."""
    tree = policy.tree
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            test = asked(policy.schema, tree, node)
            yield node, int(tree.left[node]), test.answer(is_left=True)
            yield node, int(tree.right[node]), test.answer(is_left=False)


# Levels of one quantity are an order, so theirs are one scale: from blue below 0 over grey to
# orange above, or from grey to orange. Any other actions have a hue each.


# After Okabe and Ito, lightened until black text on each has a contrast of at least 7 to 1.
FILLS = ("#f6b26b", "#8ecae6", "#7fd1ae", "#f3e27a", "#d9a6e0", "#a9b8f5", "#f0a8a0", "#c9cfd6")
_BELOW, _MIDDLE, _ABOVE = (102, 178, 240), (214, 219, 224), (245, 160, 70)
_TURN, _LIGHT, _STRONG = 0.618, 0.8, 0.55  # of the hues after the first eight


def fills(schema: Schema) -> tuple[str, ...]:
    """Return the fill colour of each action's leaves."""
    if len(schema.controls) == 1:
        return _scale(schema.controls[0].levels)
    return (*FILLS[: schema.n_actions], *map(_hue, range(len(FILLS), schema.n_actions)))


def _scale(levels: tuple[float, ...]) -> tuple[str, ...]:
    """Return the colours of some levels of a quantity, from low to high."""
    low, high = min(levels), max(levels)
    ends, anchors = [low, high], [_MIDDLE, _ABOVE]
    if low < 0.0 < high:
        ends, anchors = [low, 0.0, high], [_BELOW, _MIDDLE, _ABOVE]
    columns = np.array(anchors, dtype=np.float64).T
    return tuple(
        _hexadecimal([float(np.interp(level, ends, column)) for column in columns])
        for level in levels
    )


def _hue(number: int) -> str:
    """Return a hue far from those of the numbers before; some look much alike for a few people."""
    parts = colorsys.hls_to_rgb(number * _TURN % 1.0, _LIGHT, _STRONG)
    return _hexadecimal([255.0 * part for part in parts])


def _hexadecimal(parts: list[float]) -> str:
    return "#" + "".join(f"{round(part):02x}" for part in parts)


# LaTeX: pictures with TikZ and nothing else.


_SIGNS = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    '"': r"\textquotedbl{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "-": r"{-}",
    "'": r"{'}",
    "`": r"{`}",
}


# Size of a pixel of `text_width` in \footnotesize of Computer Modern, and space around words.
_CENTIMETRES, _PADDING, _GAP = 0.0215, 0.25, 1.1


def to_latex(policy: TreePolicy, *, document: bool = False) -> str:
    r"""Return the tree as a ``tikzpicture``, root at the left, leaves coloured by action.

    The picture needs ``\usepackage[T1]{fontenc}`` and ``\usepackage{tikz}``; names that are not
    Latin need LuaLaTeX or XeLaTeX and a font that has their letters.

    Args:
        policy: Policy to draw.
        document: Whether to return a whole document rather than the picture alone.
    """
    tree, places = policy.tree, layout(policy.tree)
    colours = [
        rf"\definecolor{{eutree{number}}}{{HTML}}{{{fill[1:].upper()}}}"
        for number, fill in enumerate(fills(policy.schema))
    ]
    is_leaf = tree.feature == tree.NO_FEATURE
    labels = [
        words_of_leaf(policy, node) if is_leaf[node] else words_of_test(policy, node)
        for node in range(tree.n_nodes)
    ]
    widths = [_CENTIMETRES * text_width(label) + _PADDING for label in labels]
    lefts = column_lefts(places, widths, gap=_GAP)
    nodes = []
    for node in tree.preorder():
        kind, words = "test", _escaped(labels[node]).replace(r"\textless{}=", r"$\leq$")
        if is_leaf[node]:
            kind = f"leaf, fill=eutree{policy.actions[tree.leaf[node]]}"
            words = _escaped(labels[node])
        where = f"({lefts[node]:.2f},{-places.row[node] * 0.75:.4f})"
        nodes.append(rf"  \node[{kind}] (n{node}) at {where} {{{words}}};")
    edges = [
        rf"  \draw[black!40] (n{parent}.east) -- node[answer] {{{answer}}} (n{child}.west);"
        for parent, child, answer in branches(policy)
    ]
    lines = [f"% {ASSUMPTION}"] if policy.masked else []
    lines += filled("latex", colours=colours, tree=nodes + edges)
    if document:
        opening = [r"\documentclass[border=4pt]{standalone}", r"\usepackage[T1]{fontenc}"]
        lines = [*opening, r"\usepackage{tikz}", r"\begin{document}", *lines, r"\end{document}"]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Return ``text`` with the signs that TeX gives a meaning to, and ligatures, made harmless."""
    return "".join(_SIGNS.get(sign, sign) for sign in text)


def to_dot(policy: TreePolicy) -> str:
    """Return the tree as a Graphviz digraph, root at the left, leaves coloured by action."""
    tree, colours, nodes = policy.tree, fills(policy.schema), []
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            nodes.append(f"    n{node} [label={_quoted(words_of_test(policy, node))}];")
            continue
        colour = colours[int(policy.actions[tree.leaf[node]])]
        label = _quoted(words_of_leaf(policy, node))
        nodes.append(f'    n{node} [label={label}, fillcolor="{colour}", color="{colour}"];')
    edges = [
        f'    n{parent} -> n{child} [label="{answer}"];'
        for parent, child, answer in branches(policy)
    ]
    lines = [f"// {ASSUMPTION}"] if policy.masked else []
    return "\n".join([*lines, *filled("dot", tree=nodes + edges)]) + "\n"


def _quoted(text: str) -> str:
    r"""Return a DOT string; a backslash would begin an escape and ``&`` an entity."""
    escaped = text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
