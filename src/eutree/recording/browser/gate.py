"""Who may talk to the recorder's server, checked by a request's head, and the files they get.

The page itself holds no data and is given to anybody who asks under the right name. The socket
needs the token, which a browser gets in the fragment of the address (never sent over the network,
never in a log or a Referer) and offers as a subprotocol. ``Host`` must name this machine, which
stops DNS rebinding; ``Origin`` must be the page's own, which stops other sites' pages. The port
of ``Host`` is not compared, so a tunnel from another port works.
"""

import hmac
import ipaddress
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from importlib import resources

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
PROTOCOL = "eutree"
SOCKET_PATH = "/socket"

_OFFER = "token."
_AUTHORITY = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]{1,253})(:\d{1,5})?")
_WILDCARDS = ("0.0.0.0", "::")  # noqa: S104 - compared with, not bound to


def new_token() -> str:
    """Return a token that cannot be guessed: 192 random bits."""
    return secrets.token_urlsafe(24)


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a server bound to ``host``."""
    return f"[{host}]" in LOOPBACK or host in LOOPBACK


@dataclass(frozen=True)
class Gate:
    """The checks of one server.

    Attributes:
        token: What the socket must offer.
        host: Address that the server is bound to.
    """

    token: str = field(repr=False)
    host: str = "127.0.0.1"

    def refusal(
        self, path: str, hosts: Sequence[str], origins: Sequence[str], protocols: Sequence[str]
    ) -> HTTPStatus | None:
        """Return why a request is refused, or None.

        Args:
            path: Its path.
            hosts: Its Host headers; there must be exactly one.
            origins: Its Origin headers; a socket needs exactly one.
            protocols: Its Sec-WebSocket-Protocol headers.
        """
        if len(hosts) != 1 or not self.knows(hosts[0]):
            return HTTPStatus.MISDIRECTED_REQUEST
        allowed = {f"http://{hosts[0]}", f"https://{hosts[0]}"}
        if any(origin not in allowed for origin in origins):
            return HTTPStatus.FORBIDDEN
        if path != SOCKET_PATH:
            return None
        if len(origins) != 1 or not self._has_token(protocols):
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
    """A bucket of messages that fills at a steady rate.

    Args:
        rate: Messages per second.
        burst: How many may come at once.
    """

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
        path: The request's path.
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
