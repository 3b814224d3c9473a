"""The file of a certificate: what was proven of which policy, where it failed, its pictures."""

import hashlib
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np

from eutree.arrays import Floats
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import Document, read_document, write_document
from eutree.policies import TreePolicy
from eutree.proof.certificate import (
    EMPTY,
    PROOF,
    PROVEN,
    REFUTED,
    STATISTICAL,
    UNDECIDED,
    Certificate,
    Picture,
    Starts,
)

_MOST_CELLS = 2**16  # of a picture


class StartsDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Boxes of states: the lower and upper bounds of each."""

    names: list[str]
    low: list[list[float]]
    high: list[list[float]]


class PictureDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Cells to be coloured: values by rows, and a mark for each."""

    title: str
    names: list[str]
    low: list[float]
    high: list[float]
    values: list[list[float]]
    marks: list[list[int]]
    legend: str


class CertificateDocument(Document, frozen=True, kw_only=True):
    """A certificate, and the SHA-256 of the policy that it is of."""

    FORMAT: ClassVar[str] = "eutree/certificate"

    policy: str
    verdict: str
    kind: str
    sentence: str
    bounds: dict[str, tuple[float, float]]
    undecided: float
    worst_start: dict[str, float] | None
    counterexample: dict[str, Any] | None
    work: dict[str, float]
    starts: StartsDocument | None
    pictures: list[PictureDocument]


def save_certificate(path: str | Path, certificate: Certificate, policy: TreePolicy) -> None:
    """Write a certificate of a policy; its pieces are not kept.

    Raises:
        FileError: The file cannot be written.
    """
    starts = certificate.starts
    document = CertificateDocument(
        policy=_mark(policy),
        verdict=certificate.verdict,
        kind=certificate.kind,
        sentence=certificate.sentence,
        bounds={name: (float(a), float(b)) for name, (a, b) in certificate.bounds.items()},
        undecided=certificate.undecided,
        worst_start=None if certificate.worst_start is None else dict(certificate.worst_start),
        counterexample=None
        if certificate.counterexample is None
        else dict(certificate.counterexample),
        work=dict(certificate.work),
        starts=None
        if starts is None
        else StartsDocument(list(starts.names), starts.low.tolist(), starts.high.tolist()),
        pictures=[
            PictureDocument(
                one.title, list(one.names), list(one.low), list(one.high), one.values.tolist(),
                one.marks.tolist(), one.legend,
            )
            for one in certificate.pictures
        ],
    )  # fmt: skip
    write_document(path, document)


def load_certificate(path: str | Path, policy: TreePolicy | None = None) -> Certificate:
    """Return the certificate in a file.

    Args:
        path: What ``save_certificate`` or ``eutree prove --out`` wrote.
        policy: The policy that it must be of; None for any.

    Raises:
        FormatError: The file is no certificate.
        FileError: The file is missing or cannot be read.
        InvalidArgumentError: It is of another policy.
    """
    document = read_document(path, CertificateDocument)
    if policy is not None and document.policy != _mark(policy):
        raise InvalidArgumentError(f"{path} must be a certificate of this policy, got another's")
    for name, value, known in (
        ("verdict", document.verdict, (PROVEN, REFUTED, UNDECIDED)),
        ("kind", document.kind, (PROOF, STATISTICAL)),
    ):
        if value not in known:
            raise FormatError(path, name, f"must be one of {', '.join(known)}, got {value!r}")
    return Certificate(
        sentence=document.sentence,
        kind=document.kind,
        verdict=document.verdict,
        bounds=document.bounds,
        undecided=document.undecided,
        worst_start=document.worst_start,
        counterexample=document.counterexample,
        starts=None if document.starts is None else _starts(document.starts, path),
        pictures=tuple(
            _picture(one, f"pictures[{k}]", path) for k, one in enumerate(document.pictures)
        ),
        work=document.work,
    )


def _starts(document: StartsDocument, path: str | Path) -> Starts:
    columns = len(document.names)
    low, high = (
        _table(getattr(document, name), f"starts.{name}", path, columns) for name in ("low", "high")
    )
    if len(low) == 0 or low.shape != high.shape or not (low <= high).all():
        raise FormatError(path, "starts", "must be boxes, each with a lower and an upper bound")
    return Starts(tuple(document.names), low, high)


def _picture(document: PictureDocument, place: str, path: str | Path) -> Picture:
    values = _table(document.values, f"{place}.values", path)
    marks = _table(document.marks, f"{place}.marks", path).astype(np.int64)
    ends = np.array([document.low, document.high]) if _pairs(document) else np.empty((0, 0))
    if not (
        ends.size
        and (ends[0] < ends[1]).all()
        and values.shape == marks.shape
        and 0 < values.size <= _MOST_CELLS
        and (len(document.names) == 2 or values.shape[1] == 1)
        and ((marks >= 0) & (marks <= EMPTY)).all()
    ):
        raise FormatError(path, place, "must be cells along one number or two, each with a mark")
    return Picture(
        document.title,
        tuple(document.names),
        tuple(document.low),
        tuple(document.high),
        values,
        marks,
        document.legend,
    )


def _pairs(document: PictureDocument) -> bool:
    """Return whether one or two numbers have a name and both ends each."""
    return len(document.names) == len(document.low) == len(document.high) in (1, 2)


def _table(
    rows: list[list[float]] | list[list[int]],
    place: str,
    path: str | Path,
    columns: int | None = None,
) -> Floats:
    """Return rows of one length as an array."""
    lengths = {len(row) for row in rows}
    if len(lengths) > 1 or (columns is not None and lengths - {columns}):
        raise FormatError(path, place, "must be rows of one length")
    return np.array(rows, dtype=np.float64)


def _mark(policy: TreePolicy) -> str:
    """Return what tells a policy from others."""
    return hashlib.sha256(policy.to_bytes()).hexdigest()
