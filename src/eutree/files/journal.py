"""A journal: a file that grows by checked records and loses at most the last one.

The file starts with eight magic bytes. Each record is its length and its CRC-32 (two
little-endian 32-bit numbers) and then its bytes; the first record is a JSON document, the header.
Every record goes to the operating system in one call, so that the death of the process costs at
most the record in flight. Every ``SYNC_EVERY`` records, and when the journal is closed, the file
is flushed to the disk, so that a power cut costs at most that many records. A reader stops at the
first record that is incomplete or damaged. The writer holds a lock on the file, by which others
see that it is alive.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from eutree.errors import FileError, FormatError
from eutree.files import atomic
from eutree.files.documents import Document, decode_document, encode_document

MAGIC = b"EUTREEJ1"
SYNC_EVERY = 32
MAX_JOURNAL = 32 * 2**20
MAX_RECORD = 2**20

_PREFIX = struct.Struct("<II")
_Document = TypeVar("_Document", bound=Document)


class Journal:
    """An open journal; only the process that made it writes to it.

    Args:
        path: The file; it must not exist yet.
        header: The first record.

    Raises:
        FileError: The file exists or cannot be written.
    """

    def __init__(self, path: str | Path, header: Document) -> None:
        self.path = Path(path)
        self._unsynced = 0
        content = MAGIC + _record(encode_document(header))
        with atomic.reported("write", path):
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
            self._descriptor = os.open(path, flags, 0o666)
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

    def append(self, payload: bytes) -> None:
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

    def close(self) -> None:
        """Flush to the disk and close; closing twice does nothing."""
        if self._descriptor < 0:
            return
        descriptor, self._descriptor = self._descriptor, -1
        with atomic.reported("write", self.path):
            try:
                atomic.sync(descriptor)
            finally:
                os.close(descriptor)


def read_journal(
    path: str | Path, kind: type[_Document]
) -> tuple[_Document | None, Iterator[bytes]]:
    """Return the header (None if the writer died before it was complete) and the whole records.

    Raises:
        FormatError: The file is no journal, or its header is damaged.
        FileError: The file is missing or cannot be read.
    """
    data = atomic.read_bytes(path, limit=MAX_JOURNAL)
    if data[: len(MAGIC)] != MAGIC[: len(data)]:
        raise FormatError(path, "byte 0", f"not a journal: must begin with {MAGIC.decode()}")
    records = _records(data)
    header = next(records, None)
    return None if header is None else decode_document(header, kind, path), records


def _record(payload: bytes) -> bytes:
    return _PREFIX.pack(len(payload), zlib.crc32(payload)) + payload


def _records(data: bytes) -> Iterator[bytes]:
    """Yield the payloads up to the first record that is incomplete or damaged."""
    place = len(MAGIC)
    while place + _PREFIX.size <= len(data):
        length, checksum = _PREFIX.unpack_from(data, place)
        payload = data[place + _PREFIX.size : place + _PREFIX.size + min(length, MAX_RECORD)]
        if len(payload) != length or zlib.crc32(payload) != checksum:
            return
        yield payload
        place += _PREFIX.size + length
