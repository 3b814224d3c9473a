"""Where the nodes of a drawn tree stand: root at the left, one row for each leaf."""

import colorsys
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.trees.text import is_reversed, printable, question


@dataclass(frozen=True, eq=False)
class Layout:
    """Places of all nodes; no two nodes share a place and no two branches cross.

    Attributes:
        row: Row of each node, from 0 at the top; an inner node is midway between its children.
        column: Number of tests above each node.
        n_rows: Number of rows, one for each leaf.
    """

    row: Floats  # [M]
    column: Integers  # [M]
    n_rows: int


def layout(tree: DecisionTree) -> Layout:
    """Return the places of all nodes, the "yes" branch above the "no" branch."""
    row, column = np.zeros(tree.n_nodes), np.zeros(tree.n_nodes, dtype=np.int64)
    next_row = 0
    for node in tree.preorder():
        if node != 0:
            column[node] = column[tree.parent[node]] + 1
        if tree.feature[node] == tree.NO_FEATURE:
            row[node], next_row = next_row, next_row + 1
    for node in reversed(range(tree.n_nodes)):  # children come after their parents
        if tree.feature[node] != tree.NO_FEATURE:
            row[node] = (row[tree.left[node]] + row[tree.right[node]]) / 2
    return Layout(row, column, next_row)


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
    tree = policy.tree
    return question(policy.schema, int(tree.feature[node]), float(tree.threshold[node]))


def words_of_leaf(policy: TreePolicy, node: int) -> str:
    """Return the name of the action of a leaf's node."""
    return printable(policy.schema.actions[policy.actions[policy.tree.leaf[node]]])


def branches(policy: TreePolicy) -> Iterator[tuple[int, int, str]]:
    """Yield parent, child and "yes" or "no" for each branch, in preorder."""
    tree = policy.tree
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            yield node, int(tree.left[node]), answer_of(policy, node, is_left=True)
            yield node, int(tree.right[node]), answer_of(policy, node, is_left=False)


def answer_of(policy: TreePolicy, node: int, *, is_left: bool) -> str:
    """Return which answer to the test of an inner node leads to one of its branches."""
    feature = policy.schema.features[policy.tree.feature[node]]
    reverse = is_reversed(feature, float(policy.tree.threshold[node]))
    return "yes" if is_left != reverse else "no"


# Levels of one quantity are an order, so theirs are one scale: from blue below 0 over grey to
# orange above, or from grey to orange. Any other actions have a hue each.


# After Okabe and Ito, lightened until black text on each has a contrast of at least 7 to 1.
FILLS = (
    "#f6b26b",
    "#8ecae6",
    "#7fd1ae",
    "#f3e27a",
    "#d9a6e0",
    "#a9b8f5",
    "#f0a8a0",
    "#c9cfd6",
)
_BELOW, _MIDDLE, _ABOVE = (102, 178, 240), (214, 219, 224), (245, 160, 70)
_TURN, _LIGHT, _STRONG = 0.618, 0.8, 0.55  # of the hues after the first eight


def fills(schema: Schema) -> tuple[str, ...]:
    """Return the fill colour of each action's leaves."""
    if len(schema.controls) == 1:
        return _scale(schema.controls[0].levels)
    more = range(len(FILLS), schema.n_actions)
    return (*FILLS[: schema.n_actions], *map(_hue, more))


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
