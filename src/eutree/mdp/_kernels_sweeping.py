"""Compiled loops of prioritized sweeping: the queue, the backup of a state, the learner's step.

Apart from the loops over counts because together they are too long to read. They are compiled into
these: after a change there, remove the cached machine code of these too (``__pycache__``).
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import compiled
from eutree.mdp._kernels import (
    COUNT,
    DONE,
    KEY,
    NO_ROOM,
    SIZE,
    START,
    STATES,
    TERMINAL,
    CountArrays,
    has_room,
    link,
)

QUEUED, TOUCHED = 0, 1  # entries of the counters
ORDER, PLACE = 0, 1  # rows of the heap: state in each slot, slot of each state
LIST, LISTED = 0, 1  # rows of the touched states: each of them, and whether a state is one
DISCOUNT, THRESHOLD, UNTRIED, HORIZON = 0, 1, 2, 3  # entries of the settings

NO_PLACE = -1
NO_SAVEPOINT = -1  # of TOUCHED
SOON = 1e300  # before all changes, but after the state that was just left
BAD_TRANSITION = -3


class MDPArrays(NamedTuple):
    """All that an MDP over leaves holds; S counts the states there is room for."""

    counts: CountArrays
    counters: Integers  # [2] states queued; touched since the savepoint, or ``NO_SAVEPOINT``
    values: Floats  # [S] V(s)
    action_values: Floats  # [S, A] Q(s, a)
    heap: Int32s  # [2, S] state in each slot of the queue, and slot of each state
    priority: Floats  # [S] priority of each queued state
    touched: Int32s  # [2, S] states touched since the savepoint, and whether each state is one
    saved: Floats  # [S, 2 + 2 A] V, priority, Q and reward sums of these at the savepoint
    settings: Floats  # [4] discount, threshold, value of the untried, horizon


@compiled
def _precedes(priority: Floats, one: int, other: int) -> bool:
    """Return whether state ``one`` is popped before ``other``; ties go to the lower number."""
    return bool(
        priority[one] > priority[other] or (priority[one] == priority[other] and one < other)
    )


@compiled
def _sift_up(heap: Int32s, priority: Floats, slot: int) -> None:
    """Restore the heap after the state in ``slot`` rose."""
    state = heap[ORDER, slot]
    # The slot is a hole: all else is in order, and ``state`` precedes all below the hole.
    while slot > 0:
        above = (slot - 1) // 2
        if not _precedes(priority, state, heap[ORDER, above]):
            break
        heap[ORDER, slot] = heap[ORDER, above]
        heap[PLACE, heap[ORDER, slot]] = slot
        slot = above
    heap[ORDER, slot] = state
    heap[PLACE, state] = slot


@compiled
def push(heap: Int32s, priority: Floats, counters: Integers, state: int, value: float) -> None:
    """Queue the state with this priority, or raise the one it has; never lower it."""
    if heap[PLACE, state] == NO_PLACE:
        heap[ORDER, counters[QUEUED]] = state
        priority[state] = value
        counters[QUEUED] += 1
        _sift_up(heap, priority, counters[QUEUED] - 1)
    elif value > priority[state]:
        priority[state] = value
        _sift_up(heap, priority, heap[PLACE, state])


@compiled
def pop(heap: Int32s, priority: Floats, counters: Integers) -> int:
    """Take the state of the highest priority from the queue, which is not empty."""
    top = heap[ORDER, 0]
    heap[PLACE, top] = NO_PLACE
    counters[QUEUED] -= 1
    size = counters[QUEUED]
    if size == 0:
        return int(top)
    state = heap[ORDER, size]
    slot = 0
    # The hole at the top sinks until the queue's last state, which fills it, precedes both below.
    while 2 * slot + 1 < size:
        below = 2 * slot + 1
        if below + 1 < size and _precedes(priority, heap[ORDER, below + 1], heap[ORDER, below]):
            below += 1
        if not _precedes(priority, heap[ORDER, below], state):
            break
        heap[ORDER, slot] = heap[ORDER, below]
        heap[PLACE, heap[ORDER, slot]] = slot
        slot = below
    heap[ORDER, slot] = state
    heap[PLACE, state] = slot
    return int(top)


@compiled
def back_up(mdp: MDPArrays, state: int, loops: Integers) -> float:
    """Set V (Eq. 6) and Q (Eq. 5) of one state, its loops to itself solved; return |change| of V.

    With r the summed rewards, n the visits and l the loops of an action, staying with it until it
    leaves is worth (r + discount * sum over the other successors) / (n - discount l).

    ``loops`` is scratch, shape [A].
    """
    table, pool, visits = mdp.counts.table, mdp.counts.pool, mdp.counts.visits
    values, action_values, settings = mdp.values, mdp.action_values, mdp.settings
    n_actions = visits.shape[1]
    discount = settings[DISCOUNT]
    best, endless = -np.inf, -np.inf
    # best and endless are the largest worths, of the actions before a, of going on and of staying.
    for a in range(n_actions):
        if visits[state, a] == 0:
            action_values[state, a] = settings[UNTRIED]
            if settings[UNTRIED] > best:  # false for NaN: untried actions are left out
                best = settings[UNTRIED]
            continue
        row = state * (n_actions + 1) + a
        total, own = 0.0, 0
        # Keys ascend, so the last bit of the sum depends on the counts alone, not on their history.
        for k in range(table[row, START], table[row, START] + table[row, SIZE]):
            key = pool[k, KEY]
            if key == state:
                own = pool[k, COUNT]
            elif key != TERMINAL:
                total += pool[k, COUNT] * values[key]
        loops[a] = own  # for the second pass: to search the row again costs a tenth of a backup
        worth = mdp.counts.reward_sums[state, a] + discount * total
        action_values[state, a] = worth
        leaving = visits[state, a] - discount * own
        if leaving > 0.0:
            if worth / leaving > best:
                best = worth / leaving
        elif worth / visits[state, a] * settings[HORIZON] > endless:
            endless = worth / visits[state, a] * settings[HORIZON]
    # A loop that never ends (discount 1) is chosen where it pays, or where nothing else was tried.
    if endless > best and (endless > 0.0 or best == -np.inf):
        best = endless
    if best == -np.inf:
        return 0.0
    # action_values holds summed worths without the loops from action a on, and Q before it.
    for a in range(n_actions):
        if visits[state, a] > 0:
            action_values[state, a] += discount * loops[a] * best
            action_values[state, a] /= visits[state, a]
    change = abs(best - values[state])
    values[state] = best
    return float(change)


@compiled
def _save(mdp: MDPArrays, state: int) -> None:
    """Keep a state's V, priority, Q and reward sums, before the first change after a savepoint."""
    mdp.touched[LIST, mdp.counters[TOUCHED]] = state
    mdp.touched[LISTED, state] = 1
    mdp.counters[TOUCHED] += 1
    n_actions = mdp.action_values.shape[1]
    mdp.saved[state, 0] = mdp.values[state]
    mdp.saved[state, 1] = mdp.priority[state]
    for a in range(n_actions):
        mdp.saved[state, 2 + a] = mdp.action_values[state, a]
        mdp.saved[state, 2 + n_actions + a] = mdp.counts.reward_sums[state, a]


@compiled
def roll_back(mdp: MDPArrays, queue: Int32s) -> None:
    """Restore every state that was touched since the savepoint, and the queue.

    ``queue`` has the slots of the heap at the savepoint, shape [n].
    """
    counters, heap, saved = mdp.counters, mdp.heap, mdp.saved
    n_actions = mdp.action_values.shape[1]
    for i in range(counters[TOUCHED]):  # the states before the i-th are restored
        state = mdp.touched[LIST, i]
        mdp.values[state] = saved[state, 0]
        mdp.priority[state] = saved[state, 1]
        for a in range(n_actions):
            mdp.action_values[state, a] = saved[state, 2 + a]
            mdp.counts.reward_sums[state, a] = saved[state, 2 + n_actions + a]
    for slot in range(counters[QUEUED]):
        heap[PLACE, heap[ORDER, slot]] = NO_PLACE
    for slot in range(queue.size):
        heap[ORDER, slot] = queue[slot]
        heap[PLACE, queue[slot]] = slot
    counters[QUEUED] = queue.size


@compiled
def sweep(mdp: MDPArrays, budget: int) -> int:
    """Back up the states of highest priority; return how many backups were done."""
    table, pool, counters = mdp.counts.table, mdp.counts.pool, mdp.counters
    heap, priority, touched = mdp.heap, mdp.priority, mdp.touched
    threshold = mdp.settings[THRESHOLD]
    n_actions = mdp.counts.visits.shape[1]
    visits = mdp.counts.visits.reshape(-1)  # [S A] of each pair
    saving = counters[TOUCHED] != NO_SAVEPOINT
    loops = np.empty(n_actions, np.int64)
    backups = 0
    # Every change of V above the threshold has gone on to the priorities of the states before it.
    while backups < budget and counters[QUEUED] > 0:
        state = pop(heap, priority, counters)
        if saving and not touched[LISTED, state]:
            _save(mdp, state)
        change = back_up(mdp, state, loops)
        backups += 1
        if change <= threshold:
            continue
        row = state * (n_actions + 1) + n_actions
        for k in range(table[row, START], table[row, START] + table[row, SIZE]):
            pair = pool[k, KEY]
            # Pr times the change: as much as Q of the pair can change (Moore and Atkeson 1993).
            value = pool[k, COUNT] / visits[pair] * change
            if not value > threshold:
                continue
            before = pair // n_actions
            if before == state:
                continue
            if heap[PLACE, before] != NO_PLACE and not value > priority[before]:
                continue  # as push would find, without the cost of the call
            if saving and not touched[LISTED, before]:
                _save(mdp, before)
            push(heap, priority, counters, before, value)
    return backups


@compiled
def observe(
    mdp: MDPArrays, state: int, action: int, reward: float, next_state: int, budget: int
) -> int:
    """Count one transition, put its state on top of the queue and sweep; return the status.

    Nothing has been changed where the status is not ``DONE``.
    """
    counts = mdp.counts
    n_states, n_actions = counts.counters[STATES], counts.visits.shape[1]
    # Compiled code checks no index, and these come from outside; all later ones derive from them.
    if not (
        0 <= state < n_states
        and 0 <= action < n_actions
        and TERMINAL <= next_state < n_states
        and abs(reward) < np.inf
    ):
        return BAD_TRANSITION
    pair = state * n_actions + action
    if not has_room(counts.table, counts.pool, counts.counters, n_actions, pair, next_state):
        return NO_ROOM
    link(counts.table, counts.pool, counts.counters, n_actions, pair, next_state)
    if mdp.counters[TOUCHED] != NO_SAVEPOINT and not mdp.touched[LISTED, state]:
        _save(mdp, state)
    counts.visits[state, action] += 1
    counts.reward_sums[state, action] += reward
    push(mdp.heap, mdp.priority, mdp.counters, state, np.inf if budget > 0 else SOON)
    sweep(mdp, budget)
    return DONE
