"""A tree whose cuts may test previous observations and actions."""

from eutree_lab.history_u_tree.method import HistoryUTreeMethod

__all__ = ["HistoryUTreeMethod"]
