"""Quinlan's C4.5 release 8, usable alone: growing, collapsing, error-based pruning."""

from typing import TYPE_CHECKING

from eutree.c45.growing import C45Settings
from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.c45.growing import best_reductions, grow, warn_of_light
    from eutree.c45.tree import C45Tree

__all__ = ["C45Settings", "C45Tree", "best_reductions", "grow", "warn_of_light"]

__getattr__ = lazily(
    __name__,
    {"eutree.c45.growing": "best_reductions grow warn_of_light", "eutree.c45.tree": "C45Tree"},
)
