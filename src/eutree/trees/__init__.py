"""Binary decision trees as values: structure, location of observations, splitting, merging."""

from typing import TYPE_CHECKING

from eutree.lazy import lazily
from eutree.trees.tree import DecisionTree

if TYPE_CHECKING:
    from eutree.trees._kernels import TreeNodes as TreeNodes  # these for other packages' loops
    from eutree.trees._kernels import descend as descend

__all__ = ["DecisionTree"]

__getattr__ = lazily(__name__, {"eutree.trees._kernels": "TreeNodes descend"})
