"""The leaf of a C4.5 tree that each case comes to; several, where a tested value is unknown."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Int32s, Integers
from eutree.c45 import _kernels_prediction
from eutree.c45._kernels_prediction import Branches
from eutree.errors import InvalidArgumentError


class Routes(NamedTuple):
    """What a case that is led down a tree meets; see ``C45Tree``."""

    n_features: int
    branches: Branches
    distribution: Floats  # [M, A]
    probability: Floats  # [M, A]
    label: Integers  # [M]


class RoutedCases:
    """Cases that were led down a tree.

    Args:
        tree: Where the cases are led.
        observations: The cases, shape [N, d].

    Attributes:
        leaf: Leaf (its node) of each case, -1 for fractional ones, shape [N].
        fractional: Numbers of the cases that come to several leaves, ascending.

    Raises:
        InvalidArgumentError: The cases have another number of attributes.
    """

    def __init__(self, tree: Routes, observations: ArrayLike) -> None:
        rows = np.ascontiguousarray(observations, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != tree.n_features:
            raise InvalidArgumentError(
                f"observations must have shape (N, {tree.n_features}), got {rows.shape}"
            )
        self._tree = tree
        self._rows = read_only(rows)
        self.leaf: Int32s = np.empty(len(rows), dtype=np.int32)
        n = _kernels_prediction.find_leaves(tree.branches, self._rows, self.leaf)
        self.fractional: Integers = np.flatnonzero(self.leaf < 0) if n else np.empty(0, np.int64)

    def main_leaf(self) -> Int32s:
        """Return the leaf of each case's largest share, shape [N]."""
        found = self.leaf.copy()
        if self.fractional.size:
            found[self.fractional] = self._shared_out()[1]
        return found

    def label(self) -> Integers:
        """Return the most probable class of each case, shape [N]."""
        found = self._tree.label[self.leaf]
        if self.fractional.size:
            found[self.fractional] = self._shared_out()[0].argmax(axis=1)
        return found

    def probability(self) -> Floats:
        """Return the share of each class at the leaf, or the leaves, of each case, shape [N, A]."""
        found = self._tree.probability[self.leaf]
        if self.fractional.size:
            found[self.fractional] = self._shared_out()[0]
        return found

    def _shared_out(self) -> tuple[Floats, Int32s]:
        """Return the probabilities of fractional cases, and the leaf of each's largest share."""
        tree, n = self._tree, self.fractional.size
        shares = np.zeros((n, tree.distribution.shape[1]))
        leaves = np.empty(n, dtype=np.int32)
        weight = tree.distribution.sum(axis=1)
        _kernels_prediction.share_out(
            tree.branches, weight, tree.probability, self._rows, self.fractional, shares, leaves
        )
        return shares, leaves


def read_only(array: Floats) -> Floats:
    """Return a read-only view: kernels are compiled anew for arrays that differ in this."""
    view = array.view()
    view.setflags(write=False)
    return view
