"""Binary decision trees as values: structure, location of observations, splitting, merging."""

from eutree.trees.tree import DecisionTree

__all__ = ["DecisionTree"]
