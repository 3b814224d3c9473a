"""Which leaves are tested in an expansion, and whether a cut of one of them is made (Table 1)."""

from collections.abc import Iterable

import numpy as np

from eutree.arrays import Integers
from eutree.learners.discretizer import Discretizer
from eutree.learners.gates import expected_gain
from eutree.learners.history import History
from eutree.splitting import LeafSample, Split


class LeafTests:
    """Remembers what each leaf held when it was tested last, and when the last split was.

    Args:
        method: How to cut a leaf, and how much it must have grown to be tested again.
        n_leaves: Number of leaves.

    Attributes:
        tested_at: Transitions seen to leave each leaf at its last test, shape [L].
        split_at: Transitions ever seen at the last split.
    """

    def __init__(self, method: Discretizer, n_leaves: int) -> None:
        self._method = method
        self.tested_at: Integers = np.zeros(n_leaves, dtype=np.int64)
        self.split_at = 0

    def due(self, history: History, locked: Iterable[int]) -> list[int]:
        """Return the leaves to test now: those that have grown enough since they were tested."""
        sizes = history.seen_leaving()[: self.tested_at.size]
        growth = self._method.retest_growth
        due = (sizes >= self.tested_at * growth) | (growth == 1.0)  # an estimate may fall
        due[list(locked)] = False
        self.tested_at[due] = sizes[due]
        leaves: list[int] = np.flatnonzero(due).tolist()
        return leaves

    def cut(
        self,
        leaf: int,
        sample: LeafSample,
        history: History,
        greedy: int,
        generator: np.random.Generator,
    ) -> Split | None:
        """Return the cut that a leaf deserves and that passes the gate, or None.

        One that the gate refuses is tested again next time.

        Args:
            leaf: The leaf.
            sample: What left it.
            history: All transitions stored so far.
            greedy: The action of the leaf.
            generator: Source of the chance of permutation tests.
        """
        split = self._method.cut(sample, generator)
        if split is None:
            return None

        def gain() -> float:
            share = history.seen_leaving()[leaf] / history.n_seen
            return expected_gain(split, sample, greedy, float(share))

        if self._method.gate.admits(gain, history.n_seen - self.split_at):
            return split
        self.tested_at[leaf] = 0
        return None

    def split(self, leaf: int, n_seen: int) -> None:
        """Take note of a split of ``leaf``, after so many transitions: both halves are new."""
        self.tested_at = np.append(self.tested_at, 0)
        self.tested_at[leaf] = 0
        self.split_at = n_seen

    def reset(self, n_leaves: int) -> None:
        """Forget the tests: there are other leaves."""
        self.tested_at = np.zeros(n_leaves, dtype=np.int64)
