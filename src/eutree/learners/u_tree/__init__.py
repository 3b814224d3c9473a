"""``u-tree``: the learner of Table 1, and what another way of cutting leaves has to be."""

from eutree.learners.u_tree.discretizer import Discretizer
from eutree.learners.u_tree.learner import UTree, UTreeMethod, u_tree_parts
from eutree.learners.u_tree.presets import CORRECTED, PAPER, PAPER_D
from eutree.learners.u_tree.targets import LambdaReturn, OneStep, Target

__all__ = [
    "CORRECTED",
    "PAPER",
    "PAPER_D",
    "Discretizer",
    "LambdaReturn",
    "OneStep",
    "Target",
    "UTree",
    "UTreeMethod",
    "u_tree_parts",
]
