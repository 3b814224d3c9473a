"""A recorder's page server in a thread of the test, and raw talk with it."""

import socket
import threading
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

from eutree.recording.browser import PageServer, record_in_browser
from eutree.recording.events import KeyDown, KeyUp, SessionSettings
from eutree.recording.recorder import Recorder
from tests.patience import ENOUGH
from tests.recording.people import Corridor


class Served:
    """A server under way."""

    def __init__(self, server: PageServer, recorder: Recorder) -> None:
        self.server = server
        self.recorder = recorder
        self.port = server.port
        self.token = server.token
        self.host = f"127.0.0.1:{self.port}"
        self.heard: list[tuple[str, bool]] = []  # every key edge, as it reached the recorder
        own = recorder.tick

        def tick(now, events=()):
            keys = [event for event in events if isinstance(event, KeyDown | KeyUp)]
            self.heard += [(event.key, isinstance(event, KeyDown)) for event in keys]
            return own(now, events)

        recorder.tick = tick

    @property
    def session(self):
        return self.recorder.session

    def request(self, path="/", **headers) -> tuple[int, dict[str, str], bytes]:
        """Send a request with exactly these headers; return status, headers and body."""
        lines = [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
        return self.raw("\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode())

    def raw(self, content: bytes) -> tuple[int, dict[str, str], bytes]:
        """Send bytes; return status, headers and body of the answer."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=ENOUGH) as connection:
            connection.sendall(content)
            answer = b""
            while b"\r\n\r\n" not in answer or b"101 " not in answer.split(b"\r\n")[0]:
                part = connection.recv(65536)
                if not part:
                    break
                answer += part
        head, _, body = answer.partition(b"\r\n\r\n")
        status, *rest = head.decode().split("\r\n")
        headers = dict(line.split(": ", 1) for line in rest)
        return int(status.split()[1]) if status else 0, headers, body

    def open(self, **changes) -> tuple[int, dict[str, str], bytes]:
        """Ask for the socket as the page does, with some headers changed; None leaves one out."""
        headers = {
            "Host": self.host,
            "Origin": f"http://{self.host}",
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
            "Sec_WebSocket_Version": "13",
            "Sec_WebSocket_Protocol": f"eutree, token.{self.token}",
        } | changes
        path = headers.pop("path", "/socket")
        return self.request(path, **{n: v for n, v in headers.items() if v is not None})

    def connect(self):
        """Return a socket such as the page's."""
        from websockets.sync.client import connect

        return connect(
            f"ws://{self.host}/socket",
            origin=f"http://{self.host}",
            subprotocols=["eutree", f"token.{self.token}"],
            compression=None,
            open_timeout=ENOUGH,
        )


@contextmanager
def serving(folder: Path, env=None, *, maker=None, lost_after=ENOUGH, countdown=0.2, **settings):
    """Serve a session in a thread until the block ends.

    On a busy machine a browser may draw nothing for seconds. It counts as lost after
    ``lost_after`` seconds; as in use, after one and a half, episodes would pause by themselves.
    """
    settings = SessionSettings(target=3, countdown=countdown, makes=maker is not None, **settings)
    recorder = Recorder(env or Corridor(), folder / "demos", settings=settings)
    with in_a_thread(recorder, lost_after=lost_after, maker=maker) as served:
        yield served


@contextmanager
def in_a_thread(recorder: Recorder, *, lost_after=ENOUGH, **given):
    """Serve a recorder's page in a thread until the block ends, with what else it is given."""
    ready, servers = threading.Event(), []

    def on_ready(server: PageServer) -> None:
        servers.append(server)
        ready.set()

    def run() -> None:
        record_in_browser(recorder, port=0, on_ready=on_ready, **given)

    thread = threading.Thread(target=run, daemon=True)
    with (
        mock.patch("eutree.recording.play.VIEWER_SECONDS", lost_after),
        mock.patch("eutree.recording.browser.server.PING_SECONDS", ENOUGH),
    ):
        thread.start()
        assert ready.wait(ENOUGH)
        try:
            yield Served(servers[0], recorder)
        finally:
            recorder.session.play.state = "finished"
            thread.join(ENOUGH)
            assert not thread.is_alive()
