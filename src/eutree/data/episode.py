"""One episode (the paper's *trial*): T+1 observations, T actions and rewards, how it ended.

Logs and other libraries keep flat rows, one a step: an observation and the action taken there. No
row shows where the last action of an episode led; unless the log holds that apart, the action is
dropped rather than given an invented successor; the episode's extras keep it. Nothing is ever
shifted.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Frozen, Integers, freeze, frozen
from eutree.display import counted
from eutree.errors import InvalidArgumentError, shown
from eutree.features import FeatureMap
from eutree.schema import Schema
from eutree.validation import (
    check_actions,
    check_integer,
    check_kind,
    check_observations,
    check_truth,
    check_vector,
    check_whole,
)

SPOILT = 2  # steps before a person stepped in, or before a failure, that nobody approved
ALLOWED = "allowed"  # of ``steps``: which actions were allowed, [T, A]
TAUGHT = "taught"  # of ``steps``: which action is to be imitated, [T]; ``CUT`` for none
CUT = -1
STOPPED, INTERRUPTED = "stopped", "interrupted"  # endings by a person and by a crash
AGAIN = "shown_again"  # of an episode's ``extras``: it went on from a segment of another one


def masks_of(rows: Sequence[ArrayLike | None]) -> Booleans | None:
    """Return which actions were allowed at some steps, shape [T, A]; None where all were."""
    known = next((row for row in rows if row is not None), None)
    if known is None:
        return None
    every = np.ones_like(known)
    return np.array([every if row is None else row for row in rows])


def allowed_in(episodes: "Iterable[Episode]") -> Booleans | None:
    """Return which actions were allowed at each transition of some episodes, shape [N, A].

    None where nothing was masked.
    """
    return stacked_masks((episode.allowed, len(episode)) for episode in episodes)


def stacked_masks(parts: "Iterable[tuple[Booleans | None, int]]") -> Booleans | None:
    """Return the masks of parts of so many steps, one after the other; None where none has one."""
    masks = list(parts)
    known = next((rows for rows, _ in masks if rows is not None), None)
    if known is None:
        return None
    every = np.ones((1, known.shape[1]), dtype=np.bool_)
    return np.concatenate([every.repeat(n, 0) if rows is None else rows for rows, n in masks])


@dataclass(frozen=True, eq=False)
class Episode(Frozen):
    """An episode from reset to end.

    Attributes:
        observations: The values sensed, from the reset observation to the last one.
        actions: Action taken at each observation but the last.
        rewards: Reward received for each action; zeros where none are known.
        terminated: Whether the task itself ended the episode (value 0 follows).
        truncated: Whether a limit outside the task cut it short (its value goes on).
        seed: Seed given to ``reset``; None if unknown.
        ending: Why it ended, in the environment's words ("goal", "collision", "time limit"),
            or "stopped" where a person ended it (then neither terminated nor truncated).
        is_success: ``info["is_success"]`` of the last step; None where none was reported.
        has_rewards: Whether the rewards are known. A log without them can be imitated, but there is
            nothing in it to learn from by reinforcement.
        kept: Whether learners use it; a person who discards an episode does not delete it.
        comment: The person's words about it.
        steps: Further arrays with one row for each action, by name: of a recording its
            ``time``, ``frame`` (the last one seen) and ``keys`` (held). NaN means not measured.
            ``by_hand`` says where a person took over from a tree that drove, ``allowed``, where
            actions are masked, which were not; ``taught`` which action is to be imitated, -1 for
            none, where that is another one than was taken.
        extras: Further facts about the episode in JSON's types, for example the names of the
            keys.
    """

    observations: Floats  # [T + 1, d]
    actions: Integers  # [T]
    rewards: Floats  # [T]
    terminated: bool
    truncated: bool
    seed: int | None = None
    ending: str = ""
    is_success: bool | None = None
    kept: bool = True
    comment: str = ""
    steps: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # each [T, ...]
    extras: Mapping[str, Any] = field(default_factory=dict)
    has_rewards: bool = True

    def __post_init__(self) -> None:
        freeze(self, "observations", "rewards", dtype=np.float64)
        check_whole("actions", self.actions)
        freeze(self, "actions", dtype=np.int64)
        if self.observations.ndim != 2 or self.actions.ndim != 1 or self.rewards.ndim != 1:
            raise InvalidArgumentError(
                "an episode must have observations [T + 1, d], actions [T] and rewards [T], got "
                f"shapes {self.observations.shape}, {self.actions.shape}, {self.rewards.shape}"
            )
        if len(self.observations) != len(self.actions) + 1:
            raise InvalidArgumentError(
                "expected one more observations than actions: "
                f"{len(self.observations)} != {len(self.actions)} + 1"
            )
        if len(self.rewards) != len(self.actions):
            raise InvalidArgumentError(
                f"expected as many rewards as actions: {len(self.rewards)} != {len(self.actions)}"
            )
        # NumPy's truth values and integers become Python's, which a file holds.
        for name in ("terminated", "truncated", "kept", "has_rewards", "is_success"):
            value = getattr(self, name)
            if value is not None or name != "is_success":
                object.__setattr__(self, name, check_truth(name, value))
        for name in ("ending", "comment"):
            object.__setattr__(self, name, str(check_kind(name, getattr(self, name), str)))
        if self.seed is not None:
            object.__setattr__(self, "seed", check_integer("seed", self.seed))
        steps = {name: frozen(np.asarray(array)) for name, array in self.steps.items()}
        if (masks := steps.get(ALLOWED)) is not None and masks.dtype != bool:
            if not np.isin(masks, (0, 1)).all():
                raise InvalidArgumentError(f"steps['allowed'] must be 0 or 1, got {shown(masks)}")
            steps[ALLOWED] = frozen(masks.astype(bool))
        for name, array in steps.items():
            if array.ndim < 1 or len(array) != len(self.actions):
                raise InvalidArgumentError(
                    f"steps[{name!r}] must have {len(self.actions)} rows, one for each action, "
                    f"got shape {array.shape}"
                )
        object.__setattr__(self, "steps", steps)
        object.__setattr__(self, "extras", dict(self.extras))
        if self.terminated and self.truncated:
            raise InvalidArgumentError("an episode must not be both terminated and truncated")
        if not self.has_rewards and self.rewards.any():
            raise InvalidArgumentError("an episode without rewards must have zeros in their place")

    def __repr__(self) -> str:
        """Return a summary in one line."""
        earned = f", return {self.undiscounted_return:g}" if self.has_rewards else ""
        ending = f", {self.ending}" if self.ending else ""
        return f"<Episode: {counted(len(self), 'step')}{earned}{ending}>"

    def __len__(self) -> int:
        """Return the number of steps T."""
        return len(self.actions)

    @property
    def by_hand(self) -> Booleans | None:
        """In which steps a person acted in place of the tree that drove, [T]; None where none did.

        Such an episode says nothing of how well person or tree do alone.
        """
        steps = self.steps.get("by_hand")
        return None if steps is None else np.asarray(steps, dtype=bool)

    @property
    def is_evidence(self) -> bool:
        """Whether the episode says how well its demonstrator does, alone and from any start.

        Then it was played to its end, no tree drove in it, and it did not begin where a tree had
        failed (``extras["chosen_start"]``).
        """
        ended = self.terminated or self.truncated
        return ended and self.by_hand is None and not self.extras.get("chosen_start")

    @property
    def was_stopped(self) -> bool:
        """Whether a person or a crash ended it: it would have gone on, and earned otherwise."""
        return not (self.terminated or self.truncated) and self.ending in (STOPPED, INTERRUPTED)

    @property
    def taught(self) -> Integers:
        """Which action is to be imitated at each step, [T]; ``CUT`` where none is."""
        return np.asarray(self.steps.get(TAUGHT, self.actions), dtype=np.int64)

    def teaching(self, taught: Integers) -> "Episode":
        """Return the episode with other actions to imitate, [T]; the actions taken stay."""
        steps = {name: array for name, array in self.steps.items() if name != TAUGHT}
        same = np.array_equal(taught, self.actions)
        return replace(self, steps=steps if same else {**steps, TAUGHT: taught})

    def teaching_in(self, start: int, stop: int, becomes: int | None) -> "Episode":
        """Return the episode with an action to imitate in some steps; None for nothing."""
        taught = self.taught.copy()
        taught[start:stop] = CUT if becomes is None else becomes
        return self.teaching(taught)

    @property
    def weights(self) -> Floats:
        """Weight of each step for imitating the episode, [T]: 1, or 0.

        A tree's step that a person let pass is approved, but for the ``SPOILT`` steps before the
        person stepped in, or before a failure.
        """
        weights, by_hand = np.ones(len(self)), self.by_hand
        if by_hand is None:
            return weights
        ends = [] if self.is_success is not False else [len(self)]
        for end in [*(np.flatnonzero(by_hand[1:] & ~by_hand[:-1]) + 1).tolist(), *ends]:
            weights[max(end - SPOILT, 0) : end] = 0.0
        weights[by_hand] = 1.0
        return weights

    @cached_property
    def undiscounted_return(self) -> float:
        """Sum of the rewards; 0 where none are known."""
        return float(self.rewards.sum())

    @property
    def allowed(self) -> Booleans | None:
        """Which actions were allowed at each step, shape [T, A]; None where nothing is masked."""
        return self.steps.get(ALLOWED)

    def equals(self, other: "Episode") -> bool:
        """Return whether both are the same, arrays bit for bit."""
        return self._parts() == other._parts()

    def _parts(self) -> dict[str, Any]:
        """Return the fields by name, arrays as type, shape and bytes."""
        steps = {name: _bits(array) for name, array in self.steps.items()}
        found = {one.name: getattr(self, one.name) for one in fields(self)} | {"steps": steps}
        return {k: _bits(v) if isinstance(v, np.ndarray) else v for k, v in found.items()}

    def with_features(self, features: FeatureMap) -> "Episode":
        """Return the episode with the features of a map in place of its observations."""
        return replace(self, observations=features.of_episode(self.observations, self.actions))


def _bits(array: NDArray[Any]) -> tuple[Any, ...]:
    return array.dtype, array.shape, array.tobytes()


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
    action_masks: ArrayLike | None = None,
    ends_in_place: bool = False,
) -> tuple[Episode, ...]:
    """Return the episodes in flat rows; see ``Demonstrations.from_arrays``."""
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
    masks = None if action_masks is None else np.asarray(action_masks, dtype=bool)
    if masks is not None and masks.shape[:-1] != (n,):
        raise InvalidArgumentError(f"action_masks must be of shape ({n}, A), got {masks.shape}")
    parts = partial(_episode, before, after, chosen, earned, ends)
    cut = partial(parts, masks=masks, in_place=ends_in_place)
    made = (cut(slice(*span)) for span in spans)
    known = rewards is not None
    return tuple(replace(episode, has_rewards=known) for episode in made if len(episode))


def schema_for(episodes: tuple[Episode, ...], n_features: int, schema: Schema | None) -> Schema:
    """Return the given schema, or one without names that fits the episodes.

    Raises:
        InvalidArgumentError: None is given, and the data ask for an absurd number of names.
    """
    if schema is not None:
        return schema
    highest = max((int(e.actions.max()) for e in episodes if len(e)), default=0)
    highest = max([highest, *(e.allowed.shape[1] - 1 for e in episodes if e.allowed is not None)])
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
    *,
    masks: Booleans | None,
    in_place: bool,
) -> Episode:
    """Return the episode in some rows; refuse rows that contradict each other."""
    terminated, truncated = (flags[rows] for flags in ends)
    if terminated[:-1].any() or truncated[:-1].any():
        raise InvalidArgumentError(
            f"rows {rows.start} to {rows.stop - 1} must be one episode, but it ends before the last"
        )
    observations, kept = before[rows], rows
    cut_short = after is None  # the step that ended the episode is the one that is dropped
    if after is None and in_place and terminated[-1]:
        observations, cut_short = np.concatenate([observations, observations[-1:]]), False
    elif after is None:
        kept = slice(rows.start, rows.stop - 1)
    elif np.array_equal(after[rows][:-1], observations[1:]):
        observations = np.concatenate([observations, after[rows][-1:]])
    else:
        raise InvalidArgumentError(
            f"next_observations must be the observations one row later within an episode; "
            f"they differ in rows {rows.start} to {rows.stop - 1}"
        )
    is_terminated, is_truncated = bool(terminated[-1]), bool(truncated[-1])
    return Episode(
        observations,
        actions[kept],
        rewards[kept],
        terminated=is_terminated and not cut_short,
        truncated=is_truncated and not is_terminated and not cut_short,
        ending="terminated" if is_terminated else "truncated" if is_truncated else "",
        steps={} if masks is None else {ALLOWED: masks[kept]},
        extras={DROPPED: int(actions[rows][-1])} if cut_short else {},
    )
