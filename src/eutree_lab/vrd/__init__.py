"""Variable resolution discretization: a grid of corners that is refined where it matters."""

from eutree_lab.vrd.method import VariableResolutionMethod

__all__ = ["VariableResolutionMethod"]
