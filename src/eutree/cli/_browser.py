"""Open a page of this machine in the person's own browser."""

import html
import os
import sys
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from eutree.files import write_text

_REDIRECT = '<!doctype html><meta http-equiv="refresh" content="0;url={}">\n'


@contextmanager
def opened_by() -> Iterator["Opener"]:
    """Yield what opens pages; what it has written is deleted at the end."""
    with TemporaryDirectory(prefix="eutree-") as folder:
        yield Opener(Path(folder))


class Opener:
    """Opens addresses where a person sits at this machine's own desktop.

    An address with a token is no argument for another program: every user of the machine could
    read it. So the browser is handed a file that only this user can read, and that leads there.

    Args:
        folder: A folder that only this user can read.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def open(self, url: str) -> bool:
        """Open an address in a browser; return False where there is none, or nobody to see it."""
        if not has_desktop():
            return False
        page = self._folder / "open.html"
        write_text(page, _REDIRECT.format(html.escape(url)))
        try:
            browser = webbrowser.get()
        except webbrowser.Error:
            return False
        if type(browser) is webbrowser.GenericBrowser:
            return False  # one that lives in the terminal: it would wait to be left
        return browser.open(page.as_uri())


def has_desktop() -> bool:
    """Return whether somebody sits at a terminal on the desktop of this machine."""
    if not sys.stderr.isatty() or "SSH_CONNECTION" in os.environ:
        return False
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
