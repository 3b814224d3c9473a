"""Learners of trees: the protocol, the methods, their presets."""

from eutree.learners.declared import Part, Stored
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.expert_tree import fit_expert_tree
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
from eutree.learners.model_planning import ModelPlanning, PlanningMethod
from eutree.learners.presets import CORRECTED, DEFAULT, PAPER, PAPER_D, PRESETS
from eutree.learners.registry import METHODS, method, preset, register
from eutree.learners.starts import STARTS, start_of
from eutree.learners.targets import LambdaReturn, OneStep, Target
from eutree.learners.u_tree import UTree, UTreeMethod

__all__ = [
    "CORRECTED",
    "DEFAULT",
    "METHODS",
    "PAPER",
    "PAPER_D",
    "PRESETS",
    "STARTS",
    "Decisions",
    "DistilledDQN",
    "History",
    "LambdaReturn",
    "LeafSplit",
    "Learner",
    "Method",
    "ModelPlanning",
    "Needs",
    "OneStep",
    "Part",
    "PlanningMethod",
    "Problem",
    "Relabelling",
    "Start",
    "Step",
    "Stored",
    "Target",
    "UTree",
    "UTreeMethod",
    "Update",
    "fit_expert_tree",
    "method",
    "preset",
    "register",
    "start_of",
]
