"""The colours in which tasks are drawn, and pygame, imported where it is used."""

import os
from typing import Any

from eutree.errors import MissingExtraError

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
    try:
        import pygame
        import pygame.surfarray  # pygame loads it only when asked
    except ImportError:
        raise MissingExtraError("pygame-ce", "record") from None
    return pygame
