"""Where the nodes of a drawn tree stand: root at the left, one row for each leaf."""

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
