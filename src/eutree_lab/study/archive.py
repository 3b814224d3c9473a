"""One person of a study in one archive: all that is needed to analyse it, and nothing personal.

    5f0c9a3e.zip
        person.json                          versions, task, protocol, times, results, answers
        study.toml, consent.md
        demos/demonstrations.json, episode-00000.npz, ...
        fitted.json, taken-over.json, practised.json    as far as they were made

All members bear the same date, and no path leads out of the archive. Times are durations.
"""

import io
import os
import platform
import re
import zipfile
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from eutree.errors import EutreeError, FileError, FormatError, warn
from eutree.files import Document, read_bytes, read_document, write_bytes
from eutree.files.schema_document import EnvironmentDocument
from eutree_lab.study.plan import CONSENT_TEXT, PLAN, StudyPlan

FITTED, TAKEN_OVER, PRACTISED = "fitted", "taken-over", "practised"
TREES = (FITTED, TAKEN_OVER, PRACTISED)
DEMOS, PERSON_FILE = "demos", "person.json"
EPOCH = (1980, 1, 1, 0, 0, 0)  # the date of every member
MAX_EXPORT = 200 << 20  # bytes, unpacked too
_MEMBER = re.compile(
    r"person\.json|study\.toml|consent\.md|(fitted|taken-over|practised)\.json"
    r"|demos/(demonstrations\.json|episode-\d{5,9}\.npz)"
)


class TreeResult(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Results of a tree when the person saw it.

    Attributes:
        tree: ``"fitted"``, ``"taken-over"`` or ``"practised"``.
        leaves: Number of leaves.
        episodes: Episodes it played.
        successes: How many of them succeeded; None where nothing says so.
        mean_return: Mean return of these episodes.
    """

    tree: str
    leaves: int
    episodes: int
    successes: int | None
    mean_return: float


class PersonDocument(Document, frozen=True, kw_only=True):
    """The record of a person: the parts of the study, and their results.

    Attributes:
        person: The random code.
        protocol: Digest of all that is the same for each person.
        environment: The task.
        plan: The plan of the study.
        versions: Of the programs that took part.
        seconds: How long each part took.
        results: Results of each tree.
        answers: One for each question; empty where none was given.
        part: The part that the person has come to.
    """

    FORMAT: ClassVar[str] = "eutree/person"
    VERSION: ClassVar[int] = 1

    person: str
    protocol: str
    environment: EnvironmentDocument | None
    plan: StudyPlan
    versions: dict[str, str]
    seconds: dict[str, float]
    results: list[TreeResult]
    answers: list[str]
    part: str


def versions() -> dict[str, str]:
    """Return the versions of the packages that play a part in an episode."""
    known = {name: version(name) for name in ("eutree", "numpy", "gymnasium")}
    return {**known, "python": platform.python_version()}


def pack(folder: Path, study: Path) -> Path:
    """Write a person's folder into one archive beside it; return its path.

    Args:
        folder: The person's.
        study: The study, whose plan and consent text are packed where the person has none.
    """
    names = [PERSON_FILE, PLAN, CONSENT_TEXT, *(f"{tree}.json" for tree in TREES)]
    names += sorted(f"{DEMOS}/{path.name}" for path in (folder / DEMOS).iterdir())
    members = {name: folder / name for name in names if (folder / name).exists()}
    for name in (PLAN, CONSENT_TEXT):
        members.setdefault(name, study / name)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, path in members.items():
            if _MEMBER.fullmatch(name):
                data = read_bytes(path, limit=MAX_EXPORT)
                archive.writestr(zipfile.ZipInfo(name, EPOCH), data)
    packed = study / f"{folder.name}.zip"
    write_bytes(packed, buffer.getvalue())
    os.utime(packed, (0.0, 0.0))  # when it was written is nobody's business
    return packed


def unpack(path: Path, folder: Path) -> PersonDocument:
    """Write the members of a person's archive into a folder; return the person's record.

    Raises:
        FormatError: It is no such archive, holds files that do not belong there, or far too much.
        FileError: It cannot be read.
    """
    data = read_bytes(path, limit=MAX_EXPORT)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
            if sum(entry.file_size for entry in entries) > MAX_EXPORT:
                raise FormatError(path, "", f"holds more than {MAX_EXPORT:,} bytes")
            for entry in entries:
                if not _MEMBER.fullmatch(entry.filename):
                    raise FormatError(path, entry.filename, "does not belong there")
                target = folder / entry.filename
                target.parent.mkdir(parents=True, exist_ok=True)
                write_bytes(target, archive.read(entry))
    except EutreeError:
        raise
    except Exception as error:  # of zipfile, zlib and others, where it is damaged
        raise FormatError(path, "", f"is no archive of a person: {error}") from None
    if not (folder / PERSON_FILE).exists():
        raise FormatError(path, PERSON_FILE, "missing")
    return read_document(folder / PERSON_FILE, PersonDocument)


def archives(study: Path) -> list[Path]:
    """Return the archives in a study, sorted; not what a system puts beside its files, ``._*``."""
    return sorted(path for path in study.glob("*.zip") if not path.name.startswith("."))


def read_person(path: Path, folder: Path) -> PersonDocument | None:
    """Return a person's record; None, with a warning, where a file is of no person.

    Args:
        path: An archive, or a record itself.
        folder: Where an archive is unpacked.
    """
    try:
        is_packed = path.suffix == ".zip"
        return unpack(path, folder) if is_packed else read_document(path, PersonDocument)
    except (FormatError, FileError) as error:
        warn(f"{path} is left out, as if it were not there: {error}")
        return None


def result_of(tree: str, policy: Any, played: Any) -> TreeResult:
    """Return the result of a tree in the episodes that judged it."""
    known = played.successes
    return TreeResult(
        tree=tree,
        leaves=policy.n_leaves,
        episodes=played.episodes,
        successes=None if known is None else int(known.sum()),
        mean_return=played.mean_return,
    )
