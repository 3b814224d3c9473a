"""The pictures of a session: which one is due, which was given out, which the viewer has drawn."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.errors import EnvironmentFault, described
from eutree.interaction.events import Frame
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.pace import FRAME_SECONDS

VIEWER_SECONDS = 1.5  # a viewer that draws nothing for so long has been lost
LAST_SECONDS = 1.0  # for a viewer to draw the last picture of an episode, before it is spoken of
_TOLERANCE = 1e-9


class Pictures:
    """Renders an environment and numbers the pictures from 1.

    An environment with ``render_between(share)`` moves between two steps.

    Args:
        env: The environment, made with ``render_mode="rgb_array"``.

    Attributes:
        given: Number of the last picture given out.
        drawn: Number of the last picture that the viewer reported as drawn.
        is_complete: Whether the full picture of the present step was given out.
        size: Width and height of the pictures; zero before the first.
    """

    def __init__(self, env: GuardedEnv) -> None:
        self._env = env
        self._between: Callable[[float], Any] | None = getattr(
            env.env.unwrapped, "render_between", None
        )
        self.given = self.drawn = 0
        self.is_complete = False
        self.size = (0, 0)
        self._given_time = self._drawn_time = 0.0
        self._shared = 0.0  # share of the movement in the last picture

    def expect(self) -> None:
        """Take note that the environment has changed: a new picture is due."""
        self.is_complete, self._shared = False, 0.0

    def next(self, now: float, share: float) -> Frame | None:
        """Return a new picture if one is due; ``share`` of the movement is over."""
        share = share if self._between is not None else 1.0
        too_soon = now < self._given_time + FRAME_SECONDS - _TOLERANCE
        if self.is_complete or share <= self._shared or (share < 1.0 and too_soon):
            return None
        self._shared, self.is_complete = share, share >= 1.0
        if self.given == self.drawn:
            self._drawn_time = now  # from now on an answer is awaited
        self.given += 1
        late = now - self.due()
        # A small delay does not add up, or thirty pictures a second would become fewer.
        self._given_time = now - late if 0.0 <= late < FRAME_SECONDS / 2.0 else now
        return Frame(self.given, self._render(share))

    def due(self) -> float:
        """Return when the next picture of a movement is due."""
        return self._given_time + FRAME_SECONDS

    def saw(self, number: int, now: float) -> None:
        """Take note that the viewer has drawn a picture."""
        if self.drawn < number <= self.given:
            self.drawn, self._drawn_time = number, now

    def facts(self) -> dict[str, int]:
        """Return what is stored with a step: the picture drawn last, and the one given out."""
        return {"frame": self.drawn, "picture": self.given}

    def are_seen(self, now: float) -> bool:
        """Return whether the viewer has drawn all that was given out, or has had the time to."""
        return self.given == self.drawn or now > self._given_time + LAST_SECONDS

    def wait_from(self, now: float) -> None:
        """Give the viewer time from now on."""
        self._drawn_time = now

    def is_unanswered(self, now: float) -> bool:
        """Return whether the viewer has drawn nothing for too long."""
        return self.given > self.drawn and now > self._drawn_time + VIEWER_SECONDS

    def _render(self, share: float) -> NDArray[np.uint8]:
        try:
            if self._between is not None and share < 1.0:
                picture = self._between(share)
            else:
                picture = self._env.env.render()
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            raise self._fault(f"render raised {described(error)}") from error
        pixels = np.asarray(picture)
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype != np.uint8:
            raise self._fault(
                "render must return an image [height, width, 3] of uint8, got "
                f"shape {pixels.shape} of {pixels.dtype}"
            )
        self.size = (pixels.shape[1], pixels.shape[0])
        return pixels

    def _fault(self, reason: str) -> EnvironmentFault:
        return EnvironmentFault(self._env.name, self._env.episode, self._env.step_number, reason)
