"""An MDP over leaves that learns from transitions one at a time and grows as leaves split.

Counts and reward sums (:mod:`eutree.mdp.counts`) give Pr and R (Eqs. 3 and 4); values follow by
the Bellman equations

    Q(s, a) = R(s, a) + discount * sum over s' of Pr(s, a, s') V(s')     (Eq. 5, with its sum)
    V(s)    = max over a of Q(s, a)                                      (Eq. 6)

either step by step, by prioritized sweeping (:mod:`eutree.mdp.tabular`), or all at
once, exactly (:mod:`eutree.mdp.solver`).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Floats, grown, read_only
from eutree.errors import InvalidArgumentError
from eutree.mdp import _kernels
from eutree.mdp import _kernels_sweeping as _sweeping
from eutree.mdp.counts import TransitionCounts
from eutree.mdp.solver import Solution, solve
from eutree.validation import check_integer, check_number

# After every real step the state it left goes on top of a queue. Then, as often as the budget
# allows, the first state s of the queue is backed up; when its value changed by Delta, each pair
# (s', a) that was seen to lead to s gives its state the priority
#
#     Pr(s', a, s) * Delta
#
# unless that is below a threshold. A state that is queued already keeps the *larger* of its two
# priorities. Ties go to the lower state.
#
# A backup here solves the loops of a state to itself at once: staying with an action until it
# leaves the state has the same fixed point as Eq. 5, and leaves of a tree loop often. So a state
# never queues itself, and an endless loop (discount 1, all transitions of an action back to their
# leaf) cannot eat the budget: it is worth ``horizon`` times its reward, and chosen only if that
# is positive or nothing else was tried.
#
# An error of at most ``precision`` a step can hide below the threshold; discounted over all later
# steps it grows by 1 / (1 - discount), so the threshold is ``precision * (1 - discount)``. With
# discount 1 there is no such bound, and the threshold is ``precision / 1000``.
#
# Reference: A. W. Moore, C. G. Atkeson, *Prioritized sweeping: reinforcement learning with less
# data and less time*, Machine Learning 13 (1993).


class TabularMDP:
    """V and Q of an MDP whose states may be split.

    >>> mdp = TabularMDP(TransitionCounts(n_states=2, n_actions=1), discount=0.5)
    >>> mdp.observe(0, 0, 1.0, 1)
    >>> mdp.observe(1, 0, 4.0, TERMINAL)
    >>> mdp.solve().values
    array([3., 4.])

    Args:
        counts: The transitions counted so far, or none; the MDP counts on in it.
        discount: Weight of the next step's value, from 0 to 1.
        untried: Value of an action that was never tried in a state; None leaves it out of the
            maximum and shows NaN as its Q. The paper preset uses 0, an optimist a high value.
        precision: Error of V that may remain for each change that prioritized sweeping lets rest.
        horizon: Steps after which behaviour that never ends is taken to end, where the discount
            is 1; see :mod:`eutree.mdp.solver`.

    Attributes:
        counts: The transitions counted, from which Pr and R follow.
    """

    def __init__(
        self,
        counts: TransitionCounts,
        discount: float,
        *,
        untried: float | None = None,
        precision: float = 1e-3,
        horizon: float = 1000.0,
    ) -> None:
        self.counts = counts
        self.discount = check_number("discount", discount, low=0.0, high=1.0)
        self.untried = None if untried is None else check_number("untried", untried)
        self.horizon = check_number("horizon", horizon, low=1.0)
        settings = np.empty(4)
        settings[_sweeping.DISCOUNT] = self.discount
        settings[_sweeping.THRESHOLD] = check_number("precision", precision, low=0.0) * max(
            1.0 - self.discount, 1e-3
        )
        settings[_sweeping.UNTRIED] = unknown = np.nan if untried is None else untried
        settings[_sweeping.HORIZON] = self.horizon
        shape = counts.arrays.visits.shape
        self._arrays = _sweeping.MDPArrays(
            counts=counts.arrays,
            counters=np.array([0, _sweeping.NO_SAVEPOINT], np.int64),
            values=np.zeros(shape[0]),
            action_values=np.full(shape, unknown),
            heap=np.full((2, shape[0]), _sweeping.NO_PLACE, np.int32),
            priority=np.zeros(shape[0]),
            touched=np.zeros((2, shape[0]), np.int32),
            saved=np.empty((shape[0], 2 + 2 * shape[1])),
            settings=settings,
        )

    @property
    def arrays(self) -> _sweeping.MDPArrays:
        """All that it holds, for compiled loops; other arrays after it has grown."""
        if self._arrays.counts is not self.counts.arrays:
            self._arrays = self._arrays._replace(counts=self.counts.arrays)
        return self._arrays

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return self.counts.n_states

    @property
    def values(self) -> Floats:
        """V(s) (Eq. 6), shape [S]; a state in which nothing was tried keeps the value it had."""
        return read_only(self._arrays.values[: self.n_states])

    @values.setter
    def values(self, values: ArrayLike) -> None:
        self._drop_savepoint()
        self._arrays.values[: self.n_states] = values

    @property
    def action_values(self) -> Floats:
        """Q(s, a) (Eq. 5) as of the last backup of each state, shape [S, A]."""
        return read_only(self._arrays.action_values[: self.n_states])

    @property
    def nbytes(self) -> int:
        """Bytes held in arrays."""
        own = (array for array in self.arrays if isinstance(array, np.ndarray))
        return sum(array.nbytes for array in (*self.arrays.counts, *own))

    def observe(
        self, state: int, action: int, reward: float, next_state: int, backups: int = 0
    ) -> None:
        """Count one transition, put its state on top of the queue and do some backups.

        Args:
            state: Where it began.
            action: The action taken.
            reward: The reward received.
            next_state: Where it led, or TERMINAL.
            backups: How many states of highest priority to back up.
        """
        status = _sweeping.observe(self.arrays, state, action, reward, next_state, backups)
        if status == _kernels.DONE:
            return
        if status == _sweeping.BAD_TRANSITION:
            raise InvalidArgumentError(
                f"a transition must have states in 0..{self.n_states - 1} (the next one also "
                f"TERMINAL = -1), an action in 0..{self.counts.n_actions - 1} and a finite reward, "
                f"got state {state}, action {action}, reward {reward}, next state {next_state}"
            )
        self.counts.make_room()
        self.observe(state, action, reward, next_state, backups)

    def add_state(self, value: float = 0.0) -> int:
        """Add a state, for one half of a split leaf; return its number.

        Args:
            value: Its V until it is backed up or solved, such as its parent's.
        """
        self._drop_savepoint()
        state = self.counts.add_state()
        room, old = len(self.counts.arrays.visits), self._arrays
        if room > len(old.values):
            self._arrays = old._replace(
                values=grown(old.values, room),
                action_values=grown(old.action_values, room, old.settings[_sweeping.UNTRIED]),
                heap=grown(old.heap.T, room, _sweeping.NO_PLACE).T.copy(),
                priority=grown(old.priority, room),
                touched=np.zeros((2, room), np.int32),
                saved=np.empty((room, old.saved.shape[1])),
            )
        self._arrays.values[state] = value
        return state

    def queue(self, states: ArrayLike | None = None) -> None:
        """Put states (all of them if None) on top of the queue of prioritized sweeping."""
        self._drop_savepoint()
        chosen = range(self.n_states) if states is None else np.asarray(states).tolist()
        heap, priority, counters = self._arrays.heap, self._arrays.priority, self._arrays.counters
        for state in chosen:
            state = check_integer("states", state, high=self.n_states - 1)
            _sweeping.push(heap, priority, counters, state, _sweeping.SOON)

    def sweep(self, backups: int) -> int:
        """Back up at most so many states in order of priority; return how many were.

        Fewer than asked for means that the queue is empty.
        """
        return _sweeping.sweep(self.arrays, backups)

    def solve(self, *, tolerance: float = 1e-6) -> Solution:
        """Solve exactly for V and Q, from the present values; the queue is emptied."""
        solution = solve(
            self.counts.model(),
            self.discount,
            tolerance=tolerance,
            initial_values=self.values,
            untried=self.untried,
            horizon=self.horizon,
        )
        self.values = solution.values
        self._arrays.action_values[: self.n_states] = solution.action_values
        self._arrays.heap[_sweeping.PLACE] = _sweeping.NO_PLACE
        self._arrays.counters[_sweeping.QUEUED] = 0
        return solution

    def state(self) -> dict[str, NDArray[Any]]:
        """Return copies of the arrays that counts do not determine: V, Q, queue, reward sums."""
        arrays = self._arrays
        return {
            "values": self.values.copy(),
            "action_values": self.action_values.copy(),
            "reward_sums": self.counts.reward_sums.copy(),
            "queue": arrays.heap[_sweeping.ORDER, : arrays.counters[_sweeping.QUEUED]].copy(),
            "priority": arrays.priority[: self.n_states].copy(),
        }

    def savepoint(self) -> None:
        """Let ``rollback`` come back to here, until anything but ``observe`` or ``sweep`` is done.

        Only the queue is copied now; each state is saved before its first change.
        """
        self._drop_savepoint()
        arrays = self._arrays
        self._queue = arrays.heap[_sweeping.ORDER, : arrays.counters[_sweeping.QUEUED]].copy()
        self._version = self.counts.version
        arrays.counters[_sweeping.TOUCHED] = 0

    def rollback(self) -> None:
        """Take back V, Q, the queue and reward sums as they were at the savepoint, to the bit.

        Counts are taken back by ``counts.forget`` before.
        """
        touched = self._arrays.counters[_sweeping.TOUCHED]
        if touched == _sweeping.NO_SAVEPOINT or self._version != self.counts.version:
            raise InvalidArgumentError("rollback needs a savepoint that still holds")
        _sweeping.roll_back(self.arrays, self._queue)
        self._drop_savepoint()

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take back the arrays of ``state()``, for an MDP that holds the same counts."""
        self._drop_savepoint()
        arrays, n_states, queue = self.arrays, self.n_states, state["queue"]
        arrays.values[:n_states] = state["values"]
        arrays.action_values[:n_states] = state["action_values"]
        arrays.counts.reward_sums[:n_states] = state["reward_sums"]
        arrays.priority[:n_states] = state["priority"]
        arrays.heap[:] = _sweeping.NO_PLACE
        arrays.heap[_sweeping.ORDER, : queue.size] = queue
        arrays.heap[_sweeping.PLACE, queue] = np.arange(queue.size)
        arrays.counters[_sweeping.QUEUED] = queue.size

    def _drop_savepoint(self) -> None:
        """Save no more."""
        touched, counters = self._arrays.touched, self._arrays.counters
        if counters[_sweeping.TOUCHED] > 0:
            touched[_sweeping.LISTED, touched[_sweeping.LIST, : counters[_sweeping.TOUCHED]]] = 0
        counters[_sweeping.TOUCHED] = _sweeping.NO_SAVEPOINT
