"""The transition history, and for each leaf which transitions left and which entered it.

Rows of one episode are stored one after the other; where a bounded history has left some out,
``continues`` tells which rows still follow the row before them. Each leaf has two lists of rows,
those that left it (T(s, a) of the paper, over all actions) and those that entered it; a split of
the leaf divides just these two lists, whatever else is stored.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import machine_code
from eutree.errors import InvalidArgumentError
from eutree.learners import _kernels
from eutree.learners.forgetting import WHOLE, Forgetting, LeafReservoirs
from eutree.trees import DecisionTree

TERMINAL = _kernels.TERMINAL
_GROWTH = 1.25
_STORED = ("observations", "next_observations", "actions", "rewards", "episodes", "continues")


@dataclass(frozen=True, eq=False)
class Relabelling:
    """The rows whose leaves a split has changed, with the old and the new leaves."""

    rows: Integers  # [n], ascending
    leaving: Integers  # [m], ascending: those of the rows that left the leaf
    old_left: Int32s  # [n]
    old_entered: Int32s  # [n]
    new_left: Int32s  # [n]
    new_entered: Int32s  # [n]


class History:
    """All stored transitions of a learner.

    Args:
        n_features: Number of features d of an observation.
        n_leaves: Number of leaves of the tree whose leaves label the rows.
        forgetting: What is left out when there is too much; None stores everything.

    Attributes:
        size: Number of transitions N.
        n_seen: Number of transitions ever appended, with those that were left out.
        n_episodes: Number of episodes stored.
    """

    def __init__(
        self, n_features: int, n_leaves: int, forgetting: Forgetting | None = None
    ) -> None:
        self.size = 0
        self.n_seen = 0
        self.n_episodes = 0
        self._forgetting = forgetting
        self._columns: dict[str, NDArray[Any]] = {
            "observations": np.empty((64, n_features)),
            "next_observations": np.empty((64, n_features)),
            "actions": np.empty(64, dtype=np.int32),
            "rewards": np.empty(64),
            "episodes": np.empty(64, dtype=np.int32),
            "continues": np.empty(64, dtype=np.bool_),
            "left": np.empty(64, dtype=np.int32),
            "entered": np.empty(64, dtype=np.int32),
            "demonstrated": np.empty(64, dtype=np.bool_),
            "_left_link": np.empty(64, dtype=np.int64),
            "_entered_link": np.empty(64, dtype=np.int64),
        }
        if forgetting is not None:
            self._columns["lots"] = np.empty(64, dtype=np.uint32)
        self._lists = {side: _no_rows(n_leaves) for side in ("left", "entered")}
        self._append: Callable[..., int] | None = None
        self._bind()

    def __len__(self) -> int:
        """Return the number of transitions N."""
        return self.size

    @property
    def observations(self) -> Floats:
        """Observation o of each transition, shape [N, d]; a view."""
        return self._view("observations")

    @property
    def next_observations(self) -> Floats:
        """Observation o' of each transition, shape [N, d]; a view."""
        return self._view("next_observations")

    @property
    def actions(self) -> Int32s:
        """Action of each transition, shape [N]; a view."""
        return self._view("actions")

    @property
    def rewards(self) -> Floats:
        """Reward of each transition, shape [N]; a view."""
        return self._view("rewards")

    @property
    def episodes(self) -> Int32s:
        """Number of the episode of each transition among those stored, shape [N]; a view."""
        return self._view("episodes")

    @property
    def continues(self) -> Booleans:
        """Whether each transition came right after the one before it, shape [N]; a view."""
        return self._view("continues")

    @property
    def left(self) -> Int32s:
        """Leaf L(o) that each transition left, shape [N]; a view."""
        return self._view("left")

    @property
    def entered(self) -> Int32s:
        """Leaf L(o') that each transition entered, ``TERMINAL`` at the end; shape [N]; a view."""
        return self._view("entered")

    @property
    def demonstrated(self) -> Booleans:
        """Whether somebody else showed each transition, shape [N]; a view."""
        return self._view("demonstrated")

    @property
    def n_bytes_per_transition(self) -> float:
        """Bytes of memory for each stored transition, spare capacity included."""
        total = sum(column.nbytes for column in self._columns.values())
        return total / max(self.size, 1)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return what the history holds; its labels and lists follow from the tree."""
        state = {
            **{name: self._view(name) for name in _STORED},
            "terminal": self.entered == TERMINAL,
            "n_episodes": np.array([self.n_episodes]),
            "n_seen": np.array([self.n_seen]),
        }
        if self.demonstrated.any():
            state["demonstrated"] = self.demonstrated
        if self._forgetting is not None:
            state |= {"lots": self._view("lots"), "bounds": self._forgetting.bounds}
        return state

    @classmethod
    def from_state(
        cls,
        state: Mapping[str, NDArray[Any]],
        tree: DecisionTree,
        forgetting: Forgetting | None = None,
    ) -> "History":
        """Return the history whose ``state()`` this was, labelled by ``tree``."""
        history = cls(tree.n_features, tree.n_leaves, forgetting)
        size = len(state["rewards"])
        history._reserve(size)
        history.size, history.n_episodes = size, int(state["n_episodes"][0])
        history.n_seen = int(state["n_seen"][0])
        for name in _STORED:
            history._view(name)[:] = state[name]
        if forgetting is not None:
            history._view("lots")[:] = state["lots"]
            forgetting.bounds = np.array(state["bounds"])
        history.entered[:] = np.where(state["terminal"], TERMINAL, 0)
        history.demonstrated[:] = state.get("demonstrated", False)
        history._label(tree)
        return history

    def append_episode(
        self,
        observations: Floats,  # [T + 1, d]
        actions: Integers,  # [T]
        rewards: Floats,  # [T]
        leaves: Int32s,  # [T + 1]
        *,
        terminated: bool,
        demonstrated: Booleans | bool = False,  # [T]
        generator: np.random.Generator | None = None,
    ) -> Booleans:
        """Store the transitions of one episode, with the leaves of its observations.

        The lots of a bounded history come from ``generator``; without one they follow from the
        number of transitions seen before.

        Returns:
            Which of the transitions are stored, shape [T].
        """
        episode = _kernels.EpisodeRows(
            np.ascontiguousarray(observations, dtype=np.float64),
            np.ascontiguousarray(actions, dtype=np.int64),
            np.ascontiguousarray(rewards, dtype=np.float64),
            np.ascontiguousarray(leaves, dtype=np.int32),
            np.ascontiguousarray(
                demonstrated if np.ndim(demonstrated) else np.full(len(actions), demonstrated),
                dtype=np.bool_,
            ),
        )
        steps = len(actions)
        if [len(column) for column in episode] != [steps + 1, steps, steps, steps + 1, steps]:
            raise InvalidArgumentError(
                f"an episode of {steps} actions must have as many rewards and one more "
                f"observation and leaf, got {[len(column) for column in episode]}"
            )
        stored, lots = np.ones(steps, dtype=np.bool_), np.empty(0, dtype=np.uint32)
        if self._forgetting is not None:
            lots = self._forgetting.draw(steps, generator or np.random.default_rng(self.n_seen))
            stored = self._forgetting.admits(episode.leaves[:-1], actions, lots)
        first, last = self.size, self.size + int(stored.sum())
        self._reserve(last)
        if self._forgetting is not None:
            self._columns["lots"][first:last] = lots[stored]
        lists = self._lists["left"], self._lists["entered"]
        call = (self._stored, *lists, episode, stored, first, self.n_episodes, terminated)
        if self._append is None:
            self._append = machine_code(_kernels.append_rows, *call)
        self.size = self._append(*call)
        self.n_seen += steps
        self.n_episodes += 1
        return stored

    def forget(self) -> Integers | None:
        """Forget what is too much, and number the episodes that stay from 0.

        Returns:
            The former numbers of the episodes that stay, ascending; None if nothing is too much.
        """
        rule = self._forgetting
        if rule is None or self.size <= rule.max_transitions:
            return None
        stay = rule.keeps(self.left, self.actions, self.episodes, self._view("lots"))
        self.continues[1:] &= stay[:-1]
        size = int(stay.sum())
        for column in self._columns.values():
            column[:size] = column[: self.size][stay]
        self.size = size
        kept, self.episodes[:] = np.unique(self.episodes, return_inverse=True)
        self.n_episodes = kept.size
        self._relist(len(self._lists["left"].counts))
        return kept.astype(np.int64)

    def rows_leaving(self, leaf: int) -> Integers:
        """Return the rows of the transitions that left ``leaf``, ascending."""
        return self._rows("left", leaf)

    def rows_entering(self, leaf: int) -> Integers:
        """Return the rows of the transitions that entered ``leaf``, ascending."""
        return self._rows("entered", leaf)

    def counts_leaving(self) -> Integers:
        """Return how many transitions left each leaf, shape [at least L]."""
        return self._lists["left"].counts

    def seen_leaving(self) -> Integers:
        """Return how many transitions left each leaf, estimated where some were left out, [L]."""
        rule = self._forgetting
        if not isinstance(rule, LeafReservoirs):
            return self.counts_leaving()
        n_actions = rule.bounds.shape[1]
        cells = self.left.astype(np.int64) * n_actions + self.actions
        stored = np.bincount(cells, minlength=rule.bounds.size).reshape(-1, n_actions)
        seen = (stored * (WHOLE / rule.bounds)).sum(axis=1)
        whole: Integers = seen.astype(np.int64)
        return whole

    def split(self, leaf: int, new_leaf: int, feature: int, threshold: float) -> Relabelling:
        """Relabel the rows that left or entered ``leaf`` after its split at ``threshold``.

        Rows with ``x[feature] <= threshold`` keep ``leaf``, the others get ``new_leaf``.
        """
        leaving, entering = self.rows_leaving(leaf), self.rows_entering(leaf)
        rows = np.empty(leaving.size + entering.size, dtype=np.int64)
        rows = rows[: _kernels.merge(leaving, entering, rows)]
        self._begin_anew(leaving, new_leaf + 1, [leaf, new_leaf])
        old_left, old_entered = self.left[rows], self.entered[rows]
        self._lists = {side: _with_room(lists, new_leaf + 1) for side, lists in self._lists.items()}
        self._split_list(
            "left", leaving, ~(self.observations[leaving, feature] <= threshold), leaf, new_leaf
        )
        goes_right = ~(self.next_observations[entering, feature] <= threshold)
        self._split_list("entered", entering, goes_right, leaf, new_leaf)
        return Relabelling(
            rows, leaving, old_left, old_entered, self.left[rows], self.entered[rows]
        )

    def relabel(self, tree: DecisionTree) -> None:
        """Label all rows anew from ``tree``; used when a tree is merged or replaced."""
        self._begin_anew(np.arange(self.size), tree.n_leaves, None)
        self._label(tree)

    def _begin_anew(self, rows: Integers, n_leaves: int, leaves: list[int] | None) -> None:
        """Let reservoirs whose leaf is changing, and whose rows these are, take in all again."""
        rule = self._forgetting
        if rule is not None:
            lots = self._view("lots")
            lots[rows] = rule.spread(self.left[rows], self.actions[rows], lots[rows])
            rule.begin_anew(n_leaves, leaves)

    def _label(self, tree: DecisionTree) -> None:
        """Write the leaves of all rows, and the lists of rows."""
        terminal = self.entered == TERMINAL
        self.left[:] = tree.leaf_index(self.observations)
        self.entered[:] = tree.leaf_index(self.next_observations)
        self.entered[terminal] = TERMINAL
        self._relist(tree.n_leaves)

    def _relist(self, n_leaves: int) -> None:
        """Make the lists of rows anew from the labels."""
        self._lists = {side: _no_rows(n_leaves) for side in ("left", "entered")}
        self._append_to_lists(0, self.size)

    def _view(self, name: str) -> NDArray[Any]:
        return self._columns[name][: self.size]

    def _reserve(self, size: int) -> None:
        """Make room for ``size`` rows."""
        capacity = len(self._columns["rewards"])
        if size <= capacity:
            return
        spare = int(capacity * _GROWTH) + 1
        if self._forgetting is not None:
            spare = min(spare, self._forgetting.max_transitions)
        capacity = max(size, spare)
        for name, column in self._columns.items():
            grown = np.empty((capacity, *column.shape[1:]), dtype=column.dtype)
            grown[: self.size] = column[: self.size]
            self._columns[name] = grown
        self._bind()

    def _bind(self) -> None:
        """Keep the columns together, as the kernel takes them."""
        columns = [name for name in self._columns if name != "lots"]
        self._stored = _kernels.StoredRows(*(self._columns[name] for name in columns))

    def _append_to_lists(self, first: int, last: int) -> None:
        for side, lists in self._lists.items():
            _kernels.append_to_lists(
                self._columns[side],
                first,
                last,
                lists.head,
                lists.tail,
                lists.counts,
                self._columns[f"_{side}_link"],
            )

    def _rows(self, side: str, leaf: int) -> Integers:
        lists = self._lists[side]
        rows = np.empty(lists.counts[leaf], dtype=np.int64)
        _kernels.walk_list(int(lists.head[leaf]), self._columns[f"_{side}_link"], rows)
        return rows

    def _split_list(
        self, side: str, rows: Integers, goes_right: Booleans, leaf: int, new_leaf: int
    ) -> None:
        lists = self._lists[side]
        _kernels.split_list(
            rows,
            goes_right,
            leaf,
            new_leaf,
            self._columns[side],
            lists.head,
            lists.tail,
            lists.counts,
            self._columns[f"_{side}_link"],
        )


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
