"""The messages on the socket: JSON both ways, and pictures as JPEG behind a header.

A ``Viewer`` is one open page: the fields sent to it, the pictures drawn, the messages that wait.
"""

import asyncio
import hmac
import io
import ipaddress
import re
import secrets
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from importlib import resources
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eutree.errors import InvalidArgumentError, UnknownNameError, needed
from eutree.recording.events import Command, Number, Seen
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
    if isinstance(message, Command) and message.name in _INDEXED:
        value = message.value
        known = value is not None and not isinstance(value, bool) and 0 <= value < 2**32
        if not known or value != int(value or 0):
            raise InvalidArgumentError(
                f"{message.name} must have a whole number of at least 0, got {value!r}"
            )
    return message


def encode_picture(number: int, sequence: int, pixels: NDArray[np.uint8]) -> bytes:
    """Return a picture's message: its header and the JPEG."""
    with needed("pillow", "record"):
        from PIL import Image
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=JPEG_QUALITY)
    jpeg = buffer.getvalue()
    return HEADER.pack(number, sequence, len(jpeg)) + jpeg


MAX_IN_FLIGHT = 3  # pictures sent and not yet drawn; beyond that only the newest waits


class Viewer:
    """A page at the other end of a socket.

    Only the newest view and the newest picture wait to be sent, so a slow connection shows fewer
    pictures, never old ones.
    """

    def __init__(self, connection: "ServerConnection", client: str) -> None:
        self.connection = connection
        self.client = client  # the page's own name, the same after a reload
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
        """Send the waiting messages, until the socket closes."""
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
            await self.connection.send(_encoder.encode(changed).decode())
        if self._picture is not None and len(self._in_flight) < MAX_IN_FLIGHT:
            (number, message), self._picture = self._picture, None
            self._in_flight.append(number)
            await self.connection.send(message)


LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
PROTOCOL = "eutree"
SOCKET_PATH = "/socket"

_OFFER = "token."
_AUTHORITY = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]{1,253})(:\d{1,5})?")
_WILDCARDS = ("0.0.0.0", "::")  # noqa: S104 - compared with, not bound to


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a server bound to ``host``."""
    return f"[{host}]" in LOOPBACK or host in LOOPBACK


@dataclass(frozen=True)
class Gate:
    """The checks of one server.

    Attributes:
        token: The secret that the socket must offer.
        host: Address that the server is bound to.
    """

    token: str = field(repr=False)
    host: str = "127.0.0.1"

    def refusal(
        self, path: str, hosts: Sequence[str], origins: Sequence[str], protocols: Sequence[str]
    ) -> HTTPStatus | None:
        """Return the status of a refused request, or None.

        Args:
            path: The path of the address, without its query.
            hosts: Its Host headers; there must be exactly one.
            origins: Its Origin headers; a socket needs exactly one.
            protocols: Its Sec-WebSocket-Protocol headers.
        """
        if len(hosts) != 1 or not self.knows(hosts[0]):
            return HTTPStatus.MISDIRECTED_REQUEST
        allowed = {f"http://{hosts[0]}", f"https://{hosts[0]}"}
        if any(origin not in allowed for origin in origins):
            return HTTPStatus.FORBIDDEN
        if path == SOCKET_PATH and (len(origins) != 1 or not self._has_token(protocols)):
            return HTTPStatus.FORBIDDEN
        return None

    def knows(self, host: str) -> bool:
        """Return whether a Host header names this server."""
        match = _AUTHORITY.fullmatch(host)
        if match is None:
            return False
        name = match[1].lower()
        if name in LOOPBACK or name in (self.host.lower(), f"[{self.host.lower()}]"):
            return True
        return self.host in _WILDCARDS and _is_address(name)

    def _has_token(self, protocols: Sequence[str]) -> bool:
        offered = [part.strip() for header in protocols for part in header.split(",")]
        tokens = [part for part in offered if part.startswith(_OFFER)]
        given = tokens[0].removeprefix(_OFFER) if len(tokens) == 1 else ""
        return hmac.compare_digest(given.encode(), self.token.encode())


def _is_address(name: str) -> bool:
    """Return whether a host is a literal address, which nobody can rebind."""
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


class RateLimit:
    """A bucket of messages that fills at a steady rate per second; a burst may come at once."""

    def __init__(self, rate: float = 250.0, burst: float = 500.0) -> None:
        self._rate, self._burst = rate, burst
        self._left, self._time = burst, 0.0

    def admits(self, now: float) -> bool:
        """Return whether one more message is within the limit."""
        self._left = min(self._burst, self._left + (now - self._time) * self._rate)
        self._time = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


_FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/study.js": ("study.js", "text/javascript; charset=utf-8"),
    "/hurts.js": ("hurts.js", "text/javascript; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
}
_NONCE = "NONCE"


def page(path: str, host: str) -> tuple[bytes, dict[str, str]] | None:
    """Return content and headers of a file of the page; None if there is no such file.

    Args:
        path: The path that was requested.
        host: The request's Host, already checked; the page may open a socket to it.
    """
    if path not in _FILES:
        return None
    name, content_type = _FILES[path]
    nonce = secrets.token_urlsafe(16)
    text = (resources.files(__package__) / name).read_text(encoding="utf-8")
    content = text.replace(_NONCE, nonce).encode() if name.endswith(".html") else text.encode()
    return content, {"Content-Type": content_type, **safe_headers(nonce, host)}


def safe_headers(nonce: str, host: str) -> dict[str, str]:
    """Return the headers that keep everything else out."""
    policy = (
        "default-src 'none'",
        f"script-src 'nonce-{nonce}'",
        f"style-src 'nonce-{nonce}'",
        f"connect-src 'self' ws://{host} wss://{host}",
        "img-src data:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
    return {
        "Content-Security-Policy": "; ".join(policy),
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
    }
