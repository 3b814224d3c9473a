"""The transition history, and for each leaf which transitions left and which entered it.

Rows of one episode are stored one after the other; where a bounded history has left some out,
``continues`` tells which rows still follow the row before them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Int32s, Integers, grown
from eutree.compiled import machine_code
from eutree.errors import InvalidArgumentError
from eutree.learners import _kernels
from eutree.learners.forgetting import RANKS, Forgetting, LeafReservoirs
from eutree.trees import DecisionTree

_Array = TypeVar("_Array", bound=NDArray[Any])

_FIRST_ROOM = 64
_GROWTH = 1.25


class Columns:
    """Arrays with one entry, or one row, for each of N items; there is room for more.

    ``kinds`` are the shape of an entry and the dtype of each column.
    """

    def __init__(self, kinds: Mapping[str, tuple[tuple[int, ...], str]]) -> None:
        self.size = 0  # N
        # Each column with its spare room, [C, ...]; other arrays after ``reserve``.
        self.whole: dict[str, NDArray[Any]] = {
            name: np.empty((_FIRST_ROOM, *shape), dtype) for name, (shape, dtype) in kinds.items()
        }
        self._room = _FIRST_ROOM

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column, shape [N, ...]; a view."""
        return self.whole[name][: self.size]

    def get(self, name: str) -> NDArray[Any] | None:
        """Return a column, shape [N, ...], a view; None if there is none."""
        return self[name] if name in self.whole else None

    def begin(self, name: str, entry: NDArray[Any]) -> None:
        """Add a column, with this entry for all items so far."""
        self.whole[name] = np.tile(entry, (self._room, *([1] * entry.ndim)))

    def reserve(self, size: int, most: int | None = None) -> bool:
        """Make room for so many items and some more, ``most`` in all; return if there was none."""
        if size <= self._room:
            return False
        spare = int(self._room * _GROWTH) + 1
        self._room = max(size, spare if most is None else min(spare, most))
        for name, column in self.whole.items():
            self.whole[name] = np.empty((self._room, *column.shape[1:]), dtype=column.dtype)
            self.whole[name][: self.size] = column[: self.size]
        return True

    def keep(self, stay: Booleans) -> None:
        """Keep the items for which ``stay`` [N] is True, in order."""
        size = int(stay.sum())
        for column in self.whole.values():
            column[:size] = column[: self.size][stay]
        self.size = size

    @property
    def nbytes(self) -> int:
        """Bytes held, spare room included."""
        return sum(column.nbytes for column in self.whole.values())


# Those that left it are T(s, a) of the paper, over all actions. They are linked in a list for
# each leaf, so that a split of the leaf divides just its own, whatever else is stored.


class LeafRows:
    """The rows of each leaf on one side of the transitions, "left" or "entered".

    The column ``side`` of their store holds the leaf of each row, negative for none; its column
    ``side`` + "_link" is written here.
    """

    def __init__(self, columns: Columns, side: str, n_leaves: int) -> None:
        self._columns, self._side, self._link = columns, side, f"{side}_link"
        # As compiled loops take them; other arrays after ``relist`` or ``split``.
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
        _kernels.append_to_lists(np.arange(self._columns.size), leaves, self.lists, link)

    def split(self, leaf: int, new_leaf: int, rows: Integers, goes_right: Booleans) -> None:
        """Give those of a leaf's rows that go right, shape [n], to a new leaf."""
        if new_leaf >= (size := self.lists.counts.size):
            room = max(new_leaf + 1, 2 * size)
            self.lists = _kernels.RowLists._make(grown(column, room) for column in self.lists)
        leaves, link = (self._columns.whole[name] for name in (self._side, self._link))
        leaves[rows] = np.where(goes_right, new_leaf, leaf)
        self.lists.counts[[leaf, new_leaf]] = 0  # both are listed anew
        _kernels.append_to_lists(rows, leaves, self.lists, link)


def _no_rows(n_leaves: int) -> _kernels.RowLists:
    """Return an empty list for each leaf; where the count is 0, head and tail say nothing."""
    return _kernels.RowLists(*np.zeros((3, n_leaves), dtype=np.int64))


TERMINAL = _kernels.TERMINAL
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


class _View(Generic[_Array]):
    """A column of a history's store, by the name of the attribute; a view."""

    def __init__(self, dtype: str, *, of_features: bool = False) -> None:
        self.dtype, self.of_features = dtype, of_features

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, history: "History", owner: type) -> _Array:
        column: _Array = history.columns[self._name]  # type: ignore[assignment]  # as declared
        return column


class History:
    """All stored transitions of a learner.

    Args:
        n_features: Number of features d of an observation.
        n_leaves: Number of leaves of the tree whose leaves label the rows.
        forgetting: Which transitions are left out when there are too many; None stores all.

    Attributes:
        columns: All that is stored of each transition, ``allowed`` too once actions were masked.
        observations: Observation o of each; this and the next ten are views of columns.
        next_observations: Observation o'.
        actions: Action.
        rewards: Reward.
        episodes: Number of its episode among those stored.
        continues: Whether it came right after the one before it.
        left: Leaf L(o) that it left.
        entered: Leaf L(o') that it entered, ``TERMINAL`` at the end.
        demonstrated: Whether another agent showed it.
        left_link: Next row that left the same leaf, as ``LeafRows`` keeps it.
        entered_link: Next row that entered the same leaf.
        leaving: The rows that left each leaf.
        entering: The rows that entered each leaf.
        forgetting: The rule it forgets by, or None.
        n_seen: Number of transitions ever appended, with those that were left out.
        n_episodes: Number of episodes stored.
    """

    observations: _View[Floats] = _View("f8", of_features=True)  # [N, d]
    next_observations: _View[Floats] = _View("f8", of_features=True)  # [N, d]
    actions: _View[Int32s] = _View("i4")  # [N]
    rewards: _View[Floats] = _View("f8")  # [N]
    episodes: _View[Int32s] = _View("i4")  # [N]
    continues: _View[Booleans] = _View("b1")  # [N]
    left: _View[Int32s] = _View("i4")  # [N]
    entered: _View[Int32s] = _View("i4")  # [N]
    demonstrated: _View[Booleans] = _View("b1")  # [N]
    left_link: _View[Integers] = _View("i8")  # [N]
    entered_link: _View[Integers] = _View("i8")  # [N]

    def __init__(
        self, n_features: int, n_leaves: int, forgetting: Forgetting | None = None
    ) -> None:
        self.n_seen = 0
        self.n_episodes = 0
        self.forgetting = forgetting
        views = {name: view for name, view in vars(History).items() if isinstance(view, _View)}
        kinds = {k: ((n_features,) * one.of_features, one.dtype) for k, one in views.items()}
        self.columns = Columns(kinds if forgetting is None else kinds | {"ranks": ((), "u4")})
        self.leaving = LeafRows(self.columns, "left", n_leaves)
        self.entering = LeafRows(self.columns, "entered", n_leaves)
        self._append: Callable[..., int] | None = None
        self._stored = _stored_rows(self.columns)

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes of a copy: all but the compiled loop, which it looks up itself."""
        return vars(self) | {"_append": None}

    @property
    def size(self) -> int:
        """Number of transitions N."""
        return self.columns.size

    @property
    def rows(self) -> _kernels.StoredRows:
        """The transitions as compiled loops read them; views."""
        return _kernels.StoredRows(*(self.columns[name] for name in _kernels.StoredRows._fields))

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the transitions as arrays; their labels and lists follow from the tree."""
        state = {
            **{name: self.columns[name] for name in _STORED},
            "terminal": self.entered == TERMINAL,
            "n_episodes": np.array([self.n_episodes]),
            "n_seen": np.array([self.n_seen]),
        }
        if self.demonstrated.any():
            state["demonstrated"] = self.demonstrated
        if "allowed" in self.columns.whole:
            state["allowed"] = self.columns["allowed"]
        if self.forgetting is not None:
            state |= {"ranks": self.columns["ranks"], "bounds": self.forgetting.bounds}
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
        history.columns.reserve(len(state["rewards"]))
        history.columns.size = len(state["rewards"])
        history._stored = _stored_rows(history.columns)
        history.n_episodes, history.n_seen = int(state["n_episodes"][0]), int(state["n_seen"][0])
        for name in _STORED:
            history.columns[name][:] = state[name]
        if forgetting is not None:
            history.columns["ranks"][:] = state["ranks"]
            forgetting.bounds = np.array(state["bounds"])
        led_to = tree.leaf_index(history.next_observations)
        history.left[:] = tree.leaf_index(history.observations)
        history.entered[:] = np.where(state["terminal"], TERMINAL, led_to)
        history.demonstrated[:] = state.get("demonstrated", False)
        if "allowed" in state:
            history.columns.begin("allowed", np.ones(state["allowed"].shape[1], np.bool_))
            history.columns["allowed"][:] = state["allowed"]
        for rows in (history.leaving, history.entering):
            rows.relist(tree.n_leaves)
        return history

    def append_episode(
        self,
        observations: Floats,  # [T + 1, d]
        actions: Integers,  # [T]
        rewards: Floats,  # [T]
        leaves: Int32s,  # [T + 1]
        *,
        terminated: bool,
        demonstrated: bool = False,
        generator: np.random.Generator | None = None,
        allowed: Booleans | None = None,  # [T, A]
    ) -> Booleans:
        """Store the transitions of one episode, with the leaves of its observations.

        The ranks of a bounded history come from ``generator``; without one they follow from the
        number of transitions seen before.

        Returns:
            Which of the transitions are stored, shape [T].
        """
        steps = len(actions)
        episode = _kernels.EpisodeColumns(
            np.ascontiguousarray(observations, dtype=np.float64),
            np.ascontiguousarray(actions, dtype=np.int64),
            np.ascontiguousarray(rewards, dtype=np.float64),
            np.ascontiguousarray(leaves, dtype=np.int32),
            demonstrated,
        )
        sizes = [len(column) for column in (observations, actions, rewards, leaves)]
        if sizes != [steps + 1, steps, steps, steps + 1]:
            raise InvalidArgumentError(
                f"an episode of {steps} actions must have as many rewards and one more "
                f"observation and leaf, got {sizes}"
            )
        columns, rule = self.columns, self.forgetting
        first, last, stored = columns.size, columns.size + steps, np.ones(steps, dtype=np.bool_)
        if rule is not None:
            ranks = rule.draw(steps, generator or np.random.default_rng(self.n_seen))
            stored = rule.admits(episode.leaves[:-1], actions, ranks)
            last = first + int(stored.sum())
        if columns.reserve(last, None if rule is None else rule.max_transitions):
            self._stored = _stored_rows(columns)
        if rule is not None:
            columns.whole["ranks"][first:last] = ranks[stored]
        if allowed is not None and "allowed" not in columns.whole:
            columns.begin("allowed", np.ones(allowed.shape[1], dtype=np.bool_))
        if "allowed" in columns.whole:
            columns.whole["allowed"][first:last] = True if allowed is None else allowed[stored]
        lists = self.leaving.lists, self.entering.lists
        call = (self._stored, *lists, episode, stored, first, self.n_episodes, terminated)
        if self._append is None:
            self._append = machine_code(_kernels.append_rows, *call)
        columns.size = self._append(*call)
        self.n_seen += steps
        self.n_episodes += bool(stored.any())  # else no row has its number
        return stored

    def forget(self) -> Integers | None:
        """Forget transitions where there are too many, and number the episodes that stay from 0.

        Returns:
            The former numbers of the episodes that stay, ascending; None if nothing is too much.
        """
        rule = self.forgetting
        if rule is None or self.size <= rule.max_transitions:
            return None
        stay = rule.keeps(self.left, self.actions, self.episodes, self.columns["ranks"])
        self.continues[1:] &= stay[:-1]
        self.columns.keep(stay)
        kept, self.episodes[:] = np.unique(self.episodes, return_inverse=True)
        self.n_episodes = kept.size
        for rows in (self.leaving, self.entering):
            rows.relist(rows.counts.size)
        return kept.astype(np.int64)

    def seen_leaving(self) -> Integers:
        """Return how many transitions left each leaf, estimated where some were left out, [L]."""
        rule = self.forgetting
        if not isinstance(rule, LeafReservoirs):
            return self.leaving.counts
        n_actions = rule.bounds.shape[1]
        cells = self.left.astype(np.int64) * n_actions + self.actions
        stored = np.bincount(cells, minlength=rule.bounds.size).reshape(-1, n_actions)
        seen = (stored * (RANKS / rule.bounds)).sum(axis=1)
        whole: Integers = seen.astype(np.int64)
        return whole

    def split(self, leaf: int, new_leaf: int, feature: int, threshold: float) -> Relabelling:
        """Relabel the rows that left or entered ``leaf`` after its split at ``threshold``.

        Rows with ``x[feature] <= threshold`` keep ``leaf``, the others get ``new_leaf``.
        """
        leaving, entering = self.leaving.of(leaf), self.entering.of(leaf)
        rows = np.union1d(leaving, entering)
        rule = self.forgetting
        if isinstance(rule, LeafReservoirs):  # those of a leaf that changes take in all again
            ranks = self.columns["ranks"]
            ranks[leaving] = rule.rescaled(
                self.left[leaving], self.actions[leaving], ranks[leaving]
            )
            rule.reset(leaf, new_leaf)
        before = self.left[rows], self.entered[rows]
        goes_right = ~(self.observations[leaving, feature] <= threshold)
        self.leaving.split(leaf, new_leaf, leaving, goes_right)
        goes_right = ~(self.next_observations[entering, feature] <= threshold)
        self.entering.split(leaf, new_leaf, entering, goes_right)
        return Relabelling(rows, leaving, *before, self.left[rows], self.entered[rows])


def _stored_rows(columns: Columns) -> _kernels.StoredRows:
    return _kernels.StoredRows(*(columns.whole[name] for name in _kernels.StoredRows._fields))
