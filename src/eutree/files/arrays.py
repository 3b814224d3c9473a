"""Archives: arrays in NumPy's npz form, with a checked document beside them, and no pickle.

An archive is a zip file of uncompressed ``name.npy`` members, which ``numpy.load`` reads too, and
one member ``document.json`` (see ``documents``). Its bytes depend on the content alone: members
in sorted order, fixed time stamps, no compressor whose version could matter.

Reading trusts nothing: number of members, declared sizes, element types and shapes are compared
with the caps below and with the bytes that are really there before any array is made.
"""

import math
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from eutree.errors import FileError, FormatError, InvalidArgumentError
from eutree.files import atomic
from eutree.files.documents import MAX_DOCUMENT, Document, decode_document, encode_document

MAX_ARCHIVE = 128 * 2**20  # bytes, of the file and of all its arrays together
MAX_MEMBERS = 64
MAX_DIMENSIONS = 4

ELEMENT_TYPES = frozenset(
    {"<f8", "<f4", "<i8", "<i4", "<i2", "|i1", "<u8", "<u4", "<u2", "|u1", "|b1"}
)

_DOCUMENT_MEMBER = "document.json"
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
_MAX_HEADER = 1024
_HEADER = re.compile(
    r"\{'descr': '(?P<type>[^']{1,16})', 'fortran_order': (?P<fortran>True|False), "
    r"'shape': \((?P<shape>(?:\d{1,15}, ?)*(?:\d{1,15})?)\), \} *\n?"
)
_ZIP_ERRORS = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, LookupError, OverflowError,
    RuntimeError, ValueError, OSError,
)  # fmt: skip

_Document = TypeVar("_Document", bound=Document)
Array = NDArray[Any]


def write_archive(
    path: str | Path, document: Document, arrays: Mapping[str, Array], *, limit: int = MAX_ARCHIVE
) -> None:
    """Write document and arrays to one file, atomically; equal content gives equal bytes.

    Raises:
        FileError: It cannot be written, or would be larger than ``limit``.
    """
    data = encode_archive(arrays, document)
    if len(data) > limit:  # never write a file that could not be read
        raise FileError("write", path, f"{len(data):,} bytes are more than the {limit:,} allowed")
    atomic.write_bytes(path, data)


def write_arrays(path: str | Path, arrays: Mapping[str, Array]) -> None:
    """Write an npz file without a document, atomically; equal content gives equal bytes."""
    atomic.write_bytes(path, encode_archive(arrays))


def read_archive(
    path: str | Path, kind: type[_Document], *, limit: int = MAX_ARCHIVE
) -> tuple[_Document, dict[str, Array]]:
    """Read an archive of ``write_archive``; the arrays are read-only.

    Raises:
        FormatError: The file is no such archive, or exceeds a cap.
        FileError: The file is missing or cannot be read.
    """
    return decode_archive(atomic.read_bytes(path, limit=limit), kind, path, limit=limit)


def read_arrays(path: str | Path, *, only: Collection[str] | None = None) -> dict[str, Array]:
    """Read the arrays of an npz file from anywhere, without pickle; see ``read_archive``.

    Members of other names than ``only`` has are not even looked at.
    """
    limit = MAX_ARCHIVE  # of the file, and of all its arrays together
    data = atomic.read_bytes(path, limit=limit)
    with _as_format_errors(path), zipfile.ZipFile(BytesIO(data)) as archive:
        arrays, size = {}, 0
        for name, info in _members(archive, path, only, limit).items():
            if name != _DOCUMENT_MEMBER:
                arrays[name] = _decode_array(_content(archive, info, path), info.filename, path)
                size += 8 * arrays[name].size  # its bytes as float64 or int64
            if size > limit:
                raise FormatError(path, "", f"too large: more than {limit // 8:,} elements")
        return arrays


def encode_archive(arrays: Mapping[str, Array], document: Document | None = None) -> bytes:
    """Return the bytes of an archive."""
    members = {f"{name}.npy": _encode_array(name, array) for name, array in arrays.items()}
    if document is not None:
        members[_DOCUMENT_MEMBER] = encode_document(document)
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for name in sorted(members):
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.create_system, info.external_attr = 3, (stat.S_IFREG | 0o644) << 16
            archive.writestr(info, members[name])
    return buffer.getvalue()


def decode_archive(
    data: bytes, kind: type[_Document], path: str | Path, *, limit: int = MAX_ARCHIVE
) -> tuple[_Document, dict[str, Array]]:
    """Return the parts that ``encode_archive`` put in; ``path`` is for the messages."""
    with _as_format_errors(path), zipfile.ZipFile(BytesIO(data)) as archive:
        members = _members(archive, path, None, limit)
        for info in members.values():
            # Ours are never compressed: so no file unpacks to more than its own size.
            if info.compress_type != zipfile.ZIP_STORED:
                raise FormatError(path, info.filename, "must not be compressed")
        if _DOCUMENT_MEMBER not in members:
            raise FormatError(path, _DOCUMENT_MEMBER, "missing")
        info = members.pop(_DOCUMENT_MEMBER)
        if info.file_size > MAX_DOCUMENT:
            raise FormatError(path, _DOCUMENT_MEMBER, f"too large: {info.file_size:,} bytes")
        return decode_document(_content(archive, info, path), kind, path), {
            name: _decode_array(_content(archive, info, path), info.filename, path)
            for name, info in members.items()
        }


@contextmanager
def _as_format_errors(path: str | Path) -> Iterator[None]:
    """Turn all that zipfile raises on bad bytes into a FormatError."""
    try:
        yield
    except FormatError:
        raise
    except _ZIP_ERRORS as error:
        raise FormatError(path, "", f"not a readable archive: {error}") from None


def _members(
    archive: zipfile.ZipFile, path: str | Path, only: Collection[str] | None, limit: int
) -> dict[str, zipfile.ZipInfo]:
    """Return the wanted members by name of their array, all caps checked."""
    members: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        name = info.filename.removesuffix(".npy")
        if only is not None and name not in only:
            continue
        if info.filename != _DOCUMENT_MEMBER and not (
            info.filename.endswith(".npy") and _NAME.fullmatch(name)
        ):
            raise FormatError(path, info.filename[:80], "unexpected member")
        if name in members:
            raise FormatError(path, info.filename, "the member stands twice in the archive")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise FormatError(path, info.filename, "unexpected kind of compression")
        members[name] = info
        if len(members) > MAX_MEMBERS:
            raise FormatError(path, "", f"more than {MAX_MEMBERS} members")
    total = sum(info.file_size for info in members.values())
    if total > limit:
        raise FormatError(path, "", f"too large: unpacks to {total:,} bytes, more than {limit:,}")
    return members


def _content(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: str | Path) -> bytes:
    with archive.open(info) as member:
        content = member.read(info.file_size)
        if len(content) != info.file_size or member.read(1):
            raise FormatError(
                path, info.filename, f"declares {info.file_size} bytes but holds {len(content)}"
            )
    return content


def _encode_array(name: str, array: Array) -> bytes:
    """Return the array in npy form, version 1.0."""
    array = np.asarray(array)
    order = array.dtype.newbyteorder("<").str
    if not _NAME.fullmatch(name) or order not in ELEMENT_TYPES or array.ndim > MAX_DIMENSIONS:
        raise InvalidArgumentError(
            f"array {name!r} must have a plain name, at most {MAX_DIMENSIONS} dimensions and an "
            f"element type among {', '.join(sorted(ELEMENT_TYPES))}; "
            f"got {array.dtype} and shape {array.shape}"
        )
    header = f"{{'descr': '{order}', 'fortran_order': False, 'shape': {array.shape}, }}"
    header += " " * (-(10 + len(header) + 1) % 64) + "\n"
    prefix = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode("ascii")
    return prefix + array.astype(order, order="C", copy=False).tobytes()


def _decode_array(data: bytes, member: str, path: str | Path) -> Array:
    """Return the array of an npy member; no byte of it is ever executed or unpickled."""
    if data[:6] != b"\x93NUMPY" or len(data) < 12 or data[6] not in (1, 2, 3):
        raise FormatError(path, member, "not an array in npy form")
    prefix, length = (10, "<H") if data[6] == 1 else (12, "<I")
    (size,) = struct.unpack(length, data[8:prefix])
    text = data[prefix : prefix + min(size, _MAX_HEADER)].decode("latin-1")
    match = _HEADER.fullmatch(text) if size <= _MAX_HEADER else None
    if match is None:
        raise FormatError(path, member, "its npy header is not a plain one")
    if match["type"] not in ELEMENT_TYPES:
        raise FormatError(path, member, f"element type {match['type']!r} is not allowed")
    shape = tuple(int(part) for part in match["shape"].split(",") if part.strip())
    dtype, start = np.dtype(match["type"]), prefix + size
    if len(shape) > MAX_DIMENSIONS or any(side > 2**40 for side in shape):
        raise FormatError(path, member, f"shape {shape} is not allowed")
    if math.prod(shape) * dtype.itemsize != len(data) - start:
        raise FormatError(
            path, member, f"shape {shape} of {dtype} does not fit {len(data) - start} bytes"
        )
    if dtype == np.bool_ and data[start:].translate(None, b"\0\1"):
        raise FormatError(path, member, "a truth value is neither 0 nor 1")
    flat: Array = np.frombuffer(data, dtype=dtype, offset=start)
    if not flat.flags.aligned:
        flat = flat.copy()
        flat.setflags(write=False)
    return flat.reshape(shape, order="F" if match["fortran"] == "True" else "C")
