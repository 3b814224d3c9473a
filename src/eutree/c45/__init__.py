"""Quinlan's C4.5 release 8, usable alone: growing, collapsing, error-based pruning."""

from eutree.c45.learner import grow
from eutree.c45.settings import C45Settings
from eutree.c45.tree import C45Tree

__all__ = ["C45Settings", "C45Tree", "grow"]
