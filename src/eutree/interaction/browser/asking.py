"""Ask a person in a browser: the recorder's page, open while a learner learns."""

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import gymnasium

from eutree.interaction.ask_session import Desk
from eutree.interaction.browser.server import PageServer
from eutree.interaction.keys import KeyMap
from eutree.interaction.requests import DECLINED, HANDED_BACK, Request, Stretch
from eutree.interaction.settings import SessionSettings

_POLL_SECONDS = 0.1


class AskInBrowser:
    """A controller: a person at a page, which a thread of this process serves.

    While a stretch is under way the learner waits and the page's thread takes the steps; at all
    other times the page says that the learner practises.

    Args:
        env: The environment that is learned in, made with ``render_mode="rgb_array"``.
        keys: What the keys mean, as text or as a map; None for the environment's own.
        settings: Pace, countdown and so on.
        patience: Seconds in which a request must be answered; then learning goes on without.
        host: Address to bind to.
        port: Port; None for 8765 or the next free one, 0 for any.
        stop: Asked while a person is awaited; True raises KeyboardInterrupt in ``show``.
        on_request: Called with each request, before the person sees it.

    Attributes:
        server: The page's server; its ``url`` is the address to open.

    Raises:
        InvalidArgumentError: The port is taken, or the address is not this machine's.
        MissingExtraError: The extra ``record`` is not installed.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        *,
        keys: str | KeyMap | None = None,
        settings: SessionSettings | None = None,
        patience: float = 60.0,
        host: str = "127.0.0.1",
        port: int | None = None,
        stop: Callable[[], bool] = lambda: False,
        on_request: Callable[[Request], None] = lambda request: None,
    ) -> None:
        self._desk = Desk(env, keys=keys, settings=settings, patience=patience)
        self._stop, self._on_request = stop, on_request
        self._ready = threading.Event()
        self._error: BaseException | None = None
        self.server = PageServer(self._desk, host=host, port=port, details={"asks": True})
        self._thread = threading.Thread(target=self._serve, name="eutree page", daemon=True)
        self._thread.start()
        self._ready.wait()
        self._raise_error()

    def show(self, request: Request, stretch: Stretch) -> str:
        """Let the person act; return how they left it.

        Raises:
            KeyboardInterrupt: ``stop`` wished it.
            EnvironmentFault: The environment broke its contract.
        """
        self._on_request(request)
        self._desk.put(request, stretch)
        while self._desk.is_open:
            if self._stop():
                raise KeyboardInterrupt
            self._raise_error()
            self._thread.join(_POLL_SECONDS)
        self._raise_error()
        return HANDED_BACK if stretch.n_steps else DECLINED

    def close(self) -> None:
        """Say goodbye to the page and stop serving it."""
        self._desk.finish()
        self._thread.join(10.0)

    def _serve(self) -> None:
        try:
            asyncio.run(self.server.run(lambda server: self._ready.set()))
        except BaseException as error:
            self._error = error
        finally:
            self._ready.set()

    def _raise_error(self) -> None:
        error = self._error or self._desk.session.fault
        if error is not None:
            raise error
