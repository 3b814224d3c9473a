"""A tree from demonstrations that is played, compared with its demonstrator, and explained."""

from eutree.fitting.person import Person
from eutree.fitting.report import FitReport

__all__ = ["FitReport", "Person"]
