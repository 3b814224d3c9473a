"""The journal of a running episode: the steps before a crash become an episode all the same."""

import math
import os
import struct
import zlib
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.data.episode import ALLOWED, INTERRUPTED, Episode, masks_of
from eutree.errors import FileError, FormatError, InvalidArgumentError, blamed
from eutree.files import Document, atomic
from eutree.files.documents import decode_document, encode_document
from eutree.files.schema_document import Index, plain_json
from eutree.validation import check_vector

# The file starts with eight magic bytes. Each record is its length and its CRC-32 (two
# little-endian 32-bit numbers) and then its bytes; the first record is a JSON document, the
# header. Every record goes to the operating system in one call, so that the death of the process
# costs at most the record in flight. Every ``SYNC_EVERY`` records, and when the journal is
# closed, the file is flushed to the disk, so that a power cut costs at most that many records. A
# reader stops at the first record that is incomplete or damaged. The writer holds a lock on the
# file, by which others see that it is alive.


MAGIC = b"EUTREEJ1"
SYNC_EVERY = 32
MAX_JOURNAL = 32 * 2**20
MAX_RECORD = 2**20

_PREFIX = struct.Struct("<II")


def _record(payload: bytes) -> bytes:
    return _PREFIX.pack(len(payload), zlib.crc32(payload)) + payload


def _records(data: bytes) -> Iterator[bytes]:
    """Yield the payloads up to the first record that is incomplete or damaged."""
    place = len(MAGIC)
    while place + _PREFIX.size <= len(data):
        length, checksum = _PREFIX.unpack_from(data, place)
        payload = data[place + _PREFIX.size : place + _PREFIX.size + min(length, MAX_RECORD)]
        # A power cut leaves zeros: of no bytes, with the checksum of none.
        if not length or len(payload) != length or zlib.crc32(payload) != checksum:
            return
        yield payload
        place += _PREFIX.size + length


MAX_STEP_VALUES = 16

StepValue = bool | int | float | list[bool | int | float]


class JournalDocument(Document, frozen=True, kw_only=True):
    """The header of a journal: the facts known at reset, and the writer's process."""

    FORMAT: ClassVar[str] = "eutree/journal"
    VERSION: ClassVar[int] = 1

    pid: int
    seed: int | None
    observation: list[float]
    extras: dict[str, Any]


class _Step(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """One record: an action, the answer to it, and further measurements."""

    action: Index
    reward: float
    observation: list[float]
    terminated: bool
    truncated: bool
    steps: dict[str, StepValue]


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(_Step)


class EpisodeJournal:
    """Keeps the episode that is being recorded safe, step by step.

    A step is safe from the death of the process when ``append`` returns, and from a power cut
    after at most 32 further steps (see ``eutree.data.journal``). The file must not exist yet. It
    begins with the values sensed after reset, shape [d].

    Raises:
        FileError: The file exists or cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        observation: ArrayLike,
        *,
        seed: int | None = None,
        extras: dict[str, Any] | None = None,
    ) -> None:
        first = check_vector("observation", observation)
        header = JournalDocument(
            pid=os.getpid(),
            seed=seed,
            observation=first.tolist(),
            extras=plain_json(extras or {}, "extras"),
        )
        self.path = Path(path)
        self._n_features, self._unsynced = first.size, 0
        content = MAGIC + _record(encode_document(header))
        with atomic.reported("write", path):
            self._descriptor = atomic.opened_new(path)
            try:
                atomic.lock(self._descriptor)
                atomic.write_all(self._descriptor, content)
                atomic.sync(self._descriptor)
                atomic.sync_folder(self.path.parent)
            except BaseException:
                os.close(self._descriptor)
                self.path.unlink(missing_ok=True)
                raise
        self._size = len(content)

    def append(
        self,
        action: int,
        reward: float,
        observation: ArrayLike,
        *,
        terminated: bool = False,
        truncated: bool = False,
        steps: dict[str, StepValue] | None = None,
    ) -> None:
        """Add one step: the action, and the environment's answer to it, in finite numbers.

        ``steps`` has one value (or one list of them) for each array in ``Episode.steps``.
        """
        sensed = check_vector("observation", observation, size=self._n_features)
        if steps is not None and len(steps) > MAX_STEP_VALUES:
            raise InvalidArgumentError(f"steps must be at most {MAX_STEP_VALUES}, got {len(steps)}")
        if not math.isfinite(reward):
            raise InvalidArgumentError(f"reward must be finite, got {reward!r}")
        answer = float(reward), sensed.tolist(), bool(terminated), bool(truncated)
        self._write(_encoder.encode(_Step(int(action), *answer, steps or {})))

    def close(self) -> None:
        """Stop writing and leave the file, as a crash would; closing twice does nothing."""
        if self._descriptor < 0:
            return
        descriptor, self._descriptor = self._descriptor, -1
        with atomic.reported("write", self.path):
            try:
                atomic.sync(descriptor)
            finally:
                os.close(descriptor)

    def discard(self) -> None:
        """Stop writing and remove the file."""
        self.close()
        atomic.remove_file(self.path)

    def _write(self, payload: bytes) -> None:
        """Add a record; after an error the journal is as it was before."""
        record = _record(payload)
        if len(payload) > MAX_RECORD or self._size + len(record) > MAX_JOURNAL:
            raise FileError("write", self.path, f"it would exceed {MAX_JOURNAL:,} bytes")
        with atomic.reported("write", self.path):
            try:
                atomic.write_all(self._descriptor, record)
            except OSError:
                os.ftruncate(self._descriptor, self._size)
                raise
            self._size += len(record)
            self._unsynced += 1
            if self._unsynced >= SYNC_EVERY:
                self._unsynced = 0
                atomic.sync(self._descriptor)


def recover_episode(path: str | Path) -> Episode | None:
    """Return the episode in a journal, ending ``"interrupted"``; None if it has no step.

    Raises:
        FormatError: The file is no journal, or a record in it is malformed.
        FileError: The file is missing or cannot be read.
    """
    data = atomic.read_bytes(path, limit=MAX_JOURNAL)
    if not any(data):  # nothing, or zeros: a power cut came before the first flush
        return None
    if data[: len(MAGIC)] != MAGIC[: len(data)]:
        raise FormatError(path, "byte 0", f"not a journal: must begin with {MAGIC.decode()}")
    records = _records(data)
    first = next(records, None)
    if first is None:  # the writer died before its header was complete
        return None
    header = decode_document(first, JournalDocument, path)
    if header.seed is not None and header.seed < 0:
        raise FormatError(path, "seed", f"must be >= 0, got {header.seed}")
    steps = _Steps(header.observation)
    for record in records:
        wrong = (msgspec.MsgspecError, ValueError, RecursionError)
        with blamed(path, f"step {len(steps.actions)}", wrong):
            steps.add(_decoder.decode(record))
    if not steps.actions:
        return None
    with blamed(path, errors=(ValueError, TypeError, OverflowError)):
        return Episode(
            observations=np.array(steps.observations).reshape(-1, steps.size),
            actions=np.array(steps.actions, dtype=np.int64),
            rewards=np.array(steps.rewards),
            terminated=steps.terminated,
            truncated=steps.truncated,
            seed=header.seed,
            ending=INTERRUPTED,
            steps=steps.columns(),
            extras=header.extras,
        )


class _Steps:
    """The steps of a journal so far, as numbers and not as objects."""

    def __init__(self, first: list[float]) -> None:
        self.size = len(first)
        self.observations = array("d", first)
        self.actions = array("q")
        self.rewards = array("d")
        self.terminated = self.truncated = False
        self.values: dict[str, list[StepValue]] = {}
        self.masks: list[StepValue | None] = []  # None where all is allowed

    def add(self, step: _Step) -> None:
        """Add a step, or raise ValueError with its fault."""
        measured = dict(step.steps)
        self.masks.append(measured.pop(ALLOWED, None))
        if not self.actions:
            self.values = {name: [] for name in measured}
        if self.terminated or self.truncated:
            raise ValueError("the episode ended before this step")
        if len(step.observation) != self.size or not all(map(math.isfinite, step.observation)):
            raise ValueError(f"observation must hold {self.size} finite numbers")
        if not math.isfinite(step.reward):
            raise ValueError(f"reward must be finite, got {step.reward}")
        if measured.keys() != self.values.keys() or len(self.values) > MAX_STEP_VALUES:
            raise ValueError(f"must measure {sorted(self.values)}, at most {MAX_STEP_VALUES}")
        for name, value in measured.items():
            self.values[name].append(value)
        self.observations.extend(step.observation)
        self.actions.append(step.action)
        self.rewards.append(step.reward)
        self.terminated, self.truncated = step.terminated, step.truncated

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return what was measured at each step, by name."""
        found = {name: _column(name, self.values[name]) for name in sorted(self.values)}
        allowed = masks_of(self.masks)
        return found if allowed is None else {ALLOWED: allowed} | found


def _column(name: str, values: list[Any]) -> NDArray[Any]:
    array = np.array(values)
    if array.dtype.kind not in "bif" or array.ndim > 2:
        raise InvalidArgumentError(f"steps[{name!r}] must hold numbers or equal lists of them")
    return array
