"""The file of a policy: versioned JSON that a person can read and a diff can show."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from msgspec.structs import astuple

from eutree.arrays import Floats
from eutree.errors import FormatError, InvalidArgumentError, blamed
from eutree.files import Document
from eutree.files.documents import checksum_of, encode_document
from eutree.files.schema_document import (
    EnvironmentDocument,
    Index,
    SchemaDocument,
    environment_from_document,
    environment_to_document,
    schema_from_document,
    schema_to_document,
)
from eutree.policies.leaf_statistics import LeafStatistics
from eutree.trees import DecisionTree

# Node 0 is the root. A node is either ``{"feature", "threshold", "left", "right"}`` (true of
# ``x[feature] <= threshold`` goes left, everything else, NaN included, right) or ``{"leaf"}``.


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
        NodeDocument(leaf=leaf) if leaf >= 0 else NodeDocument(*test)
        for *test, leaf in zip(*(column.tolist() for column in columns), strict=True)
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
    rows = np.array([astuple(node) for node in nodes], dtype=np.float64)  # null becomes NaN
    with blamed(path, "nodes"):
        return DecisionTree(n_features, *rows.reshape(-1, 5).T)


def _node_problem(
    node: NodeDocument, index: int, n_nodes: int, n_features: int, parents: dict[int, int]
) -> str:
    """Return the fault of one node; note its children in ``parents``."""
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


class LeafDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A leaf's action, statistics and ranks of each action where known, whether it is locked."""

    action: Index
    visits: list[int] | None = None
    values: list[float | None] | None = None
    deviations: list[float | None] | None = None
    locked: bool = False
    ranks: list[Index] | None = None


class PolicyDocument(Document, frozen=True, kw_only=True, omit_defaults=True):
    """A ``TreePolicy``; ``leaves`` are in order of their numbers.

    From version 2 on there is a checksum, so that a digit that changed does not go unnoticed.
    ``masked`` says that actions are forbidden at times where it acts.
    """

    FORMAT: ClassVar[str] = "eutree/policy"
    VERSION: ClassVar[int] = 2

    environment: EnvironmentDocument | None
    schema: SchemaDocument
    history: Index
    nodes: list[NodeDocument]
    leaves: list[LeafDocument]
    past_actions: Index = 0
    masked: bool = False
    checksum: str = ""  # filled in on writing


PolicyParts = dict[str, Any]  # fields of a ``TreePolicy``, which is made with this module


def policy_to_bytes(parts: PolicyParts) -> bytes:
    """Return the content of a policy's file; the same policy gives the same bytes."""
    return encode_document(
        PolicyDocument(
            environment=environment_to_document(parts["environment"]),
            schema=schema_to_document(parts["schema"]),
            history=parts["history"],
            past_actions=parts["past_actions"],
            nodes=tree_to_document(parts["tree"]),
            leaves=_leaves_to_document(parts),
            masked=parts["masked"],
        )
    )


def policy_parts(document: PolicyDocument, path: str | Path) -> PolicyParts:
    """Return the content of a document, each field checked; ``path`` is for the messages."""
    schema = schema_from_document(document.schema, path)
    tree = tree_from_document(document.nodes, schema.n_features, path)
    if len(document.leaves) != tree.n_leaves:
        reason = f"expected {tree.n_leaves}, one for each leaf, got {len(document.leaves)}"
        raise FormatError(path, "leaves", reason)
    for number, leaf in enumerate(document.leaves):
        if leaf.action >= schema.n_actions:
            reason = f"must be in 0..{schema.n_actions - 1}, got {leaf.action}"
            raise FormatError(path, f"leaves[{number}].action", reason)
    return PolicyParts(
        tree=tree,
        actions=np.array([leaf.action for leaf in document.leaves], dtype=np.int64),
        schema=schema,
        environment=environment_from_document(document.environment, path),
        history=document.history,
        past_actions=document.past_actions,
        leaves=_statistics(document.leaves, schema.n_actions, path),
        locked=tuple(number for number, leaf in enumerate(document.leaves) if leaf.locked),
        masked=document.masked,
        ranks=_columns(document.leaves, ["ranks"], schema.n_actions, path)[0],
    )


def check_unchanged(document: PolicyDocument, path: str | Path) -> None:
    """Raise FormatError unless the content has the checksum in the file.

    Files of version 1 have none.
    """
    if document.version < 2:
        return
    found = checksum_of(document)
    if document.checksum != found:
        raise FormatError(
            path,
            "checksum",
            f"the file was changed after eutree wrote it: its checksum is {document.checksum!r}, "
            f"that of its content {found!r}. If the change is meant, look at it and accept it: "
            f"eutree edit {path} --reseal",
        )


def _leaves_to_document(parts: PolicyParts) -> list[LeafDocument]:
    actions, known, locked = parts["actions"].tolist(), parts["leaves"], set(parts["locked"])
    shape, columns = (len(actions), parts["schema"].n_actions), [actions]
    for name in ("visits", "values", "deviations"):
        column = getattr(known, name, None)
        if column is not None and column.shape != shape:
            raise InvalidArgumentError(f"leaves.{name} must have shape {shape}, got {column.shape}")
        columns.append(_rows(column, len(actions)))
    columns += [
        [leaf in locked for leaf in range(len(actions))],
        _rows(parts["ranks"], len(actions)),
    ]
    return [LeafDocument(*row) for row in zip(*columns, strict=True)]


def _rows(matrix: Floats | None, n_leaves: int) -> list[list[float | None] | None]:
    if matrix is None:
        return [None] * n_leaves
    return [[None if value != value else value for value in row] for row in matrix.tolist()]


def _columns(
    leaves: list[LeafDocument], names: Sequence[str], n_actions: int, path: str | Path
) -> list[Any]:
    """Return what every leaf says of each action under some names; None if none says any of it."""
    found = [[row for leaf in leaves if (row := getattr(leaf, one)) is not None] for one in names]
    for name, rows in zip(names, found, strict=True) if any(found) else ():
        if len(rows) != len(leaves) or any(len(row) != n_actions for row in rows):
            reason = f"every leaf must have {n_actions} {name}, one for each action, or none any"
            raise FormatError(path, "leaves", reason)
    return [rows or None for rows in found]


def _statistics(
    leaves: list[LeafDocument], n_actions: int, path: str | Path
) -> LeafStatistics | None:
    """Return the statistics if every leaf has them, None if none has."""
    names = ("visits", "values", "deviations")
    visits, values, deviations = _columns(leaves, names, n_actions, path)
    if visits is None:
        return None
    try:
        visits = np.array(visits, dtype=np.int64)
    except OverflowError:
        raise FormatError(path, "leaves", "visits must fit 64 bits") from None
    if visits.min() < 0:
        raise FormatError(path, "leaves", f"visits must be >= 0, got {visits.min()}")
    return LeafStatistics(visits, values, deviations)
