"""The text that a person of a study agrees to: every word of it is on the page."""

import re
from contextlib import ExitStack

import pytest

from tests.recording.test_browser_study import studying
from tests.recording.typists import person_at

TEXT = """# Consent
This line says that we publish *everything*.
And **this** one, too: 2 * 3.

## Who
Text:
- a
- b
  goes on
+ c

1. first
2. second

  of it
Last.

- one

- two

After a list.
3) third
"""
SHOWN = [
    "<h2>Consent</h2>",
    "<p>This line says that we publish <em>everything</em>. And <em>this</em> one, too: 2 * 3.</p>",
    "<h2>Who</h2>",
    "<p>Text:</p>",
    "<ul><li>a</li><li>b goes on</li><li>c</li></ul>",
    "<ol><li>first</li><li>second of it</li></ol>",
    "<p>Last.</p>",
    "<ul><li>one</li><li>two</li></ul>",
    "<p>After a list.</p>",
    '<ol start="3"><li>third</li></ol>',
]


@pytest.fixture
def told(chromium, tmp_path, monkeypatch):
    """Return a person who reads a text, at a phone."""

    def tell(text):
        study = tmp_path / "study"
        study.mkdir()
        (study / "consent.md").write_text(text)
        served, _ = stack.enter_context(studying(study, monkeypatch))
        person = person_at(chromium, served, "phone").until(part="consent", study="card")
        return person.page

    with ExitStack() as stack:
        yield tell


def test_no_word_of_the_text_is_left_out(told) -> None:
    page = told(TEXT)
    shown = "() => [...document.getElementById('study-text').children].map((e) => e.outerHTML)"
    assert page.evaluate(shown) == SHOWN
    words = re.sub(r"<[^>]+>", " ", " ".join(SHOWN)).split()
    for word in re.findall(r"[A-Za-z]{2,}", TEXT):
        assert any(word in one for one in words), word


def test_a_long_word_stays_on_its_card(told) -> None:
    page = told(f"# Who\n\nSee https://example.org/{'a' * 90}.html\n")
    wide = (
        "(id) => document.getElementById(id).scrollWidth - document.getElementById(id).clientWidth"
    )
    assert page.evaluate(wide, "study") <= 0
    assert page.evaluate("() => document.documentElement.scrollWidth - innerWidth") <= 0
