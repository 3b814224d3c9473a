"""For each leaf the stored transitions that left it, or that entered it.

Those that left it are T(s, a) of the paper, over all actions. They are linked in a list for each
leaf, so that a split of the leaf divides just its own, whatever else is stored.
"""

import numpy as np

from eutree.arrays import Booleans, Integers
from eutree.learners import _kernels
from eutree.learners.columns import Columns


class LeafRows:
    """The rows of each leaf on one side of the transitions.

    Args:
        columns: The store of transitions; its column ``side`` holds the leaf of each row, negative
            for none, its column ``side`` + "_link" is written here.
        side: "left" or "entered".
        n_leaves: Number of leaves.

    Attributes:
        lists: The lists, as compiled loops take them; other arrays after ``relist`` or ``split``.
    """

    def __init__(self, columns: Columns, side: str, n_leaves: int) -> None:
        self._columns, self._side, self._link = columns, side, f"{side}_link"
        self.lists = _no_rows(n_leaves)

    @property
    def counts(self) -> Integers:
        """How many rows each leaf has, shape [at least L]."""
        return self.lists.counts

    def of(self, leaf: int) -> Integers:
        """Return the rows of a leaf, ascending."""
        rows = np.empty(self.lists.counts[leaf], dtype=np.int64)
        link = self._columns.whole[self._link]
        _kernels.walk_list(int(self.lists.head[leaf]), link, rows)
        return rows

    def relist(self, n_leaves: int) -> None:
        """Make the lists from the leaves of all rows."""
        self.lists = _no_rows(n_leaves)
        leaves, link = (self._columns.whole[name] for name in (self._side, self._link))
        _kernels.append_to_lists(leaves, 0, self._columns.size, self.lists, link)

    def split(self, leaf: int, new_leaf: int, rows: Integers, goes_right: Booleans) -> None:
        """Give those of a leaf's rows that go right, shape [n], to a new leaf."""
        self.lists = _with_room(self.lists, new_leaf + 1)
        leaves, link = (self._columns.whole[name] for name in (self._side, self._link))
        _kernels.split_list(rows, goes_right, leaf, new_leaf, leaves, self.lists, link)


def _no_rows(n_leaves: int) -> _kernels.RowLists:
    """Return an empty list for each leaf."""
    return _kernels.RowLists(
        np.full(n_leaves, _kernels.NO_ROW, dtype=np.int64),
        np.full(n_leaves, _kernels.NO_ROW, dtype=np.int64),
        np.zeros(n_leaves, dtype=np.int64),
    )


def _with_room(lists: _kernels.RowLists, n_leaves: int) -> _kernels.RowLists:
    """Return the lists themselves if there is one for each leaf, else at least twice as many."""
    size = lists.counts.size
    if n_leaves <= size:
        return lists
    pairs = zip(lists, _no_rows(max(n_leaves - size, size)), strict=True)
    return _kernels.RowLists(*(np.append(old, new) for old, new in pairs))
