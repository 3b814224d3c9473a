"""The file of a policy: versioned JSON that a person can read and a diff can show."""

from pathlib import Path
from typing import ClassVar, TypedDict

import msgspec
import numpy as np

from eutree.arrays import Floats, Integers
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import Document
from eutree.files.documents import checksum_of, decode_document, encode_document
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
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from eutree.trees.document import NodeDocument, tree_from_document, tree_to_document


class LeafDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A leaf's action, its statistics for each action where known, and whether it is locked."""

    action: Index
    visits: list[int] | None = None
    values: list[float | None] | None = None
    deviations: list[float | None] | None = None
    locked: bool = False


class PolicyDocument(Document, frozen=True, kw_only=True, omit_defaults=True):
    """A ``TreePolicy``; ``leaves`` are in order of their numbers.

    From version 2 on there is a checksum, so that a digit that changed does not go unnoticed.
    """

    FORMAT: ClassVar[str] = "eutree/policy"
    VERSION: ClassVar[int] = 2

    environment: EnvironmentDocument | None
    schema: SchemaDocument
    history: Index
    nodes: list[NodeDocument]
    leaves: list[LeafDocument]
    past_actions: Index = 0
    checksum: str = ""  # filled in on writing


class PolicyParts(TypedDict):
    """The fields of a ``TreePolicy``."""

    tree: DecisionTree
    actions: Integers  # [L]
    schema: Schema
    environment: EnvironmentSpec | None
    history: int
    past_actions: int
    leaves: LeafStatistics | None
    locked: tuple[int, ...]


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
        )
    )


def policy_document(data: bytes, path: str | Path) -> PolicyDocument:
    """Return the document that the bytes hold; ``path`` is for the messages."""
    return decode_document(data, PolicyDocument, path)


def policy_parts(document: PolicyDocument, path: str | Path) -> PolicyParts:
    """Return what the document says, each field checked; ``path`` is for the messages."""
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
    )


def check_unchanged(document: PolicyDocument, path: str | Path) -> None:
    """Raise FormatError unless the content is what its checksum is of.

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
    if known is None:
        return [
            LeafDocument(action, locked=number in locked) for number, action in enumerate(actions)
        ]
    shape = (len(actions), parts["schema"].n_actions)
    for name in ("visits", "values", "deviations"):
        if getattr(known, name).shape != shape:
            raise InvalidArgumentError(
                f"leaves.{name} must have shape {shape}, got {getattr(known, name).shape}"
            )
    rows = zip(
        actions,
        known.visits.tolist(),
        _nan_to_none(known.values),
        _nan_to_none(known.deviations),
        strict=True,
    )
    return [LeafDocument(*row, locked=number in locked) for number, row in enumerate(rows)]


def _nan_to_none(matrix: Floats) -> list[list[float | None]]:
    return [[None if value != value else value for value in row] for row in matrix.tolist()]


def _statistics(
    leaves: list[LeafDocument], n_actions: int, path: str | Path
) -> LeafStatistics | None:
    """Return the statistics if every leaf has them, None if none has."""
    columns: dict[str, list[list[int]] | list[list[float | None]]] = {
        "visits": [leaf.visits for leaf in leaves if leaf.visits is not None],
        "values": [leaf.values for leaf in leaves if leaf.values is not None],
        "deviations": [leaf.deviations for leaf in leaves if leaf.deviations is not None],
    }
    if not any(columns.values()):
        return None
    for name, rows in columns.items():
        if len(rows) != len(leaves) or any(len(row) != n_actions for row in rows):
            reason = f"every leaf must have {n_actions} {name}, one for each action, or none any"
            raise FormatError(path, "leaves", reason)
    try:
        visits = np.array(columns["visits"], dtype=np.int64)
    except OverflowError:
        raise FormatError(path, "leaves", "visits must fit 64 bits") from None
    if visits.min() < 0:
        raise FormatError(path, "leaves", f"visits must be >= 0, got {visits.min()}")
    values, deviations = (
        np.array(columns[name], dtype=np.float64) for name in ("values", "deviations")
    )
    return LeafStatistics(visits, values, deviations)
