"""Settings shared by all tests."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

from tests.order import compiling_alone, parted

# Compiling a kernel takes seconds on its first call, and test machines are busy: no deadlines. In
# CI the same examples every time; elsewhere fresh ones, printed when they fail.
hypothesis.settings.register_profile(
    "eutree",
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
    print_blob=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("eutree")

# What fills the memory here, tests and types of kernels, lives to the end; looking through it for
# garbage as often as Python does otherwise takes a tenth of the time of all tests.
gc.set_threshold(50_000, 20, 100)

# Kernels are compiled at their first call: what is compared with plain Python must not be it.
os.environ.setdefault("EUTREE_JIT", "1")

# Without a display; matplotlib and SDL read these when they are imported.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")


def pytest_configure(config: pytest.Config) -> None:
    """Let the processes of xdist wait for each other's kernels rather than compile them again."""
    if hasattr(config, "workerinput") and os.environ["EUTREE_JIT"] != "0":
        from numba.core.compiler_lock import global_compiler_lock
        from numba.core.dispatcher import Dispatcher

        Dispatcher.compile = compiling_alone(Dispatcher.compile, global_compiler_lock)


@pytest.hookimpl(trylast=True)  # after those that take tests away
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let the processes of xdist begin with tests that compile different kernels."""
    n_processes = getattr(config, "workerinput", {}).get("workercount", 1)
    items[:] = parted(items, lambda item: item.path.parent.name, n_processes)


def pytest_collection_finish() -> None:
    """Leave what has been collected out of every later search for garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def proc() -> Path:
    """Return where Linux tells of processes and sockets; other systems have no such place."""
    path = Path("/proc")
    if not (path / "net" / "tcp").exists():
        pytest.skip("needs Linux's /proc")
    return path


@pytest.fixture(scope="module")
def module_browser() -> Iterator[Any]:
    """A browser for the tests of one module.

    Playwright cannot be started twice in a thread, and while it runs nothing else there may have an
    event loop: so a module has one, and it ends with it.
    """
    from tests.report.browser import browser

    with browser() as started:
        yield started


@pytest.fixture
def chromium(module_browser: Any) -> Iterator[Any]:
    """The module's browser; the pages that a test leaves open end with it, and cost no more."""
    yield module_browser
    for context in module_browser.contexts:
        context.close()
