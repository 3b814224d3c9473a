"""Policies with SB3's ``predict``."""

from eutree.policies.leaf_statistics import LeafStatistics
from eutree.policies.tree_policy import Policy, TreePolicy

__all__ = ["LeafStatistics", "Policy", "TreePolicy"]
