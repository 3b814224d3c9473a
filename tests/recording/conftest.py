"""A fixture of all tests of recording and acting."""

from collections.abc import Iterator
from importlib import resources

import pytest


@pytest.fixture(autouse=True)
def nobody_stays(request: pytest.FixtureRequest) -> Iterator[None]:
    """Close the pages of a test: left open, each draws on, and looks for its recorder, for good."""
    yield
    browser = request.node.funcargs.get("chromium")
    for context in browser.contexts if browser else []:
        context.close()


@pytest.fixture(scope="module")
def axe() -> str:
    """The script of axe-core."""
    package = pytest.importorskip("axe_playwright_python", reason="needs the test requirements")
    return (resources.files(package) / "axe.min.js").read_text(encoding="utf-8")
