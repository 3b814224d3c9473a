"""The frame of every page: one file, nothing from outside, a strict Content-Security-Policy.

Style and script come from the files in ``assets``. The policy of the page names them by their
SHA-256, so no other script or style can run, whatever a name or a note holds.
"""

import base64
import hashlib
import json
from html import escape
from importlib.resources import files
from typing import Any


def asset(name: str) -> str:
    """Return the text of a file in ``assets``."""
    return (files("eutree.report") / "assets" / name).read_text(encoding="utf-8")


def base_style() -> str:
    """Return the style that all pages share: the colours, the type, the tables."""
    return asset("colours.css") + asset("page.css")


def page(*, title: str, body: str, style: str, script: str = "", data: Any = None) -> str:
    """Return a whole HTML page.

    Args:
        title: The page's title, as plain text.
        body: HTML of the body; whoever makes it escapes what it holds.
        style: What it adds to the style that all pages share, for example ``asset("chart.css")``.
        script: The one script; it runs after the body.
        data: What the script reads as JSON from the element ``data``; numbers must be finite.
    """
    style = base_style() + style
    sources = {
        "default-src": "'none'",
        "img-src": "data:",
        "style-src": _hash(style),
        "script-src": _hash(script) if script else "'none'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    policy = "; ".join(f"{name} {value}" for name, value in sources.items())
    parts = [
        "<!doctype html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="referrer" content="no-referrer">',
        f"<title>{escape(title)}</title>",
        f"<style>{style}</style>",
        "</head>",
        f"<body>\n{body}",
    ]
    if data is not None:
        parts.append(f'<script type="application/json" id="data">{as_json(data)}</script>')
    if script:
        parts.append(f"<script>{script}</script>")
    return "\n".join([*parts, "</body>", "</html>"]) + "\n"


def as_json(data: Any) -> str:
    """Return ``data`` as JSON that cannot end the element that holds it."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace("&", "\\u0026")


def _hash(source: str) -> str:
    """Return the source expression that admits exactly this text."""
    digest = hashlib.sha256(source.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
