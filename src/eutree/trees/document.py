"""A decision tree as a flat list of nodes, the form in which files hold it.

Node 0 is the root. A node is either ``{"feature", "threshold", "left", "right"}`` (true of
``x[feature] <= threshold`` goes left, everything else, NaN included, right) or ``{"leaf"}``.
"""

import math
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from eutree.errors import FormatError, InvalidArgumentError
from eutree.trees.tree import DecisionTree

_Number = Annotated[int, msgspec.Meta(ge=-1, lt=2**31 - 1)]


class NodeDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """An inner node, or a leaf; see the module's docstring."""

    feature: _Number = -1
    threshold: float | None = None
    left: _Number = -1
    right: _Number = -1
    leaf: _Number = -1


def tree_to_document(tree: DecisionTree) -> list[NodeDocument]:
    """Return the nodes of the tree in index order."""
    columns = (tree.feature, tree.threshold, tree.left, tree.right, tree.leaf)
    return [
        NodeDocument(leaf=leaf) if feature < 0 else NodeDocument(feature, threshold, left, right)
        for feature, threshold, left, right, leaf in zip(
            *(column.tolist() for column in columns), strict=True
        )
    ]


def tree_from_document(
    nodes: list[NodeDocument], n_features: int, path: str | Path
) -> DecisionTree:
    """Return the tree, all rules checked; ``path`` is for the messages."""
    parents: dict[int, int] = {}
    for index, node in enumerate(nodes):
        problem = _node_problem(node, index, len(nodes), n_features, parents)
        if problem:
            raise FormatError(path, f"nodes[{index}]", problem)
    try:
        return DecisionTree(
            n_features,
            feature=np.array([node.feature for node in nodes], dtype=np.int32),
            threshold=np.array(
                [math.nan if node.threshold is None else node.threshold for node in nodes]
            ),
            left=np.array([node.left for node in nodes], dtype=np.int32),
            right=np.array([node.right for node in nodes], dtype=np.int32),
            leaf=np.array([node.leaf for node in nodes], dtype=np.int32),
        )
    except InvalidArgumentError as error:
        raise FormatError(path, "nodes", str(error)) from None


def _node_problem(
    node: NodeDocument, index: int, n_nodes: int, n_features: int, parents: dict[int, int]
) -> str:
    """Return what is wrong with one node; note its children in ``parents``."""
    inner = (node.feature, node.left, node.right)
    if node.leaf >= 0:
        is_leaf = inner == (-1, -1, -1) and node.threshold is None
        return "" if is_leaf else "a leaf must have no feature, threshold or children"
    if node.threshold is None or min(inner) < 0:
        return "must have feature, threshold, left and right, or else leaf"
    if not math.isfinite(node.threshold):
        return f"threshold must be finite, got {node.threshold}"
    if node.feature >= n_features:
        return f"feature must be in 0..{n_features - 1}, got {node.feature}"
    for child in (node.left, node.right):
        if child >= n_nodes:
            return f"child {child} does not exist; there are {n_nodes} nodes"
        if child <= index:
            return f"child {child} must come after its parent; this one makes a cycle"
        if parents.setdefault(child, index) != index or node.left == node.right:
            return f"child {child} is already a child of node {parents[child]}"
    return ""
