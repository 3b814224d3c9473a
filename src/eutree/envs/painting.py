"""The colours in which tasks are drawn, and pygame, imported where it is used."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.envs._dynamics import EvasionParameters, EvasionState, collides, reflect
from eutree.errors import needed

Color = tuple[int, ...]

PAPER = (250, 249, 246)
PATH = (223, 222, 215)
DOT = (190, 188, 180)
BAND = (242, 196, 106)
GATE = (214, 150, 40)
AGENT = (38, 98, 196)
OPPONENT = (222, 78, 62)
GOAL_COLOR = (52, 158, 96)
WHITE = (255, 255, 255)
SHADOW = (60, 56, 48)


def import_pygame() -> Any:
    """Return the module pygame, or raise MissingExtraError."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    with needed("pygame-ce", "record"):
        import pygame
        import pygame.surfarray  # pygame loads it only when asked
    return pygame


# Both axes have the same scale. The ring around the agent is drawn so that an opponent's disc
# touches it exactly at the collision distance. Behind each opponent is the way it came in the
# last second, fading: a person sees directions, the sensors do not.
#
# ``picture`` is a pure function of the state and needs no display. pygame is imported where it is
# used; the extra ``record`` installs it.


WIDTH, HEIGHT = 600, 400
SMOOTHING = 2  # drawn this much larger and scaled down, which smooths every edge
MARGIN_X, MARGIN_Y = 44.0, 26.0  # pixels around the paths

DISC = 0.55  # radius of an agent's disc [m]
MAIN_PATH_WIDTH = 0.62  # [m]
DOT_SPACING = 0.55  # between the dots of an opponent's path [m]
TRAIL_SECONDS, TRAIL_PIECES = 1.0, 28

FRAMES_PER_SECOND = 30  # of the window, between two steps


def picture(parameters: EvasionParameters, state: EvasionState) -> NDArray[np.uint8]:
    """Return the state as an image of shape [400, 600, 3]."""
    pygame = import_pygame()
    surface = _draw(parameters, state)
    return np.ascontiguousarray(pygame.surfarray.array3d(surface).transpose(1, 0, 2))


@dataclass(frozen=True)
class Scale:
    """From metres to pixels of the large picture."""

    pixels: float  # for one metre
    left: float
    middle: float

    @classmethod
    def fit(cls, parameters: EvasionParameters) -> "Scale":
        """Return the scale at which everything fits, the same for both axes, centred."""
        width, height = (WIDTH - 2 * MARGIN_X), (HEIGHT - 2 * MARGIN_Y)
        across = max(parameters.path_length, 2.0 * parameters.collision_distance) + 2.0 * DISC
        pixels = min(width / parameters.main_path_length, height / across) * SMOOTHING
        left = (WIDTH * SMOOTHING - parameters.main_path_length * pixels) / 2.0
        return cls(pixels=pixels, left=left, middle=HEIGHT * SMOOTHING / 2.0)

    def at(self, along: float, across: float = 0.0) -> tuple[float, float]:
        """Return the pixel of a point; positive ``across`` is up."""
        return self.left + along * self.pixels, self.middle - across * self.pixels


class Brush:
    """Translucent shapes in metres on a large surface."""

    def __init__(self, surface: Any, scale: Scale) -> None:
        self._pygame = import_pygame()
        self.surface = surface
        self.scale = scale

    def disc(
        self, along: float, across: float, radius: float, color: Color, alpha: int = 255
    ) -> None:
        """Fill a disc; ``radius`` in metres."""
        self._round(along, across, max(1, round(radius * self.scale.pixels)), color, alpha, 0)

    def ring(self, along: float, across: float, radius: float, color: Color, width: float) -> None:
        """Draw a circle whose outer edge is at ``radius``; both in metres."""
        pixels = max(2, round(radius * self.scale.pixels))
        self._round(along, across, pixels, color, 255, max(2, round(width * self.scale.pixels)))

    def box(
        self, low: tuple[float, float], high: tuple[float, float], color: Color, alpha: int = 255
    ) -> None:
        """Fill a rectangle given by two corners in metres, rounded at its ends."""
        (x0, y1), (x1, y0) = self.scale.at(*low), self.scale.at(*high)
        size = (max(2, round(x1 - x0)), max(2, round(y1 - y0)))
        layer = self._pygame.Surface(size, self._pygame.SRCALPHA)
        self._pygame.draw.rect(layer, (*color, alpha), ((0, 0), size), border_radius=min(size) // 2)
        self.surface.blit(layer, (round(x0), round(y0)))

    def _round(
        self, along: float, across: float, pixels: int, color: Color, alpha: int, width: int
    ) -> None:
        x, y = self.scale.at(along, across)
        layer = self._pygame.Surface((2 * pixels + 2, 2 * pixels + 2), self._pygame.SRCALPHA)
        self._pygame.draw.circle(layer, (*color, alpha), (pixels + 1, pixels + 1), pixels, width)
        self.surface.blit(layer, (round(x) - pixels - 1, round(y) - pixels - 1))


def _draw(parameters: EvasionParameters, state: EvasionState) -> Any:
    """Return the state as a surface of the final size."""
    pygame = import_pygame()
    brush = Brush(_backdrop(parameters).copy(), Scale.fit(parameters))
    _draw_trails(brush, parameters, state)
    _draw_agent(brush, parameters, state)
    for crossing, opponent in zip(parameters.crossing, state.opponents, strict=True):
        brush.disc(crossing, opponent - 0.08, DISC * 1.12, SHADOW, 40)
        brush.disc(crossing, opponent, DISC, OPPONENT)
        brush.disc(crossing, opponent, DISC * 0.32, WHITE, 235)
    return pygame.transform.smoothscale(brush.surface, (WIDTH, HEIGHT))


@lru_cache(maxsize=4)
def _backdrop(parameters: EvasionParameters) -> Any:
    """Return the large picture of all that does not move."""
    surface = import_pygame().Surface((WIDTH * SMOOTHING, HEIGHT * SMOOTHING), 0, 32)
    surface.fill(PAPER)
    brush = Brush(surface, Scale.fit(parameters))
    length, half = parameters.main_path_length, parameters.half_path
    wide = MAIN_PATH_WIDTH / 2.0
    brush.box((-wide, -wide), (length + wide, wide), PATH)
    for crossing in parameters.crossing:
        _draw_gate(brush, crossing, parameters.collision_distance, length)
    for crossing in parameters.crossing:
        for across in np.linspace(-half, half, max(3, round(2.0 * half / DOT_SPACING) + 1)):
            brush.disc(crossing, across, 0.09, DOT)
        for end in (-half, half):
            brush.disc(crossing, end, 0.2, DOT)
    brush.disc(0.0, 0.0, 0.62, PAPER)
    brush.ring(0.0, 0.0, 0.62, DOT, 0.16)
    for radius, color in ((1.05, GOAL_COLOR), (0.78, PAPER), (0.5, GOAL_COLOR)):
        brush.disc(length, 0.0, radius, color)  # the goal: a target of green rings
    return surface


def _draw_gate(brush: Brush, crossing: float, distance: float, length: float) -> None:
    """Mark where the main path is within reach of a crossing's opponent, and its gate line."""
    low, high = max(crossing - distance, 0.0), min(crossing + distance, length)
    wide = MAIN_PATH_WIDTH / 2.0
    brush.box((low, -wide), (high, wide), BAND, 110)
    if crossing - distance > 0.0:
        brush.box((low - 0.07, -1.25), (low + 0.07, 1.25), GATE)


def _draw_trails(brush: Brush, parameters: EvasionParameters, state: EvasionState) -> None:
    """Draw where the opponents came from, oldest and faintest first."""
    for piece in range(TRAIL_PIECES, 0, -1):
        age = piece / TRAIL_PIECES
        back = state.directions * (parameters.opponent_speed * TRAIL_SECONDS * age)
        places, _ = reflect(state.opponents - back, parameters.half_path)
        for crossing, place in zip(parameters.crossing, places, strict=True):
            brush.disc(crossing, place, DISC * (1.0 - 0.6 * age), OPPONENT, round(46 * (1.0 - age)))


def _draw_agent(brush: Brush, parameters: EvasionParameters, state: EvasionState) -> None:
    """Draw the agent in its ring: red in a collision, green at the goal."""
    position, color = float(state.position), AGENT
    if collides(parameters, state):
        color = OPPONENT
    elif position >= parameters.main_path_length:
        color = GOAL_COLOR
    radius = max(parameters.collision_distance - DISC, DISC * 1.25)
    brush.disc(position, 0.0, radius, color, 30)
    brush.ring(position, 0.0, radius, color, 0.1)
    brush.disc(position, -0.08, DISC * 1.12, SHADOW, 40)
    brush.disc(position, 0.0, DISC, color)
    brush.disc(position, 0.0, DISC * 0.32, WHITE, 235)


class Window:
    """A window that shows one picture after another."""

    def __init__(self) -> None:
        self._pygame = import_pygame()
        self._pygame.display.init()
        self._screen = self._pygame.display.set_mode((WIDTH, HEIGHT))
        self._pygame.display.set_caption("Evasion")
        self._clock = self._pygame.time.Clock()

    def animate(
        self,
        parameters: EvasionParameters,
        between: Callable[[float], EvasionState],
        seconds: float,
    ) -> None:
        """Show the way to the present state, which takes ``seconds``."""
        frames = max(1, round(seconds * FRAMES_PER_SECOND))
        for frame in range(1, frames + 1):
            self._pygame.event.pump()
            self._screen.blit(_draw(parameters, between(frame / frames)), (0, 0))
            self._pygame.display.flip()
            self._clock.tick(frames / seconds)

    def close(self) -> None:
        """Close the window and let go of the display."""
        self._pygame.display.quit()
