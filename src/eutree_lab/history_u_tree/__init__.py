"""A tree whose cuts may ask for what was observed and done before."""

from eutree_lab.history_u_tree.method import HistoryUTreeMethod

__all__ = ["HistoryUTreeMethod"]
