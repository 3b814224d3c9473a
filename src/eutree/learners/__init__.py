"""Learners of trees: the protocol, the methods, their presets.

A method and its preset are imported when they are asked for: who needs one type loads no learner.
"""

from typing import TYPE_CHECKING

from eutree.lazy import lazily
from eutree.learners.declared import Part, Stored
from eutree.learners.history import History, Relabelling
from eutree.learners.learner import (
    Decisions,
    LeafSplit,
    Learner,
    Method,
    Needs,
    Problem,
    Start,
    Step,
    Update,
)

if TYPE_CHECKING:
    from eutree.learners.distilled_dqn import DistilledDQN
    from eutree.learners.planning import DEFAULT, ModelPlanning, PlanningMethod
    from eutree.learners.registry import METHODS, PRESETS, method, register
    from eutree.learners.starts import STARTS, fit_expert_tree, start_of
    from eutree.learners.u_tree import (
        CORRECTED,
        PAPER,
        PAPER_D,
        LambdaReturn,
        OneStep,
        Target,
        UTree,
        UTreeMethod,
    )

__all__ = [
    "CORRECTED", "DEFAULT", "METHODS", "PAPER", "PAPER_D", "PRESETS", "STARTS", "Decisions",
    "DistilledDQN", "History", "LambdaReturn", "LeafSplit", "Learner", "Method", "ModelPlanning",
    "Needs", "OneStep", "Part", "PlanningMethod", "Problem", "Relabelling", "Start", "Step",
    "Stored", "Target", "UTree", "UTreeMethod", "Update", "fit_expert_tree", "method", "register",
    "start_of",
]  # fmt: skip

__getattr__ = lazily(
    __name__,
    {
        "eutree.learners.distilled_dqn": "DistilledDQN",
        "eutree.learners.planning": "DEFAULT ModelPlanning PlanningMethod",
        "eutree.learners.registry": "METHODS PRESETS method register",
        "eutree.learners.starts": "STARTS fit_expert_tree start_of",
        "eutree.learners.u_tree": (
            "CORRECTED LambdaReturn OneStep PAPER PAPER_D Target UTree UTreeMethod"
        ),
    },
)
