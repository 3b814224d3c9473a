"""Learning a tree: the Continuous U-Tree of Table 1, its three starts, its settings."""

from eutree.learners.expert_tree import fit_expert_tree
from eutree.learners.gates import AlwaysOpen, Gate
from eutree.learners.history import History, Relabelling
from eutree.learners.presets import DEFAULT, PAPER, PAPER_D, PRESETS, preset
from eutree.learners.settings import Settings
from eutree.learners.starts import LEARNERS, c_u_tree, eu_tree, eu_tree_dt
from eutree.learners.targets import LambdaReturn, OneStep, Target
from eutree.learners.u_tree import LeafSplit, UTree

__all__ = [
    "DEFAULT",
    "LEARNERS",
    "PAPER",
    "PAPER_D",
    "PRESETS",
    "AlwaysOpen",
    "Gate",
    "History",
    "LambdaReturn",
    "LeafSplit",
    "OneStep",
    "Relabelling",
    "Settings",
    "Target",
    "UTree",
    "c_u_tree",
    "eu_tree",
    "eu_tree_dt",
    "fit_expert_tree",
    "preset",
]
