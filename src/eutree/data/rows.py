"""Episodes from flat rows, one a step, as logs and other libraries keep them.

A row holds an observation and the action taken there. What the last action of an episode led to
is in no row; where the log does not hold it apart, that action is dropped rather than given an
invented successor; the episode's extras keep it. Nothing is ever shifted.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Integers
from eutree.data.episode import Episode
from eutree.errors import InvalidArgumentError
from eutree.schema import Schema
from eutree.validation import check_actions, check_observations, check_vector

MAX_NAMES = 10_000
DROPPED = "dropped_action"  # key of an episode's extras: the action whose successor is not known


def episodes_from_rows(
    observations: ArrayLike,
    actions: ArrayLike,
    *,
    starts: ArrayLike,
    rewards: ArrayLike | None = None,
    next_observations: ArrayLike | None = None,
    terminated: ArrayLike | None = None,
    truncated: ArrayLike | None = None,
) -> tuple[Episode, ...]:
    """Return the episodes in flat rows.

    Args:
        observations: What was sensed before each action, shape [N, d].
        actions: The actions, shape [N].
        starts: Whether each row is the first of an episode, shape [N]; the first must be.
        rewards: What each action earned, shape [N]; if not known, the episodes have none.
        next_observations: What was sensed after each action, shape [N, d]; if not known, the
            last action of each episode is dropped.
        terminated: Whether the task ended after each row, shape [N].
        truncated: Whether a limit cut the episode short after each row, shape [N].
    """
    before = check_observations("observations", observations)
    n = len(before)
    chosen = check_actions("actions", actions, size=n)
    earned = np.zeros(n) if rewards is None else check_vector("rewards", rewards, size=n)
    first = _flags("starts", starts, n)
    if n and not first[0]:
        raise InvalidArgumentError("starts must be true in the first row, got False")
    after = None
    if next_observations is not None:
        after = check_observations(
            "next_observations", next_observations, n_features=before.shape[1]
        )
        if len(after) != n:
            raise InvalidArgumentError(f"next_observations must have {n} rows, got {len(after)}")
    ends = (_flags("terminated", terminated, n), _flags("truncated", truncated, n))
    begins = np.flatnonzero(first)
    spans = zip(begins.tolist(), [*begins[1:].tolist(), n], strict=True) if n else ()
    made = (_episode(before, after, chosen, earned, ends, slice(*span)) for span in spans)
    known = rewards is not None
    return tuple(replace(episode, has_rewards=known) for episode in made if len(episode))


def starts_from_ends(ends: ArrayLike) -> Booleans:
    """Return whether each row starts an episode, given whether each ends one."""
    flags = np.asarray(ends, dtype=bool)
    return np.concatenate([[True], flags[:-1]]) if flags.size else flags


def rows_of(episodes: tuple[Episode, ...], n_features: int) -> dict[str, NDArray[Any]]:
    """Return the episodes as flat rows, under the names of ``episodes_from_rows``."""
    episodes = tuple(episode for episode in episodes if len(episode))
    lengths = np.array([len(episode) for episode in episodes], dtype=np.int64)
    ends = np.cumsum(lengths)
    n = int(lengths.sum())
    starts, terminated, truncated = (np.zeros(n, dtype=bool) for _ in range(3))
    starts[ends - lengths] = True
    terminated[ends - 1] = [e.terminated for e in episodes]
    truncated[ends - 1] = [e.truncated for e in episodes]
    empty = np.empty((0, n_features))
    return {
        "observations": np.concatenate([empty, *(e.observations[:-1] for e in episodes)]),
        "actions": np.concatenate([np.empty(0, np.int64), *(e.actions for e in episodes)]),
        "starts": starts,
        "rewards": np.concatenate([np.empty(0), *(e.rewards for e in episodes)]),
        "next_observations": np.concatenate([empty, *(e.observations[1:] for e in episodes)]),
        "terminated": terminated,
        "truncated": truncated,
    }


def schema_for(episodes: tuple[Episode, ...], n_features: int, schema: Schema | None) -> Schema:
    """Return the given schema, or one without names that fits the episodes.

    Raises:
        InvalidArgumentError: None is given, and the data ask for an absurd number of names.
    """
    if schema is not None:
        return schema
    highest = max((int(e.actions.max()) for e in episodes if len(e)), default=0)
    for name, number in (("features", n_features), ("actions", highest + 1)):
        if not 1 <= number <= MAX_NAMES:
            raise InvalidArgumentError(
                f"{name} must be from 1 to {MAX_NAMES:,} where no schema names them, got {number}"
            )
    return Schema.anonymous(n_features, highest + 1)


def _flags(name: str, value: ArrayLike | None, size: int) -> Booleans:
    if value is None:
        return np.zeros(size, dtype=bool)
    array = np.asarray(value)
    if array.shape != (size,) or not (array.dtype == bool or np.isin(array, (0, 1)).all()):
        raise InvalidArgumentError(
            f"{name} must hold {size} truth values, got {array.dtype} of shape {array.shape}"
        )
    return array.astype(bool)


def _episode(
    before: Floats,
    after: Floats | None,
    actions: Integers,
    rewards: Floats,
    ends: tuple[Booleans, Booleans],
    rows: slice,
) -> Episode:
    """Return the episode in some rows; refuse rows that contradict each other."""
    terminated, truncated = (flags[rows] for flags in ends)
    if terminated[:-1].any() or truncated[:-1].any():
        raise InvalidArgumentError(
            f"rows {rows.start} to {rows.stop - 1} must be one episode, but it ends before the last"
        )
    here, kept = before[rows], rows
    if after is None:
        kept = slice(rows.start, rows.stop - 1)
        observations = here
    else:
        if not np.array_equal(after[rows][:-1], here[1:]):
            raise InvalidArgumentError(
                f"next_observations must be the observations one row later within an episode; "
                f"they differ in rows {rows.start} to {rows.stop - 1}"
            )
        observations = np.concatenate([here, after[rows][-1:]])
    is_terminated, is_truncated = bool(terminated[-1]), bool(truncated[-1])
    cut_short = after is None  # the step that ended the episode is the one that is dropped
    return Episode(
        observations,
        actions[kept],
        rewards[kept],
        terminated=is_terminated and not cut_short,
        truncated=is_truncated and not is_terminated and not cut_short,
        ending="terminated" if is_terminated else "truncated" if is_truncated else "",
        extras={DROPPED: int(actions[rows][-1])} if cut_short else {},
    )
