"""Certificates of a policy: a sentence that a reviewer can sign, and pictures."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np

from eutree.arrays import Booleans, Floats, Frozen, Integers, freeze
from eutree.display import Displayed, counted
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import Document, read_document, write_document
from eutree.files.documents import checksum_of
from eutree.policies import TreePolicy

VERDICTS = PROVEN, REFUTED, UNDECIDED = "proven", "refuted", "undecided"
KINDS = PROOF, STATISTICAL = "proof", "statistical"
KNOWN, OPEN, FAILS, EMPTY = range(4)  # of a picture's cells
NEVER = 2**31 - 1  # number of steps after which nothing has happened


@dataclass(frozen=True, eq=False)
class Starts(Frozen):
    """Boxes of states from which a property fails, or is not decided.

    Attributes:
        names: Names of the numbers of a state.
        low: Lower bounds.
        high: Upper bounds.
    """

    names: tuple[str, ...]
    low: Floats  # [N, d]
    high: Floats  # [N, d]

    def __post_init__(self) -> None:
        freeze(self, "low", "high")

    def draw(self, generator: np.random.Generator) -> Floats:
        """Return a state [d] of one of the boxes, all of them equally likely."""
        box = int(generator.integers(len(self.low)))
        state: Floats = generator.uniform(self.low[box], self.high[box])
        return state


@dataclass(frozen=True, eq=False)
class Pieces(Starts):
    """The boxes of starts that a proof has cut, and when each ends.

    Attributes:
        first: No state of the piece ends before so many steps; ``NEVER`` where none does.
        last: All states of the piece end within so many; ``NEVER`` where that is not known.
        shortest: No episode from the piece takes fewer steps, however it ends.
    """

    first: Integers  # [N]
    last: Integers  # [N]
    shortest: Integers  # [N]

    def __post_init__(self) -> None:
        freeze(self, "low", "high", "first", "last", "shortest")


@dataclass(frozen=True, eq=False)
class Picture(Frozen):
    """Cells of one number or of two.

    Attributes:
        title: Name of the quantity drawn.
        names: Names of the numbers.
        low: Where the cells begin, of each number.
        high: Where they end.
        values: Number drawn in each cell: the higher, the darker.
        marks: ``KNOWN``, ``OPEN``, ``FAILS``, or ``EMPTY`` where nothing is drawn.
        legend: Meaning of the colours.
    """

    title: str
    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    values: Floats  # [I, J]; J is 1 for one number
    marks: Integers  # [I, J]
    legend: str

    def __post_init__(self) -> None:
        freeze(self, "values", "marks")


@dataclass(frozen=True, eq=False)
class Certificate(Displayed):
    """The answer of a proof or of a sample.

    Attributes:
        sentence: The property that holds or was refuted, or how far the proof came.
        kind: ``"proof"``, for every start, or ``"statistical"``, from episodes that were drawn.
        verdict: ``"proven"``, ``"refuted"`` or ``"undecided"``.
        bounds: Lower and upper bound of quantities: ``{"steps": (83, 104)}``.
        undecided: Share of the starts that is not decided.
        worst_start: The start that takes longest, by the names of the state; None if not known.
        counterexample: A start from which the real environment breaks the property; None if none.
        starts: Where episodes may begin to learn more: where it fails or is undecided; None where
            it does nowhere, or where no place can be named.
        pieces: Boxes that the starts were cut into; None where they were not.
        pictures: The answer for each start, or for all states that are reached.
        work: Effort spent: pieces, steps of boxes, cells, episodes.
    """

    sentence: str
    kind: str
    verdict: str
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    undecided: float = 0.0
    worst_start: Mapping[str, float] | None = None
    counterexample: Mapping[str, Any] | None = None
    starts: Starts | None = None
    pieces: Pieces | None = None
    pictures: tuple[Picture, ...] = ()
    work: Mapping[str, float] = field(default_factory=dict)

    @property
    def proven(self) -> bool:
        """Whether the property holds; a statistical one: at its confidence."""
        return self.verdict == PROVEN

    def figures(self) -> dict[str, Any]:
        """Return all but the pieces, as ``eutree prove --json`` prints it."""
        names = ("proven", "verdict", "kind", "sentence", "undecided", "worst_start",
                 "counterexample")  # fmt: skip
        bounds = {name: list(ends) for name, ends in self.bounds.items()}
        known = {name: getattr(self, name) for name in names}
        return known | {"bounds": bounds, "work": dict(self.work)}

    def __str__(self) -> str:
        """Return the verdict, the sentence, and a start that breaks the property."""
        words = f"{self.verdict} ({self.kind}): {self.sentence}"
        start = dict(self.counterexample or {})
        steps = start.pop("steps", None)
        if steps is None or not start:
            return words
        place = ", ".join(f"{name} {value:.6g}" for name, value in start.items())
        return f"{words}; for example from {place}: after {counted(steps, 'step')}"


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
    marks: list[list[Annotated[int, msgspec.Meta(ge=KNOWN, le=EMPTY)]]]
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
    checksum: str = ""  # filled in on writing


_KEPT = [one.name for one in fields(Certificate) if one.name != "pieces"]


def save_certificate(path: str | Path, certificate: Certificate, policy: TreePolicy) -> None:
    """Write a certificate of a policy; its pieces are not kept.

    Raises:
        FileError: The file cannot be written.
    """
    known: dict[str, Any] = {name: getattr(certificate, name) for name in _KEPT}
    known["policy"] = _marks(policy)[0]
    known["bounds"] = {name: tuple(map(float, ends)) for name, ends in certificate.bounds.items()}
    known["starts"] = certificate.starts and _plain(certificate.starts)
    known["pictures"] = [_plain(one) for one in certificate.pictures]
    write_document(path, msgspec.convert(known, CertificateDocument))


def _plain(shown: Starts | Picture) -> dict[str, Any]:
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(shown).items()}


def load_certificate(path: str | Path, policy: TreePolicy | None = None) -> Certificate:
    """Return the certificate in a file.

    Args:
        path: File that ``save_certificate`` or ``eutree prove --out`` wrote.
        policy: The policy that it must be of; None for any.

    Raises:
        FormatError: The file is no certificate.
        FileError: The file is missing or cannot be read.
        InvalidArgumentError: It is of another policy.
    """
    document = read_document(path, CertificateDocument)
    if policy is not None and document.policy not in _marks(policy):
        raise InvalidArgumentError(f"{path} must be a certificate of this policy, got another's")
    for name, known in (("verdict", VERDICTS), ("kind", KINDS)):
        if getattr(document, name) not in known:
            reason = f"must be one of {', '.join(known)}, got {getattr(document, name)!r}"
            raise FormatError(path, name, reason)
    kept = {name: getattr(document, name) for name in _KEPT}
    kept["starts"] = document.starts and _starts(document.starts, path)
    pictures = enumerate(document.pictures)
    kept["pictures"] = tuple(_picture(one, f"pictures[{k}]", path) for k, one in pictures)
    if document.checksum not in ("", checksum_of(document)):  # first versions have none
        raise FormatError(
            path, "checksum", "the file was changed after eutree wrote it: prove again"
        )
    return Certificate(**kept)


def _starts(document: StartsDocument, path: str | Path) -> Starts:
    low, high = (_table(rows, "starts", path) for rows in (document.low, document.high))
    shape = len(document.low), len(document.names)
    if not (low.shape == high.shape == shape and low.size and (low <= high).all()):
        raise FormatError(path, "starts", "must be boxes, each with a lower and an upper bound")
    return Starts(tuple(document.names), low, high)


def _picture(document: PictureDocument, place: str, path: str | Path) -> Picture:
    values, marks = (_table(rows, place, path) for rows in (document.values, document.marks))
    ends, n = _table([document.low, document.high], place, path), len(document.names)
    if not (
        n in (1, 2)
        and ends.shape == (2, n)
        and (ends[0] < ends[1]).all()
        and values.ndim == 2
        and values.shape == marks.shape
        and 0 < values.size <= _MOST_CELLS
        and (n == 2 or values.shape[1] == 1)
    ):
        raise FormatError(path, place, "must be cells along one number or two, each with a mark")
    kept = {name: tuple(getattr(document, name)) for name in ("names", "low", "high")}
    return Picture(
        document.title, **kept, values=values, marks=marks.astype(np.int64), legend=document.legend
    )


def _table(rows: Sequence[Sequence[float]], place: str, path: str | Path) -> Floats:
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError:
        raise FormatError(path, place, "must be rows of one length") from None


def _marks(policy: TreePolicy) -> tuple[str, str]:
    """Return the hash that tells a policy from others, and the former one.

    Only the former is over the version of eutree that writes the policy, too.
    """
    whole = policy.to_bytes()
    known = re.sub(rb'(?m)^ "made_by": .*\n', b"", whole)
    return hashlib.sha256(known).hexdigest(), hashlib.sha256(whole).hexdigest()


COLUMNS, CELLS = 320, 64  # of a picture: along one number, and along each of two
BREAKS = "Black: not decided; red: it fails."


def pictures_of_pieces(pieces: Pieces, fails: Booleans, open_: Booleans) -> tuple[Picture, ...]:
    """Return the starts by the steps that they take at most, along the first two that vary.

    None where the starts are a point. A cell gets the worst of the pieces in it.
    """
    if not pieces.low.size:
        return ()
    low, high = pieces.low.min(axis=0), pieces.high.max(axis=0)
    varying = np.flatnonzero(high > low)[:2]
    if not varying.size:
        return ()
    low, high = low[varying], high[varying]
    ends = (pieces.last != NEVER) & ~fails & ~open_
    steps = np.where(ends, pieces.last, 0)
    legend = f"Blue: it holds. {BREAKS}"
    if ends.any():
        fewest = int(steps[ends].min())
        legend = f"Light: {fewest} steps; dark: {int(steps.max())}. {BREAKS}"
    marks = np.select([fails, open_], [FAILS, OPEN], KNOWN)
    shape = (COLUMNS, 1) if varying.size == 1 else (CELLS, CELLS)
    scale = np.array(shape[: varying.size]) / (high - low)
    begins = np.floor((pieces.low[:, varying] - low) * scale).astype(int)
    finish = np.maximum(np.ceil((pieces.high[:, varying] - low) * scale).astype(int), begins + 1)
    found, marked = np.zeros(shape), np.full(shape, EMPTY)
    for k in np.lexsort((steps, marks)):  # the worst is painted last
        room = tuple(slice(b, e) for b, e in zip(begins[k], finish[k], strict=True))
        found[room], marked[room] = steps[k], marks[k]
    names = tuple(pieces.names[k] for k in varying)
    sides = tuple(low.tolist()), tuple(high.tolist())
    return (Picture("The starts", names, *sides, found, marked, legend),)
