"""An MDP over leaves that learns from transitions one at a time and grows as leaves split.

Counts and reward sums give Pr and R (Eqs. 3 and 4); values follow by the Bellman equations

    Q(s, a) = R(s, a) + discount * sum over s' of Pr(s, a, s') V(s')     (Eq. 5, with its sum)
    V(s)    = max over a of Q(s, a)                                      (Eq. 6)

either step by step, by prioritized sweeping (:mod:`eutree.mdp.prioritized_sweeping`), or all at
once, exactly (:mod:`eutree.mdp.solver`). Memory is proportional to the distinct triples
(s, a, s'). Pr, and every sum over it, depends on the counts alone; a sum of rewards depends also
on the order of the rows, so after a leaf was split ``set_rewards`` sums the affected leaves anew:
then a model that followed every split equals, bit for bit, one rebuilt from the history.
"""

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Floats, Int32s, Integers
from eutree.errors import InvalidArgumentError
from eutree.mdp import _kernels
from eutree.mdp import _kernels_sweeping as _sweeping
from eutree.mdp.checks import labels, never_counted
from eutree.mdp.model import TERMINAL, Model
from eutree.mdp.prioritized_sweeping import Sweeping
from eutree.mdp.problem import Solution
from eutree.mdp.solver import solve
from eutree.validation import check_finite, check_integer, check_number

_Scalar = TypeVar("_Scalar", bound=np.generic)

_FIRST_POOL = 256


class TabularMDP:
    """Counts, Pr, R, V and Q of an MDP whose states may be split.

    >>> mdp = TabularMDP(n_states=2, n_actions=1, discount=0.5)
    >>> mdp.observe(0, 0, 1.0, 1)
    >>> mdp.observe(1, 0, 4.0, TERMINAL)
    >>> mdp.solve().values
    array([3., 4.])

    Args:
        n_states: Number of states at the start.
        n_actions: Number of actions.
        discount: Weight of the next step's value, from 0 to 1.
        untried: What an action counts that was never tried in a state; None leaves it out of the
            maximum and shows NaN as its Q. The paper preset uses 0, an optimist a high value.
        sweeping: When prioritized sweeping stops.
        horizon: Steps after which behaviour that never ends is taken to end, where the discount
            is 1; see :mod:`eutree.mdp.solver`.

    Attributes:
        arrays: All that it holds, for a compiled loop that observes by itself; other arrays after
            it has grown.
    """

    def __init__(
        self,
        n_states: int,
        n_actions: int,
        discount: float,
        *,
        untried: float | None = None,
        sweeping: Sweeping | None = None,
        horizon: float = 1000.0,
    ) -> None:
        n_states = check_integer("n_states", n_states, low=1)
        self.n_actions = check_integer("n_actions", n_actions, low=1)
        self.discount = check_number("discount", discount, low=0.0, high=1.0)
        self.untried = None if untried is None else check_number("untried", untried)
        self.horizon = check_number("horizon", horizon, low=1.0)
        self.sweeping = Sweeping() if sweeping is None else sweeping
        self._settings = np.empty(4)
        self._settings[_sweeping.DISCOUNT] = self.discount
        self._settings[_sweeping.THRESHOLD] = self.sweeping.threshold(self.discount)
        self._settings[_sweeping.UNTRIED] = np.nan if untried is None else untried
        self._settings[_sweeping.HORIZON] = self.horizon
        self._n_states = 0
        self._counters = np.zeros(4, np.int64)
        self._counters[_sweeping.TOUCHED] = _sweeping.NO_SAVEPOINT
        self._pool = np.zeros((_FIRST_POOL, 2), np.int32)  # [K, 2]
        self._reserve(n_states)
        self._n_states = self._counters[_sweeping.STATES] = n_states

    @classmethod
    def from_transitions(
        cls,
        states: ArrayLike,
        actions: ArrayLike,
        rewards: ArrayLike,
        next_states: ArrayLike,
        *,
        n_states: int,
        n_actions: int,
        discount: float,
        untried: float | None = None,
        sweeping: Sweeping | None = None,
        horizon: float = 1000.0,
    ) -> "TabularMDP":
        """Return the MDP of all these transitions, counted at once in linear time."""
        mdp = cls(
            n_states, n_actions, discount, untried=untried, sweeping=sweeping, horizon=horizon
        )
        rows = mdp._check_rows(states, actions, rewards, next_states)
        n_pairs = n_states * n_actions
        offsets = np.zeros(n_pairs + 1, np.int64)
        keys, counts = np.empty((2, len(rows[0])), np.int32)
        sizes = np.zeros(n_pairs, np.int32)
        _kernels.count_successors(
            *rows, mdp._visits, mdp._reward_sums, offsets, keys, counts, sizes
        )
        mdp._pool = np.zeros((2 * int(sizes.sum()) + _FIRST_POOL, 2), np.int32)
        mdp._counters[_kernels.USED] = _kernels.fill_rows(
            offsets, keys, counts, sizes, n_actions, mdp._table, mdp._pool
        )
        mdp._bind()
        return mdp

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return self._n_states

    @property
    def visits(self) -> Integers:
        """How often each action was tried in each state, N(s, a), shape [S, A]."""
        return _read_only(self._visits[: self._n_states])

    @property
    def reward_sums(self) -> Floats:
        """Sum of the rewards of each state and action, shape [S, A]."""
        return _read_only(self._reward_sums[: self._n_states])

    @property
    def rewards(self) -> Floats:
        """R(s, a) (Eq. 4), shape [S, A]; NaN where the action was never tried."""
        with np.errstate(invalid="ignore"):
            means: Floats = self.reward_sums / self.visits
        return means

    @property
    def values(self) -> Floats:
        """V(s) (Eq. 6), shape [S]; a state in which nothing was tried keeps the value it had."""
        return _read_only(self._values[: self._n_states])

    @values.setter
    def values(self, values: ArrayLike) -> None:
        self._drop_savepoint()
        self._values[: self._n_states] = values

    @property
    def action_values(self) -> Floats:
        """Q(s, a) (Eq. 5) as of the last backup of each state, shape [S, A]."""
        return _read_only(self._action_values[: self._n_states])

    def action_values_of(self, state: int) -> list[float]:
        """Return Q(s, a) of one state; without the cost of a view, for every step of a learner."""
        row: list[float] = self._action_values[state].tolist()
        return row

    @property
    def nbytes(self) -> int:
        """Bytes held in arrays."""
        return int(sum(array.nbytes for array in self.arrays))

    def successors(self, state: int, action: int) -> tuple[Int32s, Int32s]:
        """Return the next states seen after a state and an action, and their counts N(s, a, s').

        They ascend; TERMINAL, where it was seen, comes first.
        """
        state = check_integer("state", state, high=self._n_states - 1)
        action = check_integer("action", action, high=self.n_actions - 1)
        return self._row(state * (self.n_actions + 1) + action)

    def predecessors(self, state: int) -> tuple[Int32s, Int32s, Int32s]:
        """Return the states and actions that were seen to lead to a state, and their counts."""
        state = check_integer("state", state, high=self._n_states - 1)
        pairs, counts = self._row(state * (self.n_actions + 1) + self.n_actions)
        return pairs // self.n_actions, pairs % self.n_actions, counts

    def probabilities(self, state: int, action: int) -> Floats:
        """Return Pr(s, a, s') (Eq. 3) for every s', shape [S]; what misses to 1 is terminal.

        NaN everywhere where the action was never tried.
        """
        keys, counts = self.successors(state, action)
        if not keys.size:
            return np.full(self._n_states, np.nan)
        dense = np.zeros(self._n_states + 1)
        dense[keys] = counts / counts.sum()  # TERMINAL is the last place
        return dense[:-1]

    def model(self) -> Model:
        """Return Pr and R as they are now, for a solver."""
        size = int(self._table[: self._n_rows, _kernels.SIZE].sum())
        visits, sums = self._visits[: self._n_states], self._reward_sums[: self._n_states]
        indptr = np.zeros(visits.size + 1, np.int64)
        successor, probability = np.empty(size, np.int32), np.empty(size)
        termination = np.zeros(visits.shape)
        used = _kernels.fill_model(
            self._table, self._pool, visits, indptr, successor, probability, termination
        )
        reward = np.divide(sums, visits, out=np.zeros(visits.shape), where=visits > 0)
        return Model(indptr, successor[:used], probability[:used], termination, reward, visits)

    def observe(
        self, state: int, action: int, reward: float, next_state: int, backups: int = 0
    ) -> None:
        """Count one transition, put its state on top of the queue and do some backups.

        Args:
            state: Where it began.
            action: What was done.
            reward: What was received.
            next_state: Where it led, or TERMINAL.
            backups: How many states of highest priority to back up.
        """
        status = _sweeping.observe(self.arrays, state, action, reward, next_state, backups)
        if status == _kernels.DONE:
            return
        if status == _sweeping.BAD_TRANSITION:
            raise InvalidArgumentError(
                f"a transition must have states in 0..{self._n_states - 1} (the next one also "
                f"TERMINAL = -1), an action in 0..{self.n_actions - 1} and a finite reward, got "
                f"state {state}, action {action}, reward {reward}, next state {next_state}"
            )
        self._grow_pool()
        self.observe(state, action, reward, next_state, backups)

    def observe_batch(
        self, states: ArrayLike, actions: ArrayLike, rewards: ArrayLike, next_states: ArrayLike
    ) -> None:
        """Count many transitions, in order; no backups, and nothing is queued."""
        self._drop_savepoint()
        rows = self._check_rows(states, actions, rewards, next_states)
        row = 0
        while True:
            row = _kernels.observe_rows(
                self._table, self._pool, self._counters, self._visits, self._reward_sums,
                *rows, row,
            )  # fmt: skip
            if row == len(rows[0]):
                return
            self._grow_pool()

    def forget(self, state: int, action: int, reward: float, next_state: int) -> None:
        """Take one transition back, the inverse of ``observe``."""
        self.forget_batch([state], [action], [reward], [next_state])

    def forget_batch(
        self, states: ArrayLike, actions: ArrayLike, rewards: ArrayLike, next_states: ArrayLike
    ) -> None:
        """Take many transitions back.

        Counts become what they were, reward sums only to rounding: see ``set_rewards``. A row
        that was never counted raises, with the rows before it already taken back.
        """
        rows = self._check_rows(states, actions, rewards, next_states)
        row = _kernels.forget_rows(self._table, self._pool, self._visits, self._reward_sums, *rows)
        if row < len(rows[0]):
            raise never_counted(row, rows[0][row], rows[1][row], rows[3][row])

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
        self._drop_savepoint()
        old = self._check_rows(states, actions, None, next_states)
        new = self._check_rows(new_states, actions, None, new_next_states)
        row, status = 0, _kernels.NO_ROOM
        while status == _kernels.NO_ROOM:
            row, status = _kernels.relabel_rows(
                self._table, self._pool, self._counters, self._visits,
                old[1], old[0], old[3], new[0], new[3], row,
            )  # fmt: skip
            if status == _kernels.NO_ROOM:
                self._grow_pool()
        if status != _kernels.DONE:
            raise never_counted(row, old[0][row], old[1][row], old[3][row])

    def set_rewards(self, leaves: ArrayLike, states: ArrayLike, actions: ArrayLike,
                    rewards: ArrayLike) -> None:  # fmt: skip
        """Set the reward sums of some leaves to the sums over these rows, added in row order.

        Args:
            leaves: The states whose sums are set.
            states: State of each row; the rows are all transitions that left these leaves.
            actions: Action of each row.
            rewards: Reward of each row.
        """
        self._drop_savepoint()
        rows = self._check_rows(states, actions, rewards, states)
        self._reward_sums[np.asarray(leaves, dtype=np.int64)] = 0.0
        np.add.at(self._reward_sums, (rows[0], rows[1]), rows[2])

    def add_state(self, value: float = 0.0) -> int:
        """Add a state, for one half of a split leaf; return its number.

        Args:
            value: Its V until it is backed up or solved, such as its parent's.
        """
        self._drop_savepoint()
        state = self._n_states
        if state == len(self._visits):
            self._reserve(2 * state)
        self._values[state] = value
        self._n_states = self._counters[_sweeping.STATES] = state + 1
        return state

    def queue(self, states: ArrayLike | None = None) -> None:
        """Put states (all of them if None) on top of the queue of prioritized sweeping."""
        self._drop_savepoint()
        chosen = range(self._n_states) if states is None else np.asarray(states).tolist()
        for state in chosen:
            state = check_integer("states", state, high=self._n_states - 1)
            _sweeping.push(self._heap, self._priority, self._counters, state, _sweeping.SOON)

    def sweep(self, backups: int) -> int:
        """Back up at most so many states in order of priority; return how many were.

        Fewer than asked for means that the queue is empty.
        """
        return _sweeping.sweep(self.arrays, backups)

    def solve(self, *, tolerance: float = 1e-6) -> Solution:
        """Solve exactly for V and Q, from the present values; the queue is emptied."""
        solution = solve(
            self.model(),
            self.discount,
            tolerance=tolerance,
            initial_values=self.values,
            untried=self.untried,
            horizon=self.horizon,
        )
        self.values = solution.values
        self._action_values[: self._n_states] = solution.action_values
        self._heap[_sweeping.PLACE] = _sweeping.NO_PLACE
        self._counters[_sweeping.QUEUED] = 0
        return solution

    def state(self) -> dict[str, NDArray[Any]]:
        """Return copies of what the counts alone do not tell: V, Q, the queue, reward sums."""
        n_queued = int(self._counters[_sweeping.QUEUED])
        return {
            "values": self.values.copy(),
            "action_values": self.action_values.copy(),
            "reward_sums": self.reward_sums.copy(),
            "queue": self._heap[_sweeping.ORDER, :n_queued].copy(),
            "priority": self._priority[: self._n_states].copy(),
        }

    def savepoint(self) -> None:
        """Let ``rollback`` come back to here, until anything but ``observe`` or ``sweep`` is done.

        Nothing is copied now but the queue: what a state holds is saved before its first change.
        """
        self._drop_savepoint()
        self._queue = self._heap[_sweeping.ORDER, : self._counters[_sweeping.QUEUED]].copy()
        self._counters[_sweeping.TOUCHED] = 0

    def rollback(self) -> None:
        """Take back V, Q, the queue and reward sums as they were at the savepoint, to the bit.

        Counts are taken back by ``forget_batch`` before.
        """
        if self._counters[_sweeping.TOUCHED] == _sweeping.NO_SAVEPOINT:
            raise InvalidArgumentError("rollback needs a savepoint that still holds")
        _sweeping.roll_back(self.arrays, self._queue)
        self._drop_savepoint()

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take back what ``state()`` returned, for an MDP that holds the same counts."""
        self._drop_savepoint()
        queue = state["queue"]
        self._values[: self._n_states] = state["values"]
        self._action_values[: self._n_states] = state["action_values"]
        self._reward_sums[: self._n_states] = state["reward_sums"]
        self._priority[: self._n_states] = state["priority"]
        self._heap[:] = _sweeping.NO_PLACE
        self._heap[_sweeping.ORDER, : queue.size] = queue
        self._heap[_sweeping.PLACE, queue] = np.arange(queue.size)
        self._counters[_sweeping.QUEUED] = queue.size

    def _drop_savepoint(self) -> None:
        """Save no more."""
        last = self._touched[_sweeping.LIST, : max(self._counters[_sweeping.TOUCHED], 0)]
        self._touched[_sweeping.LISTED, last] = 0
        self._counters[_sweeping.TOUCHED] = _sweeping.NO_SAVEPOINT

    @property
    def _n_rows(self) -> int:
        return self._n_states * (self.n_actions + 1)

    def _row(self, row: int) -> tuple[Int32s, Int32s]:
        start, size = self._table[row, _kernels.START], self._table[row, _kernels.SIZE]
        entries = self._pool[start : start + size]
        return entries[:, _kernels.KEY].copy(), entries[:, _kernels.COUNT].copy()

    def _check_rows(
        self, states: ArrayLike, actions: ArrayLike, rewards: ArrayLike | None,
        next_states: ArrayLike,
    ) -> tuple[Int32s, Int32s, Floats, Int32s]:  # fmt: skip
        """Return the columns as arrays of the kernels' types, or raise."""
        columns = (
            labels("states", states, 0, self._n_states),
            labels("actions", actions, 0, self.n_actions),
            labels("next_states", next_states, TERMINAL, self._n_states),
        )
        sums = np.zeros(len(columns[0])) if rewards is None else np.array(rewards, np.float64)
        check_finite("rewards", sums)
        sizes = {columns[0].shape, columns[1].shape, columns[2].shape, sums.shape}
        if len(sizes) != 1:
            raise InvalidArgumentError(
                "states, actions, rewards and next_states must be vectors of one size, "
                f"got {columns[0].shape}, {columns[1].shape}, {sums.shape}, {columns[2].shape}"
            )
        return columns[0], columns[1], sums, columns[2]

    def _reserve(self, n_states: int) -> None:
        """Make room for so many states."""
        shape = (n_states, self.n_actions)
        self._table = _grown(self, "_table", (n_states * (self.n_actions + 1), 3), np.int32, 0)
        self._visits = _grown(self, "_visits", shape, np.int64, 0)
        self._reward_sums = _grown(self, "_reward_sums", shape, np.float64, 0.0)
        self._values = _grown(self, "_values", shape[:1], np.float64, 0.0)
        unknown = self._settings[_sweeping.UNTRIED]
        self._action_values = _grown(self, "_action_values", shape, np.float64, unknown)
        self._priority = _grown(self, "_priority", shape[:1], np.float64, 0.0)
        self._touched = np.zeros((2, n_states), np.int32)
        self._saved = np.empty((n_states, 2 + 2 * self.n_actions))
        heap = np.full((2, n_states), _sweeping.NO_PLACE, np.int32)
        if self._n_states:
            heap[:, : self._n_states] = self._heap[:, : self._n_states]
        self._heap: Int32s = heap
        self._bind()

    def _grow_pool(self) -> None:
        """Pack the rows together, with at least as much free space behind them."""
        live = int(self._table[:, _kernels.SIZE].sum())
        widest = int(self._table[:, _kernels.SIZE].max())
        larger = np.zeros((2 * live + 8 * widest + _FIRST_POOL, 2), np.int32)
        self._counters[_kernels.USED] = _kernels.repack(self._table, self._pool, larger)
        self._pool = larger
        self._bind()

    def _bind(self) -> None:
        """Keep the arrays together, as the kernels take them."""
        self.arrays = _sweeping.MDPArrays(
            self._table, self._pool, self._counters, self._visits, self._reward_sums,
            self._values, self._action_values, self._heap, self._priority,
            self._touched, self._saved, self._settings,
        )  # fmt: skip


def _grown(owner: object, name: str, shape: tuple[int, ...], dtype: Any, fill: float) -> Any:
    """Return an array of the new shape that begins with the entries of the old one, if any."""
    new = np.full(shape, fill, dtype=dtype)
    old = getattr(owner, name, None)
    if old is not None:
        new[: len(old)] = old
    return new


def _read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return a view of the array that cannot be written to."""
    view = array.view()
    view.setflags(write=False)
    return view
