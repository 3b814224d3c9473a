"""Pages opened in a real browser, which reports what it logs and what it asks the network for."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests import patience

ENOUGH = patience.ENOUGH * 1000.0  # milliseconds
# The first is Chromium without windows and what belongs to them: half the work, the same pages.
BROWSERS = (
    "/usr/bin/chromium-headless-shell",
    "/usr/bin/chromium",
    "/usr/bin/chromium-browser",
    "/usr/bin/google-chrome",
)


@dataclass
class Opened:
    """A page and what happened while it was open."""

    page: Any
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def assert_quiet(self) -> None:
        assert self.messages == []
        assert [url for url in self.requests if not url.startswith(("file:", "data:"))] == []


def missing(reason: str) -> None:
    if os.environ.get("EUTREE_REQUIRE_TOOLS") == "1":
        pytest.fail(f"{reason}, and EUTREE_REQUIRE_TOOLS=1 asks for it")
    pytest.skip(reason)


@contextmanager
def browser() -> Iterator[Any]:
    """Start a headless browser, or skip the test with the reason."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("playwright is not installed")
    path = next((path for path in BROWSERS if Path(path).exists()), None)
    if path is None:
        missing("no Chromium is installed")
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(
            executable_path=path, args=["--no-sandbox", "--disable-gpu"]
        )
        yield started
        started.close()


def open_page(
    started: Any, path: Path, *, width: int = 1280, height: int = 800, scheme: str = "light"
) -> Opened:
    page = started.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
    page.set_default_timeout(ENOUGH)
    opened = Opened(page)
    page.on("console", lambda message: opened.messages.append(message.text))
    page.on("pageerror", lambda error: opened.messages.append(str(error)))
    page.on("request", lambda request: opened.requests.append(request.url))
    page.goto(path.as_uri())
    return opened


def grave_violations(page: Any, axe: str) -> list[tuple[str, str, list[str]]]:
    """Return what axe calls serious or critical on a page that admits its script."""
    page.evaluate(axe)
    violations = page.evaluate("axe.run().then(result => result.violations)")
    return [
        (entry["id"], entry["impact"], [node["html"][:200] for node in entry["nodes"][:3]])
        for entry in violations
        if entry["impact"] in ("serious", "critical")
    ]
