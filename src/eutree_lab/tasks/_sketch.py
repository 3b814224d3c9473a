"""Plain pictures of small domains: boxes, lines and discs on a unit square.

A domain gives its shapes in coordinates from 0 to 1, x to the right and y up; here they become
pixels. pygame is imported where it is used; the extra ``record`` installs it.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats
from eutree.envs.painting import AGENT, GOAL_COLOR, OPPONENT, PAPER, PATH, SHADOW, import_pygame

__all__ = ["AGENT", "GOAL_COLOR", "OPPONENT", "PATH", "SHADOW", "Disc", "Line", "Patch", "Sketch"]

Color = tuple[int, ...]
SIZE, SMOOTHING, MARGIN = 400, 2, 0.04


class Patch(NamedTuple):
    """A filled rectangle between two corners."""

    low: tuple[float, float]
    high: tuple[float, float]
    color: Color = PATH


class Line(NamedTuple):
    """A line through points; width as a share of the picture's."""

    points: tuple[tuple[float, float], ...]
    color: Color = SHADOW
    width: float = 0.008


class Disc(NamedTuple):
    """A filled disc."""

    center: tuple[float, float]
    radius: float = 0.02
    color: Color = AGENT


Sketch = tuple[Patch | Line | Disc, ...]


def curve(x: Floats, y: Floats) -> tuple[tuple[float, float], ...]:
    """Return the points of a curve as a ``Line`` takes them."""
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def picture(sketch: Sketch) -> NDArray[np.uint8]:
    """Return a sketch as an image of shape [400, 400, 3]."""
    surface = _draw(sketch)
    return np.ascontiguousarray(import_pygame().surfarray.array3d(surface).transpose(1, 0, 2))


def show(sketch: Sketch, caption: str, frames_per_second: float) -> None:
    """Show a sketch in a window, which is opened at the first call, for the time of a frame."""
    pygame = import_pygame()
    pygame.display.init()
    window = pygame.display.get_surface() or pygame.display.set_mode((SIZE, SIZE))
    pygame.display.set_caption(caption)
    pygame.event.pump()
    window.blit(_draw(sketch), (0, 0))
    pygame.display.flip()
    pygame.time.wait(round(1000.0 / frames_per_second))


def close() -> None:
    """Close the window, if there is one."""
    import_pygame().display.quit()


def _draw(sketch: Sketch) -> Any:
    """Return the sketch as a surface of the final size; later shapes cover earlier ones."""
    pygame = import_pygame()
    large = SIZE * SMOOTHING
    surface = pygame.Surface((large, large), 0, 32)
    surface.fill(PAPER)
    inner = large * (1.0 - 2.0 * MARGIN)

    def at(point: tuple[float, float]) -> tuple[float, float]:
        return large * MARGIN + inner * point[0], large * (1.0 - MARGIN) - inner * point[1]

    for shape in sketch:
        if isinstance(shape, Patch):
            (left, bottom), (right, top) = at(shape.low), at(shape.high)
            rectangle = (round(left), round(top), round(right - left), round(bottom - top))
            pygame.draw.rect(surface, shape.color, rectangle)
        elif isinstance(shape, Line):
            width = max(1, round(shape.width * inner))
            pygame.draw.lines(surface, shape.color, False, [at(p) for p in shape.points], width)
        else:
            pygame.draw.circle(surface, shape.color, at(shape.center), shape.radius * inner)
    return pygame.transform.smoothscale(surface, (SIZE, SIZE))
