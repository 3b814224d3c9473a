import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.export.tools import need
from tests.report.browser import browser, missing


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture(scope="session")
def axe() -> str:
    """Return axe-core from the cache, installed there once by npm; it is never vendored."""
    folder = Path.home() / ".cache" / "eutree-tests"
    script = folder / "node_modules" / "axe-core" / "axe.min.js"
    if not script.exists():
        folder.mkdir(parents=True, exist_ok=True)
        command = [need("npm"), "install", "--prefix", str(folder), "--no-audit", "axe-core@4"]
        try:
            subprocess.run(command, capture_output=True, check=True, timeout=60)
        except (subprocess.SubprocessError, OSError) as error:
            missing(f"axe-core cannot be installed: {error}")
    return script.read_text(encoding="utf-8")
