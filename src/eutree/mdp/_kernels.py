"""Compiled loops over the counts of the leaf MDP.

Transitions are kept as *rows*: sorted lists of (key, count) in one pool. State s of A actions owns
A + 1 rows: row s (A + 1) + a lists the successors of (s, a), its last row the pairs s' A + a that
lead to s. Sorted rows make every sum a function of the counts alone, not of the order of the
transitions. A row that is full moves to the end of the pool with twice the capacity; the caller
repacks the pool when a kernel answers ``NO_ROOM``, before which nothing has been changed.
"""

from typing import NamedTuple

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import compiled

START, SIZE, CAPACITY = 0, 1, 2  # columns of the table of rows
KEY, COUNT = 0, 1  # columns of the pool
USED, STATES = 0, 1  # entries of the counters

TERMINAL = -1
FIRST_CAPACITY = 4

DONE = 0
NO_ROOM = -1
NO_TRANSITION = -2


class CountArrays(NamedTuple):
    """The counts of transitions; S is how many states there is room for."""

    table: Int32s  # [S (A + 1), 3]; where each row of counts begins, its size and its capacity
    pool: Int32s  # [K, 2]; the entries of all rows: key and count
    counters: Integers  # [2]; entries used of the pool, and number of states
    visits: Integers  # [S, A]; N(s, a)
    reward_sums: Floats  # [S, A]; sum of the rewards of each state and action


class DiscreteTransitions(NamedTuple):
    """Transitions (s, a, r, s')."""

    states: Int32s  # [N]
    actions: Int32s  # [N]
    rewards: Floats  # [N]
    next_states: Int32s  # [N]


@compiled
def _search(pool: Int32s, start: int, size: int, key: int) -> int:
    """Return the first place in the row whose key is not below ``key``."""
    low, high = start, start + size
    # Keys before low are below ``key``, those from high on are not.
    while low < high:
        middle = (low + high) // 2
        if pool[middle, KEY] < key:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def count_of(table: Int32s, pool: Int32s, row: int, key: int) -> int:
    """Return the count of ``key`` in the row; 0 where it is absent."""
    start, size = table[row, START], table[row, SIZE]
    at = _search(pool, start, size, key)
    if at < start + size and pool[at, KEY] == key:
        return int(pool[at, COUNT])
    return 0


@compiled
def _increment(table: Int32s, pool: Int32s, counters: Integers, row: int, key: int) -> None:
    """Count ``key`` once more in the row; the pool has room."""
    start, size, capacity = table[row, START], table[row, SIZE], table[row, CAPACITY]
    at = _search(pool, start, size, key)
    if at < start + size and pool[at, KEY] == key:
        pool[at, COUNT] += 1
        return
    # The row moves to the end of the pool; its old places are lost until the pool is repacked.
    if size == capacity:
        moved = counters[USED]
        for k in range(size):
            pool[moved + k, KEY] = pool[start + k, KEY]
            pool[moved + k, COUNT] = pool[start + k, COUNT]
        at += moved - start
        start = moved
        # Doubling: over its life a row moves each entry about once.
        capacity = max(FIRST_CAPACITY, 2 * capacity)
        counters[USED] += capacity
        table[row, START] = start
        table[row, CAPACITY] = capacity
    # From the end, so that no entry is overwritten before it has moved.
    for k in range(start + size, at, -1):
        pool[k, KEY] = pool[k - 1, KEY]
        pool[k, COUNT] = pool[k - 1, COUNT]
    pool[at, KEY] = key
    pool[at, COUNT] = 1
    table[row, SIZE] = size + 1


@compiled
def _decrement(table: Int32s, pool: Int32s, row: int, key: int) -> None:
    """Count ``key`` once less in the row, where it is present; drop it at zero."""
    start, size = table[row, START], table[row, SIZE]
    at = _search(pool, start, size, key)
    pool[at, COUNT] -= 1
    if pool[at, COUNT] == 0:
        for k in range(at, start + size - 1):
            pool[k, KEY] = pool[k + 1, KEY]
            pool[k, COUNT] = pool[k + 1, COUNT]
        table[row, SIZE] = size - 1


@compiled
def has_room(
    table: Int32s, pool: Int32s, counters: Integers, n_actions: int, pair: int, next_state: int
) -> bool:
    """Return whether both rows of a transition could move to the end of the pool."""
    # At worst both rows move. Asked for both at once, so that a transition is counted in both of
    # its rows or in neither.
    row = pair // n_actions * (n_actions + 1) + pair % n_actions
    needed = max(FIRST_CAPACITY, 2 * table[row, CAPACITY])
    if next_state != TERMINAL:
        back = next_state * (n_actions + 1) + n_actions
        needed += max(FIRST_CAPACITY, 2 * table[back, CAPACITY])
    return bool(counters[USED] + needed <= pool.shape[0])


@compiled
def link(
    table: Int32s, pool: Int32s, counters: Integers, n_actions: int, pair: int, next_state: int
) -> None:
    """Count a transition in the row of its pair and in the row of its next state."""
    row = pair // n_actions * (n_actions + 1) + pair % n_actions
    _increment(table, pool, counters, row, next_state)
    if next_state != TERMINAL:
        _increment(table, pool, counters, next_state * (n_actions + 1) + n_actions, pair)


@compiled
def _unlink(table: Int32s, pool: Int32s, n_actions: int, pair: int, next_state: int) -> bool:
    """Take back one count of a transition; return whether there was one."""
    row = pair // n_actions * (n_actions + 1) + pair % n_actions
    if count_of(table, pool, row, next_state) == 0:
        return False
    # Both rows were counted together, so the other one has it too.
    _decrement(table, pool, row, next_state)
    if next_state != TERMINAL:
        _decrement(table, pool, next_state * (n_actions + 1) + n_actions, pair)
    return True


@compiled
def observe_rows(counts: CountArrays, rows: DiscreteTransitions, first: int) -> int:
    """Count the transitions from row ``first`` on; return the row at which room ran out, or N."""
    table, pool, counters = counts.table, counts.pool, counts.counters
    n_actions = counts.visits.shape[1]
    for i in range(first, rows.states.shape[0]):  # the rows first..i - 1 are counted
        s, a = rows.states[i], rows.actions[i]
        pair = s * n_actions + a
        if not has_room(table, pool, counters, n_actions, pair, rows.next_states[i]):
            return i
        link(table, pool, counters, n_actions, pair, rows.next_states[i])
        counts.visits[s, a] += 1
        counts.reward_sums[s, a] += rows.rewards[i]
    return int(rows.states.shape[0])


@compiled
def forget_rows(counts: CountArrays, rows: DiscreteTransitions) -> int:
    """Take the transitions back; return the row that was never counted, or N."""
    visits, reward_sums = counts.visits, counts.reward_sums
    n_actions = visits.shape[1]
    for i in range(rows.states.shape[0]):  # the rows before i are taken back
        s, a = rows.states[i], rows.actions[i]
        pair = s * n_actions + a
        if not _unlink(counts.table, counts.pool, n_actions, pair, rows.next_states[i]):
            return i
        visits[s, a] -= 1
        reward_sums[s, a] -= rows.rewards[i]
        if visits[s, a] == 0:  # the differences of rounded sums leave no trace
            reward_sums[s, a] = 0.0
    return int(rows.states.shape[0])


@compiled
def relabel_rows(
    counts: CountArrays, old: DiscreteTransitions, new: DiscreteTransitions, first: int
) -> tuple[int, int]:
    """Move counts from old to new labels; return the row where it stopped (or N) and why."""
    table, pool, counters = counts.table, counts.pool, counts.counters
    n_actions = counts.visits.shape[1]
    for i in range(first, old.actions.shape[0]):  # the rows first..i - 1 have their new labels
        a = old.actions[i]
        before = old.states[i] * n_actions + a
        after = new.states[i] * n_actions + a
        if after == before and new.next_states[i] == old.next_states[i]:
            continue
        if not has_room(table, pool, counters, n_actions, after, new.next_states[i]):
            return i, NO_ROOM
        if not _unlink(table, pool, n_actions, before, old.next_states[i]):
            return i, NO_TRANSITION
        link(table, pool, counters, n_actions, after, new.next_states[i])
        counts.visits[old.states[i], a] -= 1
        counts.visits[new.states[i], a] += 1
    return int(old.actions.shape[0]), DONE


@compiled
def repack(
    table: Int32s,  # [S (A + 1), 3]
    pool: Int32s,  # [K, 2]
    larger: Int32s,  # [K', 2]
) -> int:
    """Move all rows to the front of ``larger``, each with room to grow; return its used size."""
    used = 0
    for row in range(table.shape[0]):
        start, size = table[row, START], table[row, SIZE]
        for k in range(size):
            larger[used + k, KEY] = pool[start + k, KEY]
            larger[used + k, COUNT] = pool[start + k, COUNT]
        table[row, START] = used
        # A quarter more, so that the rows in use do not all move again with the next steps.
        table[row, CAPACITY] = size + size // 4
        used += size + size // 4
    return used


class ModelArrays(NamedTuple):
    """The arrays of a model, with their meaning there."""

    indptr: Integers  # [S A + 1]
    successor: Int32s  # [K]
    probability: Floats  # [K]
    termination: Floats  # [S, A]


@compiled
def fill_model(counts: CountArrays, out: ModelArrays) -> int:
    """Write Pr (Eq. 3) row by row; return the number of entries."""
    table, pool, visits = counts.table, counts.pool, counts.visits
    n_states, n_actions = out.termination.shape
    filled = 0
    for s in range(n_states):
        for a in range(n_actions):  # the entries of the pairs before this one are written
            row = s * (n_actions + 1) + a
            for k in range(table[row, START], table[row, START] + table[row, SIZE]):
                # Pr(s, a, s') = n(s, a, s') / n(s, a); each row ascends, so sums over it have one
                # order.
                share = pool[k, COUNT] / visits[s, a]
                if pool[k, KEY] == TERMINAL:
                    out.termination[s, a] = share
                else:
                    out.successor[filled] = pool[k, KEY]
                    out.probability[filled] = share
                    filled += 1
            out.indptr[s * n_actions + a + 1] = filled
    return filled
