"""Learning a tree: the Continuous U-Tree of Table 1, its three starts, its settings."""

from eutree.learning.expert_tree import fit_expert_tree
from eutree.learning.gates import AlwaysOpen, Gate
from eutree.learning.history import History, Relabelling
from eutree.learning.presets import DEFAULT, PAPER, PAPER_D, PRESETS, preset
from eutree.learning.settings import Settings
from eutree.learning.starts import LEARNERS, c_u_tree, eu_tree, eu_tree_dt
from eutree.learning.targets import LambdaReturn, OneStep, Target
from eutree.learning.u_tree import LeafSplit, UTree

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
