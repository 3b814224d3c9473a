"""A tree from demonstrations that is played, compared with its demonstrator, and explained."""

from eutree.fitting.person import Person
from eutree.fitting.report import FitReport
from eutree.fitting.verdict import Standing

__all__ = ["FitReport", "Person", "Standing"]
