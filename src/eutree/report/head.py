"""The head of every page: what it is about, the verdict in a sentence, the facts behind it."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True)
class Pointer:
    """Words of a verdict that point at a place of the page.

    Attributes:
        words: The words.
        target: Id of the element, or ``node-N`` for a node of the page's tree.
    """

    words: str
    target: str


Verdict = Sequence[str | Pointer]


def head(title: str, verdict: Verdict, facts: Sequence[str] = (), *, beside: str = "") -> str:
    """Return the head of a page.

    Args:
        title: What the page is about.
        verdict: The most important sentence; parts of it may point at a place of the page.
        facts: Sentences on how that was found out.
        beside: HTML that stands beside the words.
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
