"""One open page: what it has been sent, what it has drawn, what still waits for it."""

import asyncio
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from eutree.recording.browser.gate import RateLimit
from eutree.recording.browser.wire import encode

MAX_IN_FLIGHT = 3  # pictures sent and not yet drawn; beyond that only the newest waits


class Viewer:
    """A page at the other end of a socket.

    Only the newest view and the newest picture wait to be sent, so a slow connection shows fewer
    pictures, never old ones.

    Args:
        connection: The socket.
        client: The page's own name, the same after a reload.
    """

    def __init__(self, connection: ServerConnection, client: str) -> None:
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
