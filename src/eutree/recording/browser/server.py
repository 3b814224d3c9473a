"""The server of the recorder's page: one loop in which a session, its clock and pages meet."""

import asyncio
import logging
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from weakref import WeakSet

import msgspec

from eutree.errors import EutreeError, InvalidArgumentError, needed
from eutree.recording.browser.wire import (
    MAX_MESSAGE,
    PROTOCOL,
    SOCKET_PATH,
    Gate,
    Gone,
    Hello,
    Key,
    Message,
    Take,
    Tell,
    Viewer,
    decode,
    encode_picture,
    is_loopback,
    page,
    safe_headers,
)
from eutree.recording.events import Away, Command, Event, KeyDown, KeyUp, Present, Seen
from eutree.recording.recorder import Recorder
from eutree.recording.scenes import Programme
from eutree.recording.tree_making import FAILED, FITTING, READY, Guide, TreeMaker, TreeView

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

PORT = 8765
PORTS_TO_TRY = 10
MAX_SOCKETS = 8
PING_SECONDS = 5.0
IDLE_SECONDS = 0.1  # between two ticks of a session that waits for nothing

# Of the loop, from accepting a connection to the handler that attends to it, and from aborting one
# to the end of its socket: each takes three.
TURNS = 6
STATUS_PATH = "/status"  # asked by a page whose socket was refused
FULL, FREE = "full", "ready"

UNOPENED = "No page is open."
LEFT = "The page was closed or the connection was lost."
HIDDEN = "The page was hidden or lost the focus."
TAKEN = "Another page has taken over."

# The head of a request holds the token: nothing of it may reach a log.
_silent = logging.Logger("eutree.recording.browser")
_silent.addHandler(logging.NullHandler())
_silent.setLevel(logging.CRITICAL + 1)


class PageServer:
    """Serves the recorder's page and plays its session.

    Args:
        recorder: The session and its folder.
        host: Address to bind to; anything but loopback can be reached from other machines.
        port: Port; None for 8765 or the next free one, 0 for any.
        details: Further facts for the page to show, such as the next commands.
        maker: Makes a tree of the recording, when the person wants it.
        guide: Leads the person; None where they lead themselves.
    """

    def __init__(
        self,
        recorder: Recorder,
        *,
        host: str = "127.0.0.1",
        port: int | None = None,
        details: dict[str, Any] | None = None,
        maker: TreeMaker | None = None,
        guide: Guide | None = None,
    ) -> None:
        self.recorder = recorder
        self.token = secrets.token_urlsafe(24)  # 192 random bits, which nobody guesses
        self.host = host
        self.port = PORT if port is None else port
        self._wish = port
        self._gate = Gate(self.token, host)
        self._details = dict(details or {})
        self._maker, self._guide = maker, guide
        self._is_closing = False
        self._viewers: list[Viewer] = []
        self._driver: Viewer | None = None
        self._events: list[Event] = []
        self._woken = asyncio.Event()
        self._sequence = 0
        self._fields: dict[str, Any] = {}
        self._picture: tuple[int, bytes] | None = None
        self._n_sockets = 0
        self._opened: WeakSet[ServerConnection] = WeakSet()

    @property
    def url(self) -> str:
        """The page's address, with the token in its fragment."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        if not is_loopback(self.host) and self.host in ("0.0.0.0", "::"):  # noqa: S104 - compared
            name = _own_address()
        return f"http://{name}:{self.port}/#{self.token}"

    async def run(self, on_ready: Callable[["PageServer"], None] | None = None) -> None:
        """Serve until the session is over.

        Args:
            on_ready: Called once the port is open.

        Raises:
            InvalidArgumentError: The port is taken, or the address is not this machine's.
        """
        server = await self._listen()
        self._add(Away(UNOPENED))
        try:
            if on_ready is not None:
                on_ready(self)
            await self._play()
            await self._say_goodbye()
        finally:
            self._is_closing = True
            await self._end(server)

    async def _listen(self) -> "Server":
        with needed("websockets", "record"):
            from websockets.asyncio.server import ServerConnection, serve

        def opened(*arguments: Any, **options: Any) -> ServerConnection:
            connection = ServerConnection(*arguments, **options)
            self._opened.add(connection)
            return connection

        attempts = range(PORT, PORT + PORTS_TO_TRY) if self._wish is None else [self._wish]
        for port in attempts:
            try:
                server = await serve(
                    self._attend,
                    self.host,
                    port,
                    create_connection=opened,  # type: ignore[arg-type]  # a class is not needed
                    process_request=self._answer,
                    subprotocols=[PROTOCOL],  # type: ignore[list-item]  # a NewType of str
                    max_size=MAX_MESSAGE,
                    compression=None,
                    ping_interval=PING_SECONDS,
                    ping_timeout=PING_SECONDS,
                    open_timeout=PING_SECONDS,
                    close_timeout=1.0,
                    server_header=None,
                    logger=_silent,
                )
            except OSError as error:
                reason = error.strerror or str(error)
                continue
            self.port = next(iter(server.sockets)).getsockname()[1]
            return server
        raise InvalidArgumentError(
            f"cannot listen at {self.host}:{attempts[0]}: {reason}; choose another --port or --host"
        )

    async def _end(self, server: "Server") -> None:
        """Stop listening and close every connection, also those that come in the last moment.

        asyncio cannot close a server in the turn in which it accepts: the connection's transport
        would find no server to belong to, and nobody would close its socket. So nothing more is
        accepted first. A browser also opens sockets in advance, on which it may never ask for
        anything. The server knows them only when they have asked; ``_opened`` has them from their
        first moment.
        """
        loop = asyncio.get_running_loop()
        with suppress(NotImplementedError):  # not every loop waits for sockets by their numbers
            for listener in server.sockets:
                loop.remove_reader(listener.fileno())
        for _ in range(TURNS):
            await asyncio.sleep(0)
        for connection in self._opened:
            if connection.state.name == "CONNECTING":
                connection.transport.abort()
        server.close()
        with suppress(TimeoutError):
            await asyncio.wait_for(server.wait_closed(), 2.0)
        for connection in self._opened:
            connection.transport.abort()
        for _ in range(TURNS):
            await asyncio.sleep(0)

    # ---- requests

    def _answer(self, connection: "ServerConnection", request: "Request") -> "Response | None":
        """Answer a request for a file, refuse a wrong one, or let a socket open (None)."""
        headers = request.headers
        hosts = headers.get_all("Host")
        path = request.path.partition("?")[0]
        refused = self._gate.refusal(
            path, hosts, headers.get_all("Origin"), headers.get_all("Sec-WebSocket-Protocol")
        )
        if refused is None and getattr(request, "method", "GET") != "GET":
            refused = HTTPStatus.METHOD_NOT_ALLOWED  # older versions of websockets refuse others
        if refused is not None:
            return _response(refused, refused.phrase.encode())
        is_full = self._n_sockets >= MAX_SOCKETS
        if path == STATUS_PATH:
            return _response(HTTPStatus.OK, (FULL if is_full else FREE).encode())
        if path == SOCKET_PATH:
            full = HTTPStatus.SERVICE_UNAVAILABLE
            return _response(full, b"too many pages") if is_full else None
        found = page(path, hosts[0])
        if found is None:
            return _response(HTTPStatus.NOT_FOUND, b"not found")
        return _response(HTTPStatus.OK, *found)

    async def _attend(self, connection: "ServerConnection") -> None:
        """Talk to one page until its socket closes."""
        from websockets.exceptions import ConnectionClosed

        viewer, sender = None, None
        self._n_sockets += 1
        try:
            hello = decode(await asyncio.wait_for(connection.recv(), PING_SECONDS))
            if not isinstance(hello, Hello):
                raise InvalidArgumentError("the first message must be hello")
            viewer = self._welcome(connection, hello.client)
            sender = asyncio.create_task(viewer.send_all())
            async for text in connection:
                if not viewer.limit.admits(time.monotonic()):
                    raise InvalidArgumentError("too many messages")
                self._hear(viewer, decode(text))
        except (ConnectionClosed, TimeoutError):
            pass
        except InvalidArgumentError as error:
            self._farewell(viewer)
            await connection.close(1008, str(error)[:100])
        finally:
            self._n_sockets -= 1
            self._farewell(viewer)
            if sender is not None:
                sender.cancel()

    def _welcome(self, connection: "ServerConnection", client: str) -> Viewer:
        """Take in a page: it acts if nobody else does, or if it did before; else it watches."""
        viewer = Viewer(connection, client)
        self._viewers.append(viewer)
        if self._driver is None or self._driver.client == client:
            self._set_driver(viewer)
        viewer.show({**self._fields, **self._details, "role": self._role(viewer)})
        if self._picture is not None:
            viewer.picture(*self._picture)
        return viewer

    def _farewell(self, viewer: Viewer | None) -> None:
        if viewer in self._viewers:
            self._viewers.remove(viewer)
        if viewer is not None and viewer is self._driver:
            self._driver = None
            self._add(Away(LEFT))
        for other in self._viewers:
            other.show({"role": self._role(other)})

    def _set_driver(self, viewer: Viewer) -> None:
        if self._driver is not None:
            self._add(Away(TAKEN))
        self._driver, self._sequence = viewer, viewer.sequence
        self._add(Present())
        for other in self._viewers:
            other.show({"role": self._role(other)})

    def _role(self, viewer: Viewer) -> str:
        if viewer is self._driver:
            return "acting"
        return "idle" if self._driver is None else "watching"

    # ---- messages

    def _hear(self, viewer: Viewer, message: Message) -> None:
        if isinstance(message, Seen):
            viewer.drawn(message.frame)
        if isinstance(message, Take):
            self._set_driver(viewer)
        if isinstance(message, Key):
            if message.sequence != viewer.sequence + 1:
                raise InvalidArgumentError("a key is missing")
            viewer.sequence = message.sequence
        if viewer is not self._driver:
            return  # who watches changes nothing
        sent = 0 if self._picture is None else self._picture[0]
        if isinstance(message, Seen | Key) and message.frame > sent:
            raise InvalidArgumentError("this picture was never sent")
        if isinstance(message, Seen):
            self._add(message)
        elif isinstance(message, Key):
            self._sequence = message.sequence
            kind = KeyDown if message.down else KeyUp
            self._add(kind(message.key, message.frame))
        elif isinstance(message, Gone):
            self._add(Away(HIDDEN))
        elif isinstance(message, Command):
            self._add(message)
        elif isinstance(message, Tell) and self._guide is not None:
            self._guide.hear(message.name, message.place, message.text)
            self._woken.set()

    def _add(self, event: Event) -> None:
        self._events.append(event)
        if not isinstance(event, Seen):
            self._woken.set()

    # ---- the session

    async def _play(self) -> None:
        """Tick until the session is over."""
        began = time.monotonic()
        session = self.recorder.session
        while not session.is_over:
            now = time.monotonic() - began
            events, self._events = self._events, []
            self._woken.clear()
            self._publish(now, events)
            self._begin_work(session.wishes.take())
            self._look_for_what_is_missing()
            elapsed = time.monotonic() - began
            wait = min(max(session.due(elapsed) - elapsed, 0.0), IDLE_SECONDS)
            with suppress(TimeoutError):
                async with asyncio.timeout(wait or 0.001):
                    await self._woken.wait()
        self._publish(time.monotonic() - began, ())

    def _publish(self, now: float, events: Iterable[Event]) -> None:
        """Let the session go on, and its guide lead it; show every page the new view."""
        tick = self.recorder.tick(now, events)
        self._fields = msgspec.to_builtins(tick.view)  # to be compared and sent singly
        if tick.frame is not None:
            number, pixels = tick.frame.number, tick.frame.pixels
            self._picture = number, encode_picture(number, self._sequence, pixels)
        for viewer in self._viewers:
            viewer.show(self._fields)
            if tick.frame is not None and self._picture is not None:
                viewer.picture(*self._picture)
        if self._guide is not None:
            for event in self._guide.advance(now):
                self._add(event)
            self._details["study"] = self._guide.view()
            for viewer in self._viewers:
                viewer.show({"study": self._details["study"]})

    # ---- the tree

    def _begin_work(self, wish: str) -> None:
        """Let the tree be made, or practise, in a thread; one at a time."""
        maker, wishes = self._maker, self.recorder.session.wishes
        if not wish or maker is None or wishes.is_busy:
            return
        loop, way, is_over = asyncio.get_running_loop(), wishes.way, False
        # Shown once the work is over: people answer at once, and what they wish before is dropped.
        made: tuple[TreeView, Programme | None] | None = None

        def in_the_loop(call: Callable[..., None], *arguments: object) -> None:
            with suppress(RuntimeError):  # the loop is closed: nobody looks any more
                loop.call_soon_threadsafe(call, *arguments)

        def show(view: TreeView, programme: Programme | None = None) -> None:
            nonlocal made
            if view.phase in (READY, FAILED) and not is_over:
                made = view, programme
            else:
                in_the_loop(self.show_tree, view, programme)

        def end() -> None:
            nonlocal is_over
            is_over, wishes.is_busy = True, False
            if made is not None:
                self.show_tree(*made)

        def run() -> None:
            try:
                if wish == "choose":
                    maker.choose(way, show)
                elif wish in ("undo", "accept"):
                    maker.settle(show, undo=wish == "undo")
                else:
                    longer = {"make": maker.make, "practise": maker.practise,
                              "hurting": maker.look, "without": maker.make_without}  # fmt: skip
                    longer[wish](show, lambda: self._is_closing)
            except Exception as error:
                kind = "" if isinstance(error, EutreeError) else f"{type(error).__name__}: "
                show(TreeView(phase=FAILED, message=f"{kind}{error}"))
            finally:
                in_the_loop(end)

        wishes.is_busy = True
        if wish in ("make", "practise"):
            self.show_tree(TreeView(phase=FITTING, message="Making your tree"))
        threading.Thread(target=run, name="eutree tree", daemon=True).start()

    def _look_for_what_is_missing(self) -> None:
        """Let the maker look in a thread, after an episode; the last answer counts."""
        session, maker = self.recorder.session, self._maker
        wanted, session.wishes.look = session.wishes.look, False
        if not wanted or maker is None:
            return

        def look() -> None:
            before = session.recording.n_kept
            with suppress(EutreeError):  # making the tree will say it
                found = maker.missing()
                if session.recording.n_kept == before:
                    session.recording.missing = found

        threading.Thread(target=look, name="eutree looks", daemon=True).start()

    def show_tree(self, view: TreeView, programme: Programme | None = None) -> None:
        """Let every page show a tree, and the tree drive if there is a programme."""
        if programme is not None:
            self.recorder.session.driving.offer(programme)
        self.recorder.session.lessons.hurts = view.hurts
        self._details["tree"] = msgspec.to_builtins(view)
        for viewer in self._viewers:
            viewer.show({"tree": self._details["tree"]})

    async def _say_goodbye(self) -> None:
        """Send the last view to every page and close its socket."""
        from websockets.exceptions import ConnectionClosed

        for viewer in list(self._viewers):
            with suppress(ConnectionClosed, TimeoutError):
                async with asyncio.timeout(2.0):
                    await viewer.flush()
                    await viewer.connection.close(1000, "the session is over")


def _response(status: HTTPStatus, body: bytes, headers: dict[str, str] | None = None) -> "Response":
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    if headers is None:
        headers = {"Content-Type": "text/plain; charset=utf-8", **safe_headers("", "localhost")}
    rest = {"Content-Length": str(len(body)), "Connection": "close"}
    return Response(status.value, status.phrase, Headers({**headers, **rest}), body)


def _own_address() -> str:
    """Return the address by which others reach this machine; no packet is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
            return str(probe.getsockname()[0])
        except OSError:
            return socket.gethostname()
