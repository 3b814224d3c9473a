"""Learning runs: gather, update, evaluate, race, and the public ``learn``."""

from eutree.training.checkpoint import stored_observations, stored_transitions
from eutree.training.handover import Judgement
from eutree.training.learn import learn
from eutree.training.phases import Phase, Plan
from eutree.training.result import LearningResult, StepCounts
from eutree.training.run import Run
from eutree.training.teaching import Teacher

__all__ = [
    "Judgement", "LearningResult", "Phase", "Plan", "Run", "StepCounts", "Teacher", "learn",
    "stored_observations", "stored_transitions",
]  # fmt: skip
