"""Compiled loops of the learner: the store's rows, leaf membership lists and targets."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import compiled_later

NO_ROW = -1
TERMINAL = -1


class StoredRows(NamedTuple):
    """The columns of the store that an episode is written to, with room for N rows."""

    observations: Floats  # [N, d]
    next_observations: Floats  # [N, d]
    actions: Int32s  # [N]
    rewards: Floats  # [N]
    episodes: Int32s  # [N]
    continues: Booleans  # [N]
    left: Int32s  # [N]
    entered: Int32s  # [N]
    demonstrated: Booleans  # [N]
    left_link: Integers  # [N] next row that left the same leaf
    entered_link: Integers  # [N] next row that entered the same leaf


class RowLists(NamedTuple):
    """One linked list of rows for each leaf."""

    head: Integers  # [L]
    tail: Integers  # [L]
    counts: Integers  # [L]


class EpisodeColumns(NamedTuple):
    """An episode to be stored."""

    observations: Floats  # [T + 1, d]
    actions: Integers  # [T]
    rewards: Floats  # [T]
    leaves: Int32s  # [T + 1]
    demonstrated: bool


@compiled_later
def append_rows(
    rows: StoredRows,
    left: RowLists,
    entered: RowLists,
    episode: EpisodeColumns,
    stored: Booleans,  # [T] which transitions to write
    first: int,
    number: int,
    terminated: bool,
) -> int:
    """Write the transitions of episode ``number`` from row ``first`` on; return the row behind."""
    steps = stored.size
    row = first
    for t in range(steps):  # rows first..row - 1 hold the transitions before t that are stored
        if not stored[t]:
            continue
        for j in range(rows.observations.shape[1]):
            rows.observations[row, j] = episode.observations[t, j]
            rows.next_observations[row, j] = episode.observations[t + 1, j]
        rows.actions[row] = episode.actions[t]
        rows.rewards[row] = episode.rewards[t]
        rows.episodes[row] = number
        # A return goes on from one row into the next only if they were steps in succession.
        rows.continues[row] = t > 0 and stored[t - 1]
        rows.left[row] = episode.leaves[t]
        # Only a true end has no leaf behind it: after a truncation values still bootstrap.
        rows.entered[row] = TERMINAL if terminated and t == steps - 1 else episode.leaves[t + 1]
        rows.demonstrated[row] = episode.demonstrated
        row += 1
    # The caller has made room for all T rows, so no write above is checked.
    written = np.arange(first, row)
    append_to_lists(written, rows.left, left, rows.left_link)
    append_to_lists(written, rows.entered, entered, rows.entered_link)
    return row


@compiled_later
def append_to_lists(
    rows: Integers,  # [n], ascending
    labels: Int32s,  # [N]
    lists: RowLists,
    link: Integers,  # [N]
) -> None:
    """Append rows to the lists of their labels; a negative label has no list."""
    head, tail, count = lists.head, lists.tail, lists.counts
    for row in rows:  # the rows before it are linked, each list in ascending order
        link[row] = NO_ROW
        label = labels[row]
        if label < 0:
            continue
        # An empty list has a head and a tail left over from before: only its count tells.
        if count[label] == 0:
            head[label] = row
        else:
            link[tail[label]] = row
        tail[label] = row
        count[label] += 1


@compiled_later
def walk_list(start: int, link: Integers, out: Integers) -> None:
    """Write the rows of one list to ``out``, in ascending order."""
    row = start
    # The caller knows how many there are, so the end of the list is not looked for.
    for i in range(out.size):
        out[i] = row
        row = link[row]


@compiled_later
def lambda_targets(
    rows: Integers,  # [n]
    stored: StoredRows,
    values: Floats,  # [L]
    greedy: Int32s,  # [L]
    discount: float,
    decay: float,
    out: Floats,  # [n]
) -> None:
    """Write the lambda-return of each row, cut at the first action that is not greedy.

    Row i + 1 follows row i when it ``continues`` it. The return goes on into the next row
    only while that row's action is the greedy one of its leaf (Watkins's Q(lambda)); there it
    bootstraps with the value of the leaf entered.
    """
    actions, rewards, left, entered = stored.actions, stored.rewards, stored.left, stored.entered
    n_rows = rewards.size
    for i in range(rows.size):
        row = rows[i]
        total = 0.0
        weight = 1.0
        while True:  # total holds the terms of the rows before; weight = (discount decay)^their no.
            total += weight * rewards[row]
            if entered[row] < 0:
                break
            # The action of the row itself counts whatever it was; those after it only while greedy.
            follows = row + 1 < n_rows and stored.continues[row + 1]
            if not follows or actions[row + 1] != greedy[left[row + 1]]:
                total += weight * discount * values[entered[row]]
                break
            # The share 1 - decay ends here with the value of the leaf, the rest goes on.
            total += weight * discount * (1.0 - decay) * values[entered[row]]
            weight *= discount * decay
            row += 1
        out[i] = total
