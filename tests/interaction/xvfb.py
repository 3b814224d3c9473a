"""A display of its own for a test, and hands that press real keys on it."""

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.report.browser import missing

ROOT = Path(__file__).parents[2]


class Display:
    """A display under Xvfb.

    Attributes:
        environment: What a process needs to open a window on it.
    """

    def __init__(self, name: str) -> None:
        self.environment = {**os.environ, "DISPLAY": name, "SDL_VIDEODRIVER": "x11"}
        self.environment["PYTHONPATH"] = str(ROOT / "src")

    def xdotool(self, *words: str) -> str:
        run = subprocess.run(
            ["xdotool", *words], env=self.environment, capture_output=True, text=True, check=False
        )
        return run.stdout.strip()

    def focus_window_of(self, process: subprocess.Popen, patience: float) -> str:
        """Wait for a window of a process, give it the focus and return its number."""
        end = time.monotonic() + patience
        while not (window := self.xdotool("search", "--pid", str(process.pid))):
            assert time.monotonic() < end, "no window"
            assert process.poll() is None, "the process has ended"
            time.sleep(0.1)
        self.xdotool("windowfocus", window.split()[-1])
        return window

    def wait_for_end_of(self, window: str, patience: float) -> None:
        """Wait until a window is closed."""
        end = time.monotonic() + patience
        while self.xdotool("getwindowname", window.split()[-1]):
            assert time.monotonic() < end, "the window stays open"
            time.sleep(0.1)


@contextmanager
def display() -> Iterator[Display]:
    """Open a display, or skip the test with the reason."""
    for tool in ("Xvfb", "xdotool"):
        if shutil.which(tool) is None:
            missing(f"{tool} is not installed")
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    try:
        yield Display(f":{os.read(read, 16).decode().strip()}")
    finally:
        server.terminate()
        server.wait()
        os.close(read)
        os.close(write)
