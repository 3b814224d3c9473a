"""Who may talk to the recorder's server: requests from raw sockets, and any messages at all."""

import asyncio
import gc
import json
import logging
import socket
import time
import warnings

import pytest
from websockets.exceptions import ConnectionClosed

from eutree.errors import InvalidArgumentError
from eutree.recording.browser import PageServer
from tests.recording.people import Corridor
from tests.recording.serving import ENOUGH, serving


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    with serving(tmp_path_factory.mktemp("gate")) as server:
        yield server


def test_the_page_is_served(served) -> None:
    for path, kind in [("/", "html"), ("/page.js", "javascript"), ("/page.css", "css")]:
        status, headers, body = served.request(path, Host=served.host)
        assert (status, kind in headers["Content-Type"]) == (200, True)
        assert len(body) == int(headers["Content-Length"]) > 1000


def test_what_comes_in_the_last_moment_is_closed_too(tmp_path, monkeypatch) -> None:
    """A browser opens sockets in advance; those accepted while the server closed were nobody's."""
    own, kept = PageServer._say_goodbye, []

    async def say_goodbye(server):
        await own(server)
        for turns in (1, 1, 1, 0):  # of the loop, before the next ones come
            for content in (b"", b"GET / HTTP/1.1\r\n"):
                for stays in (True, False):
                    connection = socket.create_connection(("127.0.0.1", server.port))
                    connection.sendall(content)
                    kept.append(connection) if stays else connection.close()
            for _ in range(turns):
                await asyncio.sleep(0)

    monkeypatch.setattr(PageServer, "_say_goodbye", say_goodbye)
    gc.collect()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with serving(tmp_path):
            pass
        for connection in kept:
            connection.close()
        gc.collect()
    assert len(kept) == 8
    told = [str(warning.message) for warning in said]
    assert [one for one in told if "names no time limit" not in one] == []


@pytest.mark.promise(24)
def test_the_socket_opens_with_everything_right(served) -> None:
    assert served.open()[0] == 101
    for name in ("localhost", "127.0.0.1", "[::1]", "localhost:9999"):  # another port: a tunnel
        assert served.open(Host=name, Origin=f"http://{name}")[0] == 101


WRONG = {
    "no token": ({"Sec_WebSocket_Protocol": "eutree"}, 403),
    "no protocol": ({"Sec_WebSocket_Protocol": None}, 403),
    "wrong token": ({"Sec_WebSocket_Protocol": "eutree, token.AAAAAAAAAAAAAAAAAAAAAAAA"}, 403),
    "empty token": ({"Sec_WebSocket_Protocol": "eutree, token."}, 403),
    "token not of ASCII": ({"Sec_WebSocket_Protocol": "eutree, token.\u00e4"}, 403),
    "token in the address": ({"Sec_WebSocket_Protocol": "eutree", "path": "/socket?TOKEN"}, 403),
    "no origin": ({"Origin": None}, 403),
    "null origin": ({"Origin": "null"}, 403),
    "foreign origin": ({"Origin": "http://evil.example"}, 403),
    "origin of another port": ({"Origin": "http://127.0.0.1:1"}, 403),
    "origin that begins alike": ({"Origin": "http://HOST.evil.example"}, 403),
    "foreign host": ({"Host": "evil.example"}, 421),
    "host that begins alike": ({"Host": "127.0.0.1.evil.example"}, 421),
    "host with a user": ({"Host": "evil@127.0.0.1"}, 421),
    "host of the network": ({"Host": "192.168.1.1"}, 421),
    "no host": ({"Host": None}, 421),
    "empty host": ({"Host": ""}, 421),
}


@pytest.mark.promise(24)
@pytest.mark.parametrize(("changes", "status"), WRONG.values(), ids=WRONG.keys())
def test_anything_else_is_refused(served, changes, status) -> None:
    changes = {
        name: value and value.replace("HOST", served.host).replace("TOKEN", served.token)
        for name, value in changes.items()
    }
    assert served.open(**changes)[0] == status


@pytest.mark.promise(24)
@pytest.mark.parametrize(
    ("headers", "status"),
    [({"Host": "evil.example"}, 421), ({"Origin": "http://evil.example"}, 403), ({}, 421)],
)
def test_the_page_too_is_given_to_nobody_else(served, headers, status) -> None:
    if "Origin" in headers:
        headers = {"Host": served.host, **headers}
    assert served.request("/", **headers)[0] == status


@pytest.mark.promise(24)
def test_two_hosts_are_refused(served) -> None:
    text = f"GET / HTTP/1.1\r\nHost: {served.host}\r\nHost: evil.example\r\n\r\n"
    assert served.raw(text.encode())[0] == 421


@pytest.mark.parametrize("path", ["/page.html", "/../wire.py", "/.git", "/socket/", "//", "/page"])
def test_nothing_else_is_served(served, path) -> None:
    assert served.request(path, Host=served.host)[0] == 404


@pytest.mark.parametrize(
    "content",
    [
        b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\x00\xff" * 50 + b"\r\n\r\n",
        b"GET / HTTP/1.0\r\n\r\n",
    ],
)
def test_what_is_no_request_is_refused(served, content) -> None:
    assert served.raw(content)[0] in (0, 400, 405, 421)
    assert served.request("/", Host=served.host)[0] == 200


@pytest.mark.promise(25)
def test_headers_keep_everything_else_out(served) -> None:
    pages = [served.request("/", Host=served.host) for _ in range(2)]
    policies = []
    for _, headers, body in pages:
        policy = headers["Content-Security-Policy"]
        rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
        policies.append(policy)
        assert rules["default-src"] == rules["frame-ancestors"] == "'none'"
        assert rules["base-uri"] == rules["form-action"] == "'none'"
        assert "unsafe" not in policy
        assert "*" not in policy
        nonce = rules["script-src"].removeprefix("'nonce-").removesuffix("'")
        assert len(nonce) >= 16
        assert f'nonce="{nonce}"' in body.decode()
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert b"<script>" not in body
        assert b"://" not in body
    assert policies[0] != policies[1]  # a fresh nonce each time


@pytest.mark.promise(25)
def test_refusals_have_the_headers_too(served) -> None:
    _, headers, _ = served.request("/", Host="evil.example")
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


@pytest.mark.promise(23)
def test_the_server_listens_on_loopback_only(served, proc) -> None:
    listening = [
        line.split()[1]
        for line in (proc / "net" / "tcp").read_text().splitlines()[1:]
        if int(line.split()[1].split(":")[1], 16) == served.port and line.split()[3] == "0A"
    ]
    assert listening == [f"0100007F:{served.port:04X}"]
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)}
    for address in others - {"127.0.0.1", "::1"}:
        if address.startswith("127."):
            continue
        with pytest.raises(OSError):  # noqa: PT011 - refused, or unreachable
            socket.create_connection((address, served.port), timeout=2.0)


@pytest.mark.promise(24)
def test_the_token_is_in_no_log(tmp_path, caplog) -> None:
    caplog.set_level(logging.DEBUG)
    with serving(tmp_path) as server:
        server.open()
        server.open(Sec_WebSocket_Protocol="eutree, token.wrong")
        with server.connect() as page:
            page.send(json.dumps({"type": "hello", "client": "a" * 12}))
            page.recv(timeout=ENOUGH)
        assert server.token not in repr(server.server.__dict__["_gate"])
        assert server.token not in server.request("/", Host=server.host)[2].decode()
    ours = [r for r in caplog.records if not r.name.startswith("websockets.client")]
    assert not [record for record in ours if server.token in record.getMessage()]


class Page:
    """A page made of JSON by hand."""

    def __init__(self, served, client="page-one") -> None:
        self.socket = served.connect().__enter__()
        self.view = {}
        self.sequence = 0
        self.send(type="hello", client=client)
        self.until(lambda view: "state" in view)

    def send(self, **message) -> None:
        self.socket.send(json.dumps(message))

    def flood(self) -> None:
        for _ in range(100_000):
            self.send(type="drawn", frame=1)
        self.until(lambda view: False)

    def key(self, key, down, frame=0) -> None:
        self.sequence += 1
        self.send(type="key", sequence=self.sequence, key=key, down=down, frame=frame)

    def until(self, reached):
        end = time.monotonic() + ENOUGH
        while not reached(self.view):
            message = self.socket.recv(timeout=end - time.monotonic())
            if isinstance(message, bytes):
                self.send(type="drawn", frame=int.from_bytes(message[:4], "big"))
            else:
                self.view |= json.loads(message)
        return self.view


def test_a_page_that_watched_takes_over_whatever_keys_it_sent_before(tmp_path) -> None:
    """They were not counted, so that its first key afterwards was one too many."""
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as server:
        acting, watching = Page(server), Page(server, "page-two")
        watching.key("left", True)
        watching.key("left", False)
        watching.send(type="take")
        watching.until(lambda view: view["role"] == "acting")
        watching.key("right", True)
        acting.key("left", True)
        acting.send(type="take")
        acting.until(lambda view: view["role"] == "acting")
        acting.key("left", False)
        acting.send(type="do", name="start")
        acting.until(lambda view: view["state"] == "playing" and view["step"] >= 2)
        assert server.heard == [("right", True), ("left", False)]


BAD_MESSAGES = {
    "no JSON": ("nonsense", 1008),
    "no object": ("[]", 1008),
    "unknown type": ('{"type":"shutdown"}', 1008),
    "unknown field": ('{"type":"gone","extra":1}', 1008),
    "missing field": ('{"type":"drawn"}', 1008),
    "wrong type": ('{"type":"drawn","frame":"1"}', 1008),
    "unknown key": ('{"type":"key","sequence":1,"key":"hyper","down":true,"frame":1}', 1008),
    "skipped key": ('{"type":"key","sequence":7,"key":"left","down":true,"frame":1}', 1008),
    "unknown command": ('{"type":"do","name":"__init__"}', 1008),
    "no action": ('{"type":"do","name":"bind","value":-1,"key":"l"}', 1008),
    "half an episode": ('{"type":"do","name":"drop","value":0.5}', 1008),
    "no such picture": ('{"type":"drawn","frame":1000000000000000000000000000000}', 1008),
    "no picture yet": ('{"type":"drawn","frame":4000000000}', 1008),
    "deep": ("[" * 1500, 1008),
    "not UTF-8": (b"\xff\xfe", 1008),
    "binary": (b'{"type":"gone"}', 1008),
    "oversize": ('{"type":"' + "x" * 3000 + '"}', 1009),
}


@pytest.mark.promise(24)
@pytest.mark.parametrize(("message", "code"), BAD_MESSAGES.values(), ids=BAD_MESSAGES.keys())
def test_a_bad_message_pauses_the_episode_and_harms_nothing(tmp_path, message, code) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as server:
        page = Page(server)
        page.send(type="do", name="start")
        page.until(lambda view: view["state"] == "playing" and view["step"] >= 2)
        page.socket.send(message)
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda view: False)
        assert closed.value.rcvd.code == code
        again = Page(server, client="page-two")
        view = again.until(lambda view: view["state"] == "paused")
        step = view["step"]
        again.send(type="do", name="start")
        again.until(lambda view: view["state"] == "playing" and view["step"] >= step + 2)
        again.send(type="do", name="end")
        again.until(lambda view: view["state"] == "review")
        assert server.session.episodes[0].ending == "stopped"


@pytest.mark.promise(24)
def test_a_flood_pauses_the_episode(tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as server:
        page = Page(server)
        page.send(type="do", name="start")
        page.until(lambda view: view["state"] == "playing")
        with pytest.raises(ConnectionClosed) as closed:
            page.flood()
        assert closed.value.rcvd.code == 1008
        assert "too many" in closed.value.rcvd.reason
        assert Page(server, "page-two").until(lambda v: v["state"] == "paused")["role"] == "acting"


@pytest.mark.promise(26)
def test_a_second_viewer_is_read_only_until_it_takes_over(tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as server:
        first, second = Page(server, "page-one"), Page(server, "page-two")
        assert (first.view["role"], second.view["role"]) == ("acting", "watching")
        second.send(type="do", name="start")
        second.key("enter", True)
        second.send(type="gone")
        first.send(type="do", name="start")
        first.until(lambda view: view["state"] == "playing" and view["step"] >= 2)
        second.until(lambda view: view["state"] == "playing" and view["step"] >= 2)
        second.send(type="do", name="finish")
        first.until(lambda view: view["step"] >= 6)
        second.send(type="take")
        second.until(lambda view: view["role"] == "acting" and view["state"] == "paused")
        first.until(lambda view: view["role"] == "watching")
        second.send(type="do", name="end")
        first.until(lambda view: view["state"] == "review")


@pytest.mark.promise(26)
def test_a_lost_connection_pauses_and_the_same_page_goes_on(tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as server:
        page = Page(server)
        page.send(type="do", name="start")
        page.until(lambda view: view["state"] == "playing")
        page.key("right", True)
        page.until(lambda view: view["action"] == 2)
        page.socket.socket.shutdown(socket.SHUT_RDWR)
        again = Page(server)
        view = again.until(lambda view: view["state"] == "paused")
        assert (view["role"], view["held"]) == ("acting", [])
        again.send(type="do", name="start")
        again.until(lambda view: view["action"] == 1)


@pytest.mark.promise(26)
def test_a_page_that_hangs_pauses_the_episode(tmp_path) -> None:
    """The socket stays open, but nothing is drawn any more."""
    with serving(tmp_path, Corridor(length=100, limit=10_000), lost_after=1.5) as server:
        page = Page(server)
        page.send(type="do", name="start")
        page.until(lambda view: view["state"] == "playing")
        end = time.monotonic() + ENOUGH
        while server.session.state != "paused":
            assert time.monotonic() < end
            time.sleep(0.05)


def test_too_many_sockets_are_refused(tmp_path) -> None:
    with serving(tmp_path) as server:
        pages = [Page(server, f"page-{number:03}") for number in range(8)]
        assert server.open()[0] == 503
        for page in pages:
            page.socket.close()


def test_a_taken_port_is_named(tmp_path) -> None:
    from eutree.recording.browser import record_in_browser
    from eutree.recording.recorder import Recorder

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InvalidArgumentError, match=f"127.0.0.1:{port}: .*--port"):
            record_in_browser(Recorder(Corridor(), tmp_path / "demos"), port=port)
