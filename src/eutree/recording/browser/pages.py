"""The files of the recorder's page, with headers that allow nothing but themselves."""

import secrets
from importlib import resources

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
