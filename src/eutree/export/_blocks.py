"""Deep trees cut into blocks, because compilers and parsers bound how deep rules may nest.

C99 promises 127 levels of nesting, Python 100 of indentation. A tree that is deeper than
``DEPTH`` becomes several functions: each block's rules end by calling the blocks below it.
"""

import re

import numpy as np

from eutree.export._identifiers import identifiers
from eutree.schema import Schema
from eutree.trees import DecisionTree

DEPTH = 60


def block_roots(tree: DecisionTree) -> list[int]:
    """Return the nodes at which blocks begin, deepest first and the tree's root last.

    A block calls only blocks that come before it in the list, so functions written in this order
    need no declarations.
    """
    depth = np.zeros(tree.n_nodes, dtype=np.int64)
    for node in range(1, tree.n_nodes):
        depth[node] = depth[tree.parent[node]] + 1
    is_inner = tree.feature != tree.NO_FEATURE
    roots = set(np.flatnonzero(is_inner & (depth % DEPTH == 0)).tolist()) | {0}
    return sorted(roots, reverse=True)


def action_identifiers(schema: Schema, *, reserved: tuple[str, ...] = ()) -> list[str]:
    """Return an identifier for each action; signs and points of levels are spelled."""
    names = list(schema.actions)
    if schema.controls:
        names = [_spelled(name) for name in names]
    return identifiers(names, reserved=reserved, prefix="action")


def control_identifiers(schema: Schema, *, reserved: frozenset[str]) -> list[str]:
    """Return an identifier for each control."""
    names = [control.name for control in schema.controls]
    return identifiers(names, reserved=reserved, prefix="control")


def _spelled(name: str) -> str:
    """Return a name with "minus" for the sign of a number and "p" for its point."""
    name = re.sub(r"(?<![\w.])-(?=\d)", "minus ", name)
    return re.sub(r"(?<=\d)\.(?=\d)", "p", name)
