"""The frame of every page: one file, nothing from outside, a strict Content-Security-Policy.

Style and script come from the files in ``assets``. The policy of the page names them by their
SHA-256, so no other script or style can run, whichever text a name or a note holds.
"""

import base64
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.policies import TreePolicy
from eutree.validation import check_observations


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
        body: HTML of the body; its maker escapes all texts in it.
        style: Its addition to the style that all pages share, for example ``asset("chart.css")``.
        script: The one script; it runs after the body.
        data: The script reads it as JSON from the element ``data``; numbers must be finite.
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
    parts = [body]
    if data is not None:
        parts.append(f'<script type="application/json" id="data">{as_json(data)}</script>')
    if script:
        parts.append(f"<script>{script}</script>")
    known = {"policy": policy, "title": escape(title), "style": style, "body": "\n".join(parts)}
    return Template(asset("frame.html")).substitute(known)


def as_json(data: Any) -> str:
    """Return ``data`` as JSON that cannot end the element that holds it."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace("&", "\\u0026")


def _hash(source: str) -> str:
    """Return the source expression that admits exactly this text."""
    digest = hashlib.sha256(source.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


@dataclass(frozen=True)
class Pointer:
    """Words of a verdict that point at a place of the page."""

    words: str  # the part of the sentence that becomes a link
    target: str  # id of the element, or ``node-N`` for a node of the page's tree


Verdict = Sequence[str | Pointer]


def head(title: str, verdict: Verdict, facts: Sequence[str] = (), *, beside: str = "") -> str:
    """Return the head of a page: its subject, the verdict, and facts on how that was found.

    Parts of the verdict may point at a place of the page; ``beside`` is HTML beside the words.
    """
    sentence = "".join(map(_part, verdict))
    said = f'<p class="verdict">{sentence}</p>' if sentence else ""
    lines = "".join(f'<p class="facts">{_words(fact)}</p>' for fact in facts)
    words = f'<div class="heading"><h1>{escape(title)}</h1>{said}{lines}</div>'
    return f'<header class="head">{words}{beside}</header>'


def _part(part: str | Pointer) -> str:
    if isinstance(part, str):
        return _words(part)
    return f'<a href="#{escape(part.target)}">{_words(part.words)}</a>'


def _words(text: str) -> str:
    """Return a text for a page, with no line that begins with a percent sign."""
    return escape(text).replace(" %", "&nbsp;%")


def figure(title: str, drawing: str) -> str:
    """Return a drawing with its title above it."""
    return f"<figure><figcaption>{escape(title)}</figcaption>\n{drawing}</figure>"


def scrolling(label: str, content: str, *, tag: str = "div", kind: str = "") -> str:
    """Return a region that scrolls by itself on a narrow screen; ``kind`` is a class of it."""
    facts = f'class="{f"scrolls {kind}".rstrip()}" tabindex="0" role="region"'
    return f'<{tag} {facts} aria-label="{escape(label)}">{content}</{tag}>'


@dataclass(frozen=True)
class LeafChange:
    """The earlier policy's decisions where a leaf decides now."""

    was: int  # the earlier action, the most frequent of those that differ
    share: float  # of the leaf's recorded steps that were decided otherwise

    def facts(self) -> dict[str, Any]:
        """Return the change in JSON's types."""
        return {"was": self.was, "share": round(self.share, 4)}


def changed_leaves(
    before: TreePolicy, after: TreePolicy, observations: ArrayLike
) -> dict[int, LeafChange]:
    """Return the leaves of ``after`` that decide recorded steps otherwise than ``before``.

    The observations of these steps, shape [N, d], are in the features of both trees.
    """
    before.schema.check_same(after.schema, "the later policy", of="the earlier")
    rows = check_observations("observations", observations, names=after.schema.feature_names)
    earlier = before.actions[before.tree.leaf_index(rows)]
    leaves = after.tree.leaf_index(rows)
    found = {}
    for leaf in range(after.n_leaves):
        mine = earlier[leaves == leaf]
        others = mine[mine != after.actions[leaf]]
        if others.size:
            found[leaf] = LeafChange(int(np.bincount(others).argmax()), others.size / mine.size)
    return found
