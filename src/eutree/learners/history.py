"""The transition history, and for each leaf which transitions left and which entered it.

Rows of one episode are stored one after the other; where a bounded history has left some out,
``continues`` tells which rows still follow the row before them. Each leaf has two lists of rows,
those that left it (T(s, a) of the paper, over all actions) and those that entered it; a split of
the leaf divides just these two lists, whatever else is stored.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.learners import _kernels
from eutree.learners.forgetting import WHOLE, Forgetting, LeafReservoirs
from eutree.trees import DecisionTree

TERMINAL = -1
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
        self._lists = {side: _Lists(n_leaves) for side in ("left", "entered")}

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
        steps = len(actions)
        entered = np.array(leaves[1:])
        if terminated and steps:
            entered[-1] = TERMINAL
        new: dict[str, Any] = {
            "observations": observations[:-1],
            "next_observations": observations[1:],
            "actions": actions,
            "rewards": rewards,
            "episodes": self.n_episodes,
            "continues": np.arange(steps) > 0,
            "left": leaves[:-1],
            "entered": entered,
            "demonstrated": demonstrated,
        }
        stored = np.ones(steps, dtype=np.bool_)
        if self._forgetting is not None:
            chance = generator or np.random.default_rng(self.n_seen)
            new["lots"] = self._forgetting.draw(steps, chance)
            stored = self._forgetting.admits(leaves[:-1], actions, new["lots"])
            new["continues"][1:] &= stored[:-1]
        first, last = self.size, self.size + int(stored.sum())
        self._reserve(last)
        for name, values in new.items():
            whole = last - first == steps or np.ndim(values) == 0
            self._columns[name][first:last] = values if whole else values[stored]
        self._append_to_lists(first, last)
        self.size = last
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
        self._relist(len(self._lists["left"].count))
        return kept.astype(np.int64)

    def rows_leaving(self, leaf: int) -> Integers:
        """Return the rows of the transitions that left ``leaf``, ascending."""
        return self._rows("left", leaf)

    def rows_entering(self, leaf: int) -> Integers:
        """Return the rows of the transitions that entered ``leaf``, ascending."""
        return self._rows("entered", leaf)

    def counts_leaving(self) -> Integers:
        """Return how many transitions left each leaf, shape [at least L]."""
        return self._lists["left"].count

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
        for lists in self._lists.values():
            lists.reserve(new_leaf + 1)
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
        self._lists = {side: _Lists(n_leaves) for side in ("left", "entered")}
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

    def _append_to_lists(self, first: int, last: int) -> None:
        for side, lists in self._lists.items():
            _kernels.append_to_lists(
                self._columns[side],
                first,
                last,
                lists.head,
                lists.tail,
                lists.count,
                self._columns[f"_{side}_link"],
            )

    def _rows(self, side: str, leaf: int) -> Integers:
        lists = self._lists[side]
        rows = np.empty(lists.count[leaf], dtype=np.int64)
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
            lists.count,
            self._columns[f"_{side}_link"],
        )


class _Lists:
    """Head, tail and length of one linked list of rows for each leaf."""

    def __init__(self, n_leaves: int) -> None:
        self.head = np.full(n_leaves, _kernels.NO_ROW, dtype=np.int64)  # [L]
        self.tail = np.full(n_leaves, _kernels.NO_ROW, dtype=np.int64)  # [L]
        self.count = np.zeros(n_leaves, dtype=np.int64)  # [L]

    def reserve(self, n_leaves: int) -> None:
        """Make room for ``n_leaves`` lists."""
        missing = n_leaves - self.count.size
        if missing > 0:
            grow = max(missing, self.count.size)
            self.head = np.append(self.head, np.full(grow, _kernels.NO_ROW, dtype=np.int64))
            self.tail = np.append(self.tail, np.full(grow, _kernels.NO_ROW, dtype=np.int64))
            self.count = np.append(self.count, np.zeros(grow, dtype=np.int64))
