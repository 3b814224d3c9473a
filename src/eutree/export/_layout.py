"""Where the nodes of a drawn tree stand: root at the left, one row for each leaf."""

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees import DecisionTree


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
