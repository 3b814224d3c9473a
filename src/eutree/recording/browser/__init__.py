"""The recorder's page: one port of this machine serves the page and its socket."""

import asyncio
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from eutree.errors import interrupt
from eutree.recording.browser.server import PageServer
from eutree.recording.recorder import Recorder
from eutree.recording.tree_making import Guide, TreeMaker

__all__ = ["PageServer", "record_in_browser"]


def record_in_browser(
    recorder: Recorder,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    details: dict[str, Any] | None = None,
    maker: TreeMaker | None = None,
    guide: Guide | None = None,
    on_ready: Callable[[PageServer], None] | None = None,
) -> None:
    """Let a person record in a browser until the session is over.

    Args:
        recorder: The session and its folder.
        host: Address to bind to.
        port: Port; None for 8765 or the next free one, 0 for any.
        details: Further facts for the page to show.
        maker: Makes a tree of the recording; ``settings.makes`` of the recorder offers it.
        guide: Leads the person; None where they lead themselves.
        on_ready: Called once the port is open; ``url`` of its argument is the page's address.

    Raises:
        EnvironmentFault: The environment broke its contract; all recorded steps are stored.
        FileError: The folder can no longer be written; all earlier steps are stored.
    """

    async def serve_page() -> None:
        server = PageServer(
            recorder, host=host, port=port, details=details, maker=maker, guide=guide
        )
        await server.run(on_ready)

    with _orderly_end():
        try:
            asyncio.run(serve_page())
        finally:
            recorder.close()
    recorder.raise_failure()


@contextmanager
def _orderly_end() -> Iterator[None]:
    """Let SIGTERM raise SystemExit(143) where nothing else handles it.

    SDL, which draws many environments, otherwise takes the signal for itself and ignores it. Ctrl-C
    of the command line is left to asyncio, which ends its tasks in order.
    """
    is_main = threading.current_thread() is threading.main_thread()
    handlers: list[tuple[int, Any, Any]] = [
        (signal.SIGINT, interrupt, signal.default_int_handler),
        (signal.SIGTERM, signal.SIG_DFL, _exit),
    ]
    replaced = [one for one in handlers if is_main and signal.getsignal(one[0]) is one[1]]
    for number, _, here in replaced:
        signal.signal(number, here)
    try:
        yield
    finally:
        for number, before, _ in replaced:
            signal.signal(number, before)


def _exit(number: int, frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
