"""Which leaves are tested in an expansion (Table 1)."""

from collections.abc import Iterable

import numpy as np

from eutree.arrays import Integers
from eutree.learners.history import History
from eutree.learners.u_tree.discretizer import Discretizer


class LeafTests:
    """Remembers what each leaf held when it was tested last.

    Args:
        method: How much a leaf must have grown to be tested again.
        n_leaves: Number of leaves.

    Attributes:
        tested_at: Transitions seen to leave each leaf at its last test, shape [L].
    """

    def __init__(self, method: Discretizer, n_leaves: int) -> None:
        self._method = method
        self.tested_at: Integers = np.zeros(n_leaves, dtype=np.int64)

    def due(self, history: History, locked: Iterable[int]) -> list[int]:
        """Return the leaves to test now: those that have grown enough since they were tested."""
        sizes = history.seen_leaving()[: self.tested_at.size]
        growth = self._method.retest_growth
        due = (sizes >= self.tested_at * growth) | (growth == 1.0)  # an estimate may fall
        due[list(locked)] = False
        self.tested_at[due] = sizes[due]
        leaves: list[int] = np.flatnonzero(due).tolist()
        return leaves

    def split(self, leaf: int) -> None:
        """Take note of a split of ``leaf``: both halves are new."""
        self.tested_at = np.append(self.tested_at, 0)
        self.tested_at[leaf] = 0

    def reset(self, n_leaves: int) -> None:
        """Forget the tests: there are other leaves."""
        self.tested_at = np.zeros(n_leaves, dtype=np.int64)
