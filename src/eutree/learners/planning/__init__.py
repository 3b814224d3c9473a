"""``planning``: plan in model trees, and let what is planned prove itself."""

from eutree.learners.planning.learner import ModelPlanning, PlanningMethod

DEFAULT = PlanningMethod()

__all__ = ["DEFAULT", "ModelPlanning", "PlanningMethod"]
