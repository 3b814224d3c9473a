"""How often each transition between states was seen: all that Pr and R (Eqs. 3 and 4) are made of.

Memory is proportional to the distinct triples (s, a, s'). Pr, and every sum over it, depends on the
counts alone; a sum of rewards depends also on the order of the rows, so after a leaf was split
``set_rewards`` sums the affected leaves again: then counts that followed every split equal, bit for
bit, those made of the history.
"""

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Int32s, Integers, grown, read_only
from eutree.errors import InvalidArgumentError
from eutree.mdp import _kernels
from eutree.mdp.solver import TERMINAL, Model
from eutree.validation import check_finite, check_integer


def labels(name: str, value: ArrayLike, low: int, stop: int) -> Int32s:
    """Return the value as a new int32 vector with entries in low..stop - 1, or raise."""
    array = np.asarray(value)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise InvalidArgumentError(
            f"{name} must be a vector of integers, got shape {array.shape} of {array.dtype}"
        )
    if array.size and not low <= array.min() <= array.max() < stop:
        raise InvalidArgumentError(
            f"{name} must be in {low}..{stop - 1}, got {array.min()}..{array.max()}"
        )
    return np.array(array, dtype=np.int32)


def never_counted(row: int, state: int, action: int, next_state: int) -> InvalidArgumentError:
    """Return the error for a transition that cannot be taken back."""
    return InvalidArgumentError(
        f"row {row} must be a transition that was counted before, got state {state}, "
        f"action {action}, next state {next_state}"
    )


_FIRST_POOL = 256


class TransitionCounts:
    """N(s, a, s') and the sums of rewards, of states that may be split.

    >>> counts = TransitionCounts(n_states=2, n_actions=1)
    >>> counts.observe([0, 0, 0], [0, 0, 0], [1.0, 2.0, 3.0], [0, 1, 1])
    >>> counts.successors(0, 0)
    (array([0, 1], dtype=int32), array([1, 2], dtype=int32))

    Args:
        n_states: Number of states at the start.
        n_actions: Number of actions.

    Attributes:
        n_actions: Number of actions A.
        version: Grows with every change but that of ``forget``.
        arrays: All that it holds, for compiled loops; other arrays after it has grown.
    """

    def __init__(self, n_states: int, n_actions: int) -> None:
        n_states = check_integer("n_states", n_states, low=1)
        self.n_actions = check_integer("n_actions", n_actions, low=1)
        self.version = 0
        self.arrays = _kernels.CountArrays(
            table=np.zeros((n_states * (self.n_actions + 1), 3), np.int32),
            pool=np.zeros((_FIRST_POOL, 2), np.int32),
            counters=np.array([0, n_states], np.int64),
            visits=np.zeros((n_states, self.n_actions), np.int64),
            reward_sums=np.zeros((n_states, self.n_actions)),
        )

    @classmethod
    def of(
        cls,
        states: ArrayLike,
        actions: ArrayLike,
        rewards: ArrayLike,
        next_states: ArrayLike,
        *,
        n_states: int,
        n_actions: int,
    ) -> "TransitionCounts":
        """Return the counts of all these transitions, made at once."""
        counts = cls(n_states, n_actions)
        rows = counts._checked(states, actions, rewards, next_states)
        arrays, entered = counts.arrays, rows.next_states.astype(np.int64)
        pair = rows.states.astype(np.int64) * n_actions + rows.actions
        n_pairs = n_states * n_actions
        # Rows of successors, then of predecessors. A key is one more here, as TERMINAL is -1.
        inner = entered != _kernels.TERMINAL
        row = np.concatenate([pair + rows.states, entered[inner] * (n_actions + 1) + n_actions])
        key = np.concatenate([entered, pair[inner]]) + 1
        found, n = np.unique(row * (n_pairs + 1) + key, return_counts=True)
        row, key = np.divmod(found, n_pairs + 1)
        sizes = np.bincount(row, minlength=len(arrays.table))
        arrays.table[:] = np.column_stack([np.cumsum(sizes) - sizes, sizes, sizes])
        pool = np.zeros((2 * found.size + _FIRST_POOL, 2), np.int32)
        pool[: found.size] = np.column_stack([key - 1, n])
        arrays.counters[_kernels.USED] = found.size
        arrays.visits[:] = np.bincount(pair, minlength=n_pairs).reshape(n_states, -1)
        arrays.reward_sums[:] = np.bincount(pair, rows.rewards, n_pairs).reshape(n_states, -1)
        counts.arrays = arrays._replace(pool=pool)
        return counts

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return int(self.arrays.counters[_kernels.STATES])

    @property
    def visits(self) -> Integers:
        """How often each action was tried in each state, N(s, a), shape [S, A]."""
        return read_only(self.arrays.visits[: self.n_states])

    @property
    def reward_sums(self) -> Floats:
        """Sum of the rewards of each state and action, shape [S, A]."""
        return read_only(self.arrays.reward_sums[: self.n_states])

    @property
    def rewards(self) -> Floats:
        """R(s, a) (Eq. 4), shape [S, A]; NaN where the action was never tried."""
        with np.errstate(invalid="ignore"):
            means: Floats = self.reward_sums / self.visits
        return means

    def successors(self, state: int, action: int) -> tuple[Int32s, Int32s]:
        """Return the next states seen after a state and an action, and their counts N(s, a, s').

        They ascend; TERMINAL, where it was seen, comes first.
        """
        state = check_integer("state", state, high=self.n_states - 1)
        action = check_integer("action", action, high=self.n_actions - 1)
        return self._row(state * (self.n_actions + 1) + action)

    def predecessors(self, state: int) -> tuple[Int32s, Int32s, Int32s]:
        """Return the states and actions that were seen to lead to a state, and their counts."""
        state = check_integer("state", state, high=self.n_states - 1)
        pairs, counts = self._row(state * (self.n_actions + 1) + self.n_actions)
        return pairs // self.n_actions, pairs % self.n_actions, counts

    def probabilities(self, state: int, action: int) -> Floats:
        """Return Pr(s, a, s') (Eq. 3) for every s', shape [S]; the rest to 1 is terminal.

        NaN everywhere where the action was never tried.
        """
        keys, counts = self.successors(state, action)
        if not keys.size:
            return np.full(self.n_states, np.nan)
        dense = np.zeros(self.n_states + 1)
        dense[keys] = counts / counts.sum()  # TERMINAL is the last place
        return dense[:-1]

    def model(self) -> Model:
        """Return Pr and R as they are now, for a solver."""
        visits, sums = self.visits, self.reward_sums
        size = int(self.arrays.table[:, _kernels.SIZE].sum())
        out = _kernels.ModelArrays(
            indptr=np.zeros(visits.size + 1, np.int64),
            successor=np.empty(size, np.int32),
            probability=np.empty(size),
            termination=np.zeros(visits.shape),
        )
        used = _kernels.fill_model(self.arrays, out)
        reward = np.divide(sums, visits, out=np.zeros(visits.shape), where=visits > 0)
        entries = out.successor[:used], out.probability[:used]
        return Model(out.indptr, *entries, out.termination, reward, visits)

    def observe(
        self, states: ArrayLike, actions: ArrayLike, rewards: ArrayLike, next_states: ArrayLike
    ) -> None:
        """Count transitions, in order; a next state may be TERMINAL."""
        self.version += 1
        rows = self._checked(states, actions, rewards, next_states)
        row = _kernels.observe_rows(self.arrays, rows, 0)
        while row < len(rows.states):
            self.make_room()
            row = _kernels.observe_rows(self.arrays, rows, row)

    def forget(
        self, states: ArrayLike, actions: ArrayLike, rewards: ArrayLike, next_states: ArrayLike
    ) -> None:
        """Take transitions back, the inverse of ``observe``.

        Counts are restored exactly, reward sums only to rounding: see ``set_rewards``. A row that
        was never counted raises, with the rows before it already taken back.
        """
        rows = self._checked(states, actions, rewards, next_states)
        row = _kernels.forget_rows(self.arrays, rows)
        if row < len(rows.states):
            raise never_counted(row, rows.states[row], rows.actions[row], rows.next_states[row])

    def relabel(
        self,
        actions: ArrayLike,
        *,
        states: ArrayLike,
        next_states: ArrayLike,
        new_states: ArrayLike,
        new_next_states: ArrayLike,
    ) -> None:
        """Move the counts of transitions from their old labels to new ones, as after a split.

        A row whose labels stay is passed over. Reward sums are left alone: give every state that
        lost or won rows to ``set_rewards``.
        """
        self.version += 1
        old = self._checked(states, actions, None, next_states)
        new = self._checked(new_states, actions, None, new_next_states)
        row, status = _kernels.relabel_rows(self.arrays, old, new, 0)
        while status == _kernels.NO_ROOM:
            self.make_room()
            row, status = _kernels.relabel_rows(self.arrays, old, new, row)
        if status != _kernels.DONE:
            raise never_counted(row, old.states[row], old.actions[row], old.next_states[row])

    def set_rewards(self, leaves: ArrayLike, states: ArrayLike, actions: ArrayLike,
                    rewards: ArrayLike) -> None:  # fmt: skip
        """Set the reward sums of some leaves to the sums over all rows that left them, in order."""
        self.version += 1
        rows = self._checked(states, actions, rewards, states)
        self.arrays.reward_sums[np.asarray(leaves, dtype=np.int64)] = 0.0
        np.add.at(self.arrays.reward_sums, (rows.states, rows.actions), rows.rewards)

    def add_state(self) -> int:
        """Add a state, for one half of a split leaf; return its number."""
        self.version += 1
        state, room = self.n_states, len(self.arrays.visits)
        if state == room:
            self.arrays = self.arrays._replace(
                table=grown(self.arrays.table, 2 * room * (self.n_actions + 1)),
                visits=grown(self.arrays.visits, 2 * room),
                reward_sums=grown(self.arrays.reward_sums, 2 * room),
            )
        self.arrays.counters[_kernels.STATES] = state + 1
        return state

    def make_room(self) -> None:
        """Pack the rows together, with at least as much free space behind them."""
        sizes = self.arrays.table[:, _kernels.SIZE]
        room = 2 * int(sizes.sum()) + 8 * int(sizes.max()) + _FIRST_POOL
        larger = np.zeros((room, 2), np.int32)
        used = _kernels.repack(self.arrays.table, self.arrays.pool, larger)
        self.arrays.counters[_kernels.USED] = used
        self.arrays = self.arrays._replace(pool=larger)

    def _row(self, row: int) -> tuple[Int32s, Int32s]:
        start, size, _ = self.arrays.table[row].tolist()
        entries = self.arrays.pool[start : start + size]
        return entries[:, _kernels.KEY].copy(), entries[:, _kernels.COUNT].copy()

    def _checked(
        self, states: ArrayLike, actions: ArrayLike, rewards: ArrayLike | None,
        next_states: ArrayLike,
    ) -> _kernels.DiscreteTransitions:  # fmt: skip
        """Return the columns as arrays of the kernels' types, or raise."""
        columns = (
            labels("states", states, 0, self.n_states),
            labels("actions", actions, 0, self.n_actions),
            labels("next_states", next_states, TERMINAL, self.n_states),
        )
        sums = np.zeros(len(columns[0])) if rewards is None else np.array(rewards, np.float64)
        check_finite("rewards", sums)
        if len({columns[0].shape, columns[1].shape, columns[2].shape, sums.shape}) != 1:
            raise InvalidArgumentError(
                "states, actions, rewards and next_states must be vectors of one size, "
                f"got {columns[0].shape}, {columns[1].shape}, {sums.shape}, {columns[2].shape}"
            )
        return _kernels.DiscreteTransitions(columns[0], columns[1], sums, columns[2])
