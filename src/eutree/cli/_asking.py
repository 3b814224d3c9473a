"""Who is asked by ``eutree learn --ask``: a person at a page, or a scripted expert."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from eutree.cli._output import Output
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    import gymnasium

    from eutree.interaction.requests import Controller, Request

PERSON = "web"


def render_mode(ask: str | None) -> str | None:
    """Return how the environment must be made for whoever is asked."""
    if ask != PERSON:
        return None
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    return "rgb_array"


@contextmanager
def asked(
    ask: str | None,
    spec: EnvironmentSpec | None,
    env: "gymnasium.Env[Any, Any] | None",
    output: Output,
    *,
    stop: Callable[[], bool],
    keys: str | None,
    port: int | None,
) -> "Iterator[Controller | None]":
    """Yield whom to ask, or None; what they have opened is closed at the end."""
    if ask is None or spec is None or env is None:
        yield None
        return
    controller = _controller(ask, spec, env, output, stop=stop, keys=keys, port=port)
    try:
        yield controller
    finally:
        controller.close()


def _controller(
    ask: str,
    spec: EnvironmentSpec,
    env: "gymnasium.Env[Any, Any]",
    output: Output,
    *,
    stop: Callable[[], bool],
    keys: str | None,
    port: int | None,
) -> "Controller":
    if ask == PERSON:
        from eutree.interaction.browser import AskInBrowser

        def announce(request: "Request") -> None:
            output.say(
                f"request {request.number} of {request.of}, episode {request.episode} step "
                f"{request.step}: {request.text}"
            )

        page = AskInBrowser(env, keys=keys, port=port, stop=stop, on_request=announce)
        output.say(f"open {page.server.url}")
        return page
    from eutree.cli._controllers import controller
    from eutree.interaction.acting import as_policy
    from eutree.interaction.requests import controller_of

    return controller_of(as_policy(controller(ask, "--ask", spec), env))
