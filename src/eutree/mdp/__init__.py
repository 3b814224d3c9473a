"""The MDP over leaves: counts, Pr and R (Eqs. 3, 4), exact solving, prioritized sweeping."""

from eutree.mdp._kernels import DONE as DONE  # these three for the loops of other packages
from eutree.mdp._kernels_sweeping import MDPArrays as MDPArrays
from eutree.mdp._kernels_sweeping import observe as observe
from eutree.mdp.counts import TransitionCounts
from eutree.mdp.solver import NO_ACTION, TERMINAL, Model, Solution, solve
from eutree.mdp.tabular import TabularMDP

__all__ = ["NO_ACTION", "TERMINAL", "Model", "Solution", "TabularMDP", "TransitionCounts", "solve"]
