"""The page that opens by itself: only where somebody sees it, and without showing its token."""

import stat
import sys
import webbrowser
from pathlib import Path
from urllib.parse import urlparse

import pytest

from eutree.cli.record import opened_by

URL = "http://127.0.0.1:8765/#secret&token"


class Seen(webbrowser.BackgroundBrowser):
    """A browser that keeps what it was told to open, as it was then."""

    def __init__(self) -> None:
        super().__init__("seen")
        self.opened: list[tuple[str, str, int]] = []

    def open(self, url, new=0, autoraise=True) -> bool:
        path = Path(urlparse(url).path)
        self.opened.append((url, path.read_text(), stat.S_IMODE(path.parent.stat().st_mode)))
        return True


@pytest.fixture
def browser(monkeypatch) -> Seen:
    """A desktop with a browser, and somebody at its terminal."""
    seen = Seen()
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(webbrowser, "get", lambda: seen)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("SSH_CONNECTION", raising=False)
    return seen


def test_the_browser_gets_a_file_that_leads_to_the_page_and_no_token(browser) -> None:
    with opened_by() as opens:
        assert opens(URL)
    [(url, content, mode)] = browser.opened
    assert "secret" not in url
    assert url.startswith("file://")
    assert "http://127.0.0.1:8765/#secret&amp;token" in content
    assert mode == 0o700
    assert not Path(urlparse(url).path).exists()


def test_nothing_opens_where_nobody_sees_it(browser, monkeypatch) -> None:
    with opened_by() as opens:
        monkeypatch.setenv("SSH_CONNECTION", "10.0.0.1 1 10.0.0.2 22")
        assert not opens(URL)
        monkeypatch.delenv("SSH_CONNECTION")
        monkeypatch.delenv("DISPLAY")
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        assert not opens(URL)
        monkeypatch.setenv("DISPLAY", ":0")
        monkeypatch.setattr(sys.stderr, "isatty", lambda: False)
        assert not opens(URL)
    assert browser.opened == []


def test_a_browser_of_the_terminal_is_left_alone(browser, monkeypatch) -> None:
    monkeypatch.setattr(webbrowser, "get", lambda: webbrowser.GenericBrowser("lynx"))
    with opened_by() as opens:
        assert not opens(URL)


def test_without_any_browser_the_address_is_printed_and_nothing_fails(browser, monkeypatch) -> None:
    def none() -> None:
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "get", none)
    with opened_by() as opens:
        assert not opens(URL)
