"""Binary decision trees as values: structure, location of observations, splitting, merging."""

from eutree.trees._kernels import TreeNodes as TreeNodes  # these two for other packages' loops
from eutree.trees._kernels import descend as descend
from eutree.trees.tree import DecisionTree

__all__ = ["DecisionTree"]
