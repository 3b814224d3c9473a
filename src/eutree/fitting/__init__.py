"""A tree from demonstrations that is played, compared with its demonstrator, and explained."""

from eutree.fitting.report import FitReport, Person, Standing

__all__ = ["FitReport", "Person", "Standing"]
