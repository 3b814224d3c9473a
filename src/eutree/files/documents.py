"""Versioned JSON documents: written deterministically, read with suspicion.

A document is a JSON object whose first keys are its header::

    {"format": "eutree/policy", "version": 2, "made_by": "eutree 0.2.0", ...}

Writing is deterministic: fixed order of keys, floats in their shortest form that reads back to the
same bits, one line for each key and for each item of a list of objects. NaN and infinity have no
place in JSON and are refused; a document that needs one says so by a type that allows null. Reading
refuses every document that is not exactly of its declared type.
"""

import json
import math
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import msgspec

from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import atomic
from eutree.version import __version__

MAX_DEPTH = 50  # of nested lists and objects; interpreters differ in the depth they can take
MAX_DOCUMENT = 16 * 2**20  # bytes; Python objects take up to 25 times the room of their text

_LENGTH, _DOUBLE = struct.Struct("<I"), struct.Struct("<d")
_TEXT = re.compile(rb'"(?:[^"\\]|\\.)*"')
_BRACKET = re.compile(rb"[\[\]{}]")
_HEADER = ("format", "version", "made_by")
_PLACE = re.compile(r"(?P<reason>.*) - at `\$\.?(?P<place>.*)`", re.DOTALL)
_BYTE = re.compile(r"(?P<reason>.*) \((?P<place>byte \d+)\)", re.DOTALL)


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of all documents: subclasses add fields and set ``FORMAT`` and ``VERSION``.

    ``VERSION`` counts up whenever a file of the old kind could not be read by the new code
    without a thought, or the other way round. The fields below are filled in on writing.
    """

    FORMAT: ClassVar[str] = ""
    VERSION: ClassVar[int] = 1

    format: str = ""
    version: int = 0
    made_by: str = ""


_Plain = TypeVar("_Plain", bound=msgspec.Struct)


class _Header(msgspec.Struct):
    """The header of every document of every version."""

    format: str
    version: int
    made_by: str


def write_document(path: str | Path, document: Document) -> None:
    """Write the document to a file, atomically.

    Raises:
        InvalidArgumentError: It holds NaN, an infinity, or something that JSON cannot hold, or is
            too large to be read again.
        FileError: The file cannot be written.
    """
    atomic.write_bytes(path, encode_document(document))


def read_document(path: str | Path, kind: type[_Plain], *, limit: int = MAX_DOCUMENT) -> _Plain:
    """Read a document of the given kind from a file of at most ``limit`` bytes.

    A kind that is no ``Document`` has no header: people write such files.

    Raises:
        FormatError: The file is no such document.
        FileError: The file is missing or cannot be read.
    """
    return decode_document(atomic.read_bytes(path, limit=limit), kind, path)


def encode_document(document: Document) -> bytes:
    """Return the document as deterministic JSON text, ending in a newline."""
    kind = type(document)
    try:
        content: dict[str, Any] = msgspec.to_builtins(document)
    except (TypeError, ValueError, RecursionError) as error:
        raise InvalidArgumentError(f"{kind.FORMAT}: cannot be written as JSON: {error}") from None
    header = (kind.FORMAT, kind.VERSION, f"eutree {__version__}")
    content = dict(zip(_HEADER, header, strict=True)) | {
        key: value for key, value in content.items() if key not in _HEADER
    }
    if "checksum" in kind.__struct_fields__:
        content["checksum"] = checksum_of(content)
    for place, number in _floats(content, ""):
        if not math.isfinite(number):
            raise InvalidArgumentError(f"{kind.FORMAT}: {place} must be finite, got {number}")
    lines = (_compact(key, kind) + ": " + _value(value, kind) for key, value in content.items())
    data = ("{\n " + ",\n ".join(lines) + "\n}\n").encode()
    if len(data) > MAX_DOCUMENT:  # never write a document that could not be read
        raise InvalidArgumentError(
            f"{kind.FORMAT}: {len(data):,} bytes are more than the {MAX_DOCUMENT:,} allowed"
        )
    return data


def checksum_of(content: Mapping[str, Any] | Document) -> str:
    """Return the checksum of a document, or of its content: CRC-32, eight hexadecimal digits.

    It is over the values of the content and not over their spelling, so that a page can make the
    same one in JavaScript: a number counts as a double, however it is written, and the keys of an
    object in the order of their UTF-16. Left out are the checksum itself and who wrote the file. It
    tells damage and edits by hand; it is no signature, because anybody can make it again.
    """
    items = content if isinstance(content, Mapping) else _written(content)
    sealed = {key: value for key, value in items.items() if key not in ("checksum", "made_by")}
    checksum = 0
    for part in _spelled(sealed):
        checksum = zlib.crc32(part, checksum)
    return f"{checksum:08x}"


def _written(value: msgspec.Struct) -> dict[str, Any]:
    """Return the fields that are written of a document or of a part of one; nothing is copied."""
    fields = {field.name: field.default for field in msgspec.structs.fields(value)}
    skips = value.__struct_config__.omit_defaults
    found = {name: getattr(value, name) for name in fields}
    return {
        k: v
        for k, v in found.items()
        if not (skips and type(v) is type(fields[k]) and v == fields[k])
    }


def _spelled(value: Any) -> Iterator[bytes]:
    """Yield the bytes that a checksum is over."""
    if isinstance(value, str):
        text = value.encode("utf-8", "replace")
        yield b"s" + _LENGTH.pack(len(text)) + text
    elif value is None or isinstance(value, bool):
        yield b"n" if value is None else b"t" if value else b"f"
    elif isinstance(value, int | float):
        try:
            yield b"#" + _DOUBLE.pack(value + 0.0)  # -0.0 becomes 0.0: JavaScript writes both as 0
        except OverflowError:
            yield b"#" + _DOUBLE.pack(math.copysign(math.inf, value))
    elif isinstance(value, Mapping | msgspec.Struct):
        value = value if isinstance(value, Mapping) else _written(value)
        yield b"{"
        for key in sorted(value, key=lambda key: key.encode("utf-16-be", "replace")):
            yield from _spelled(key)
            yield from _spelled(value[key])
        yield b"}"
    else:
        yield b"["
        for item in value:
            yield from _spelled(item)
        yield b"]"


def decode_document(data: bytes, kind: type[_Plain], path: str | Path) -> _Plain:
    """Return the document in the bytes, or blame the place where they hold none."""
    try:
        if issubclass(kind, Document):
            _check_header(msgspec.json.decode(data, type=_Header), kind, path)
        document = msgspec.json.decode(data, type=kind)
        json.loads(data, object_pairs_hook=_refuse_duplicates)
        _check_depth(data)
    except FormatError:
        raise
    except RecursionError:
        raise FormatError(path, "", "nested too deeply") from None
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "not UTF-8 text") from None
    except _DuplicateKeyError as error:
        raise FormatError(path, str(error), "the key stands twice in one object") from None
    except msgspec.MsgspecError as error:
        if issubclass(kind, Document) and b'"format"' not in data:
            name = kind.FORMAT.rpartition("/")[2]
            raise FormatError(path, "", f"is not a {name} file: {error}") from None
        match = _PLACE.fullmatch(str(error)) or _BYTE.fullmatch(str(error))
        place, reason = (match["place"], match["reason"]) if match else ("", str(error))
        raise FormatError(path, place, reason.removeprefix("JSON is malformed: ")) from None
    except ValueError as error:  # for example an integer of more than 4300 digits
        raise FormatError(path, "", f"not JSON: {error}") from None
    return document


def _check_depth(data: bytes) -> None:
    """Raise RecursionError if valid JSON is nested deeper than any document of ours."""
    depth = 0
    for bracket in _BRACKET.findall(_TEXT.sub(b"", data)):
        depth += 1 if bracket in b"[{" else -1
        if depth > MAX_DEPTH:
            raise RecursionError


class _DuplicateKeyError(Exception):
    pass


def _refuse_duplicates(pairs: list[tuple[str, Any]]) -> None:
    """Refuse an object with a key twice; keep nothing, to save memory."""
    seen = set()
    for key, _ in pairs:
        if key in seen:
            raise _DuplicateKeyError(key)
        seen.add(key)


def _check_header(header: _Header, kind: type[Document], path: str | Path) -> None:
    if header.format != kind.FORMAT:
        raise FormatError(path, "format", f"expected {kind.FORMAT!r}, got {header.format!r}")
    if header.version > kind.VERSION:
        raise FormatError(
            path,
            "version",
            f"made by {header.made_by} as version {header.version} of {kind.FORMAT}; this is "
            f"eutree {__version__}, which reads versions up to {kind.VERSION}; "
            "install a newer eutree",
        )
    if header.version < 1:
        raise FormatError(path, "version", f"must be at least 1, got {header.version}")


def _floats(value: Any, place: str) -> Iterator[tuple[str, float]]:
    """Yield every float inside nested lists and dicts, with its place."""
    if isinstance(value, float):
        yield place, value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _floats(item, f"{place}.{key}" if place else str(key))
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from _floats(item, f"{place}[{index}]")


def _value(value: Any, kind: type[Document]) -> str:
    """Return JSON text: a list of objects with one line for each, anything else on one line."""
    if isinstance(value, list | tuple) and value and all(isinstance(v, dict) for v in value):
        return "[\n  " + ",\n  ".join(_compact(item, kind) for item in value) + "\n ]"
    return _compact(value, kind)


def _compact(value: Any, kind: type[Document]) -> str:
    try:
        return msgspec.json.encode(value).decode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InvalidArgumentError(f"{kind.FORMAT}: cannot be written as JSON: {error}") from None
