"""Ask a person in a window, which opens with each request and closes after it."""

from collections.abc import Callable
from typing import Any

import gymnasium

from eutree.interaction.ask_session import Desk
from eutree.interaction.keys import KeyMap
from eutree.interaction.requests import DECLINED, HANDED_BACK, Request, Stretch
from eutree.interaction.settings import SessionSettings
from eutree.interaction.window import Window


class AskInWindow:
    """A controller: a person at a window of this desktop.

    Args:
        env: The environment that is learned in, made with ``render_mode="rgb_array"``.
        keys: What the keys mean, as text or as a map; None for the environment's own.
        settings: Pace, countdown and so on.
        patience: Seconds in which a request must be answered; then learning goes on without.
        stop: Asked while a person is awaited; True raises KeyboardInterrupt in ``show``.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        *,
        keys: str | KeyMap | None = None,
        settings: SessionSettings | None = None,
        patience: float = 60.0,
        stop: Callable[[], bool] = lambda: False,
    ) -> None:
        self._env, self._stop = env, stop
        self._options: dict[str, Any] = {"keys": keys, "settings": settings, "patience": patience}

    def show(self, request: Request, stretch: Stretch) -> str:
        """Open a window and let the person act; closing it hands back.

        Raises:
            KeyboardInterrupt: ``stop`` wished it.
            EnvironmentFault: The environment broke its contract.
        """
        desk = Desk(self._env, **self._options)
        desk.put(request, stretch)
        window = Window(desk)
        try:
            while desk.is_open and not window.is_closed:
                if self._stop():
                    raise KeyboardInterrupt
                window.tick()
                window.pause()
        finally:
            window.close()
        if desk.session.fault is not None:
            raise desk.session.fault
        return HANDED_BACK if stretch.n_steps else DECLINED

    def close(self) -> None:
        """Do nothing: the window is closed."""
