"""What goes over the socket: JSON messages both ways, and pictures as JPEG behind a header.

A ``Viewer`` is one open page: what it has been sent, what it has drawn, what still waits for it.
"""

import asyncio
import io
import struct
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eutree.errors import InvalidArgumentError, MissingExtraError, UnknownNameError
from eutree.recording.browser.gate import RateLimit
from eutree.recording.events import Command, Number, Seen, View
from eutree.recording.keys import check_key
from eutree.recording.session import Session

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

MAX_MESSAGE = 2048  # bytes
# Commands whose value is a place in a list.
_INDEXED = ("bind", "keep", "drop", "choose", "cut", "flip", "again")

HEADER = struct.Struct(">III")  # picture's number, last key's sequence number, size in bytes
JPEG_QUALITY = 80


class Hello(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="hello"):
    """The first message: which page this is, the same after a reload."""

    client: str


class Key(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="key"):
    """A key went down or up, over the picture ``frame``."""

    sequence: Number
    key: str
    down: bool
    frame: Number


class Gone(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="gone"):
    """The page was hidden or lost the focus."""


class Tell(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="tell"):
    """Something was said to the guide: a button of its own, or the answer to a question."""

    name: str
    place: Number = 0
    text: str = ""


class Take(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="take"):
    """A page that watches wants to be the one that acts."""


Message = Hello | Key | Seen | Gone | Command | Tell | Take

_decoder: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)
_encoder = msgspec.json.Encoder()


def decode(text: str | bytes) -> Message:
    """Return the message, or raise InvalidArgumentError."""
    if isinstance(text, bytes):
        raise InvalidArgumentError("a message must be text")
    try:
        message = _decoder.decode(text)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise InvalidArgumentError(f"malformed message: {error}") from None
    if isinstance(message, Key):
        check_key(message.key)
    if isinstance(message, Hello) and not 8 <= len(message.client) <= 64:
        raise InvalidArgumentError("client must have 8 to 64 characters")
    if isinstance(message, Command) and message.name not in Session.COMMANDS:
        raise UnknownNameError("command", message.name, Session.COMMANDS)
    if isinstance(message, Command) and message.name in _INDEXED and not _is_index(message.value):
        raise InvalidArgumentError(
            f"{message.name} must have a whole number of at least 0, got {message.value!r}"
        )
    return message


def _is_index(value: float | bool | None) -> bool:
    if value is None or isinstance(value, bool):
        return False
    return 0 <= value < 2**32 and value == int(value)


def view_fields(view: View) -> dict[str, Any]:
    """Return the view as JSON's types, so that fields can be compared and sent singly."""
    fields: dict[str, Any] = msgspec.to_builtins(view)
    return fields


def encode(fields: dict[str, Any]) -> str:
    """Return a message for the page."""
    return _encoder.encode(fields).decode()


def encode_picture(number: int, sequence: int, pixels: NDArray[np.uint8]) -> bytes:
    """Return a picture's message: its header and the JPEG."""
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("pillow", "record") from None
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=JPEG_QUALITY)
    jpeg = buffer.getvalue()
    return HEADER.pack(number, sequence, len(jpeg)) + jpeg


MAX_IN_FLIGHT = 3  # pictures sent and not yet drawn; beyond that only the newest waits


class Viewer:
    """A page at the other end of a socket.

    Only the newest view and the newest picture wait to be sent, so a slow connection shows fewer
    pictures, never old ones.

    Args:
        connection: The socket.
        client: The page's own name, the same after a reload.
    """

    def __init__(self, connection: "ServerConnection", client: str) -> None:
        self.connection = connection
        self.client = client
        self.sequence = 0  # of the last key
        self.limit = RateLimit()
        self._sent: dict[str, Any] = {}
        self._wanted: dict[str, Any] = {}
        self._picture: tuple[int, bytes] | None = None
        self._in_flight: list[int] = []
        self._changed = asyncio.Event()

    def show(self, fields: dict[str, Any]) -> None:
        """Let the page know these fields of its view, if they are new to it."""
        self._wanted |= fields
        self._changed.set()

    def picture(self, number: int, message: bytes) -> None:
        """Let the page draw a picture."""
        self._picture = (number, message)
        self._changed.set()

    def drawn(self, number: int) -> None:
        """Take note that the page has drawn this picture (and skipped those before)."""
        self._in_flight = [sent for sent in self._in_flight if sent > number]
        self._changed.set()

    async def send_all(self) -> None:
        """Send what waits, until the socket closes."""
        from websockets.exceptions import ConnectionClosed

        try:
            while True:
                await self._changed.wait()
                self._changed.clear()
                await self.flush()
        except ConnectionClosed:
            return

    async def flush(self) -> None:
        """Send the fields that changed, and the newest picture if the page keeps up."""
        changed = {k: v for k, v in self._wanted.items() if self._sent.get(k, ...) != v}
        if changed:
            self._sent |= changed
            await self.connection.send(encode(changed))
        if self._picture is not None and len(self._in_flight) < MAX_IN_FLIGHT:
            (number, message), self._picture = self._picture, None
            self._in_flight.append(number)
            await self.connection.send(message)
