"""Episodes recorded under an expert's control, with all that is needed to read and replay them."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Frozen, Integers
from eutree.data.episode import CUT, TAUGHT, Episode, allowed_in, episodes_from_rows, schema_for
from eutree.data.files import DemonstrationFolder, misfit, save_folder
from eutree.display import Displayed, counted
from eutree.errors import InvalidArgumentError, blamed
from eutree.features import Derivation, FeatureMap
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.validation import check_finite, check_kind, columns_of, data_frame, in_order

if TYPE_CHECKING:
    from eutree.data.log_format import LogFormat


@dataclass(frozen=True, eq=False)
class Demonstrations(Displayed, Frozen):
    """Episodes of one environment under one expert.

    Iterating, counting and the arrays ``observations`` and ``actions`` see the kept episodes;
    ``episodes`` also holds those that a person discarded.

    Attributes:
        episodes: The episodes, in the order in which they were recorded.
        schema: Names, units and bounds of the observations; names of the actions.
        environment: How to make the environment again; None if unknown.
        expert: The actor's name, for people to read.
    """

    episodes: tuple[Episode, ...]
    schema: Schema
    environment: EnvironmentSpec | None = None
    expert: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "episodes", tuple(self.episodes))
        for number, episode in enumerate(self.episodes):
            if problem := misfit(episode, self.schema):
                raise InvalidArgumentError(f"episode {number} {problem}")

    def __repr__(self) -> str:
        """Return a summary in one line; the numbers themselves would be pages."""
        discarded = len(self.episodes) - len(self)
        of = f" of {self.environment}" if self.environment is not None else ""
        by = f", by {self.expert}" if self.expert else ""
        return (
            f"<Demonstrations{of}: {counted(len(self), 'episode')}"
            + (f" ({discarded} discarded)" if discarded else "")
            + f", {counted(self.n_transitions, 'transition')}{by}>"
        )

    @property
    def kept(self) -> tuple[Episode, ...]:
        """The episodes that count: all but the discarded ones."""
        return tuple(episode for episode in self.episodes if episode.kept)

    def __len__(self) -> int:
        """Return the number of kept episodes."""
        return len(self.kept)

    def __iter__(self) -> Iterator[Episode]:
        """Iterate over the kept episodes."""
        return iter(self.kept)

    @property
    def n_transitions(self) -> int:
        """Number of transitions in the kept episodes."""
        return sum(map(len, self.kept))

    @property
    def digest(self) -> str:
        """SHA-256 over the kept episodes: the same demonstrations have the same digest."""
        sha = hashlib.sha256()
        for episode in self.kept:
            for array in (episode.observations, episode.actions, episode.rewards):
                sha.update(array.tobytes())
            if TAUGHT in episode.steps:
                sha.update(episode.taught.tobytes())
            if episode.allowed is not None:
                sha.update(episode.allowed.tobytes())
            sha.update(bytes([episode.terminated, episode.truncated]))
        return sha.hexdigest()

    @property
    def observations(self) -> Floats:
        """Observation at the start of each transition of the kept episodes, shape [N, d]."""
        rows = [episode.observations[:-1] for episode in self.kept]
        return np.concatenate([np.empty((0, self.schema.n_features)), *rows])

    @property
    def actions(self) -> Integers:
        """Action of each transition of the kept episodes, shape [N]."""
        return np.concatenate([np.empty(0, np.int64), *(e.actions for e in self.kept)])

    def to_pandas(self) -> Any:
        """Return a data frame with a row for each transition of the kept episodes.

        Its index is the number of the episode among ``episodes`` and the step; its columns are the
        features, ``action`` (by name) and ``reward`` (NaN where it is not known).

        Raises:
            InvalidArgumentError: A feature is called ``action`` or ``reward``.
            MissingExtraError: pandas is not installed.
        """
        names = self.schema.feature_names
        if {"action", "reward"} & set(names):
            raise InvalidArgumentError(
                f"features must not be named action or reward for a data frame, got {list(names)}"
            )
        numbered = [(k, episode) for k, episode in enumerate(self.episodes) if episode.kept]
        steps = [np.arange(len(episode)) for _, episode in numbered]
        rewards = [e.rewards if e.has_rewards else np.full(len(e), np.nan) for _, e in numbered]
        columns = dict(zip(names, self.observations.T, strict=True))
        columns["action"] = np.array(self.schema.actions, dtype=object)[self.actions]
        columns["reward"] = np.concatenate([np.empty(0), *rewards])
        lengths = [len(episode) for _, episode in numbered]
        episodes = np.repeat(np.array([k for k, _ in numbered], dtype=np.int64), lengths)
        index = {"episode": episodes, "step": np.concatenate([np.empty(0, np.int64), *steps])}
        return data_frame(columns, index=index)

    def with_history(self, steps: int, actions: int = 0) -> "Demonstrations":
        """Return the demonstrations with the past among their observations.

        Args:
            steps: Number of previous observations that follow each one.
            actions: Number of previous actions that follow these.
        """
        schema = self.schema.with_history(steps, actions)  # refuses too many
        features = FeatureMap(
            n_observed=self.schema.n_features,
            n_actions=self.schema.n_actions,
            observations=steps,
            actions=actions,
        )
        seen = tuple(episode.with_features(features) for episode in self.episodes)
        return replace(self, episodes=seen, schema=schema)

    def save(self, folder: str | Path) -> None:
        """Write one file for each episode, and a header, into a new folder.

        Raises:
            FileError: The folder exists and is not empty, or cannot be written; then nothing is
                left behind.
            InvalidArgumentError: An observation or reward is not finite.
        """
        save_folder(folder, self.episodes, self.schema, self.environment, self.expert)

    @classmethod
    def load(cls, folder: str | Path) -> "Demonstrations":
        """Read the files of ``save`` or of a recorder, discarded episodes included.

        An episode that a dead recorder left in its journal is among them, its ending
        ``"interrupted"``; nothing in the folder is changed.

        Raises:
            FormatError: The folder holds no demonstrations, or a file in it is damaged.
            FileError: The folder is missing or cannot be read.
        """
        opened = DemonstrationFolder(folder)
        return cls(
            tuple(opened.read_all().values()), opened.schema, opened.environment, opened.expert
        )

    @classmethod
    def from_arrays(
        cls,
        observations: ArrayLike,
        actions: ArrayLike,
        *,
        starts: ArrayLike,
        rewards: ArrayLike | None = None,
        next_observations: ArrayLike | None = None,
        terminated: ArrayLike | None = None,
        truncated: ArrayLike | None = None,
        schema: Schema | None = None,
        environment: EnvironmentSpec | None = None,
        expert: str = "",
    ) -> "Demonstrations":
        """Make demonstrations of a log: flat rows of observations and actions.

        Args:
            observations: The values sensed before each action, shape [N, d]; the columns of a
                frame are taken by their names.
            actions: The actions, shape [N].
            starts: Whether each row is the first of an episode, shape [N].
            rewards: Reward of each action, shape [N]; if not known, the episodes can be imitated
                but not learned from by reinforcement.
            next_observations: The values sensed after each action, shape [N, d]; if not known, the
                last action of each episode is dropped, because its successor is not known, and
                kept in the episode's ``extras["dropped_action"]``.
            terminated: Whether the task ended after each row, shape [N].
            truncated: Whether a limit cut the episode short after each row, shape [N].
            schema: Names and units; if not known, the names of a frame's columns, or made up.
            environment: How to make the environment again, if known.
            expert: The actor's name.
        """
        labels = columns_of(observations)
        known = labels if all(isinstance(label, str) for label in labels) else []
        names = known if schema is None else schema.feature_names
        episodes = episodes_from_rows(
            in_order("observations", observations, names),
            actions,
            starts=starts,
            rewards=rewards,
            next_observations=in_order("next_observations", next_observations, names),
            terminated=terminated,
            truncated=truncated,
        )
        made = schema_for(episodes, np.shape(observations)[1], schema)
        if schema is None and names:
            made = replace(made, features=tuple(map(Feature, names)))
        return cls(episodes, made, environment, expert)

    @classmethod
    def from_npz(
        cls,
        path: str | Path,
        *,
        schema: Schema | None = None,
        environment: EnvironmentSpec | None = None,
        ends_in_place: bool = False,
    ) -> "Demonstrations":
        """Read arrays saved by imitation or Stable-Baselines, without pickle; see docs/formats.

        ``ends_in_place`` keeps the last action of an episode that terminated, if no observation
        follows, as if it had ended where that was taken.
        """
        from eutree.data.npz_files import read_npz

        episodes, n_features = read_npz(path, ends_in_place)
        with blamed(path):
            schema = schema_for(episodes, n_features, schema)
            return cls(episodes, schema, environment, Path(path).stem)

    def to_npz(self, path: str | Path) -> None:
        """Write the kept episodes as the arrays that imitation and Stable-Baselines use."""
        from eutree.data.npz_files import write_npz

        write_npz(path, self.kept, self.schema.n_features)

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        *,
        schema: Schema | None = None,
        environment: EnvironmentSpec | None = None,
        columns: Mapping[str, str] | None = None,
        delimiter: str | None = None,
        log: "LogFormat | None" = None,
    ) -> "Demonstrations":
        """Read a table with one row for each observation; see docs/formats.

        Where no row shows where an episode's last action led, that action is dropped, and kept
        in the episode's ``extras["dropped_action"]``.

        Args:
            path: The file with the table.
            schema: Names and units; made of the columns if not known.
            environment: How to make the environment again, if known.
            columns: The table's own names of the columns that are known by others:
                ``{"episode": "day", "action": "heater", "reward": "gain"}``.
            delimiter: The character between two values; None for the one that the first line shows.
            log: How a machine's log is to be read: its time, text, empty cells (``LogFormat``).
        """
        from eutree.data.csv_files import read_csv

        episodes, known, *_ = read_csv(path, schema, columns=columns, delimiter=delimiter, log=log)
        with blamed(path):
            return cls(episodes, known, environment, Path(path).stem)

    def to_csv(self, path: str | Path) -> None:
        """Write a table with one row for each observation, discarded episodes included."""
        from eutree.data.csv_files import write_csv

        write_csv(path, self.episodes, self.schema)

    @classmethod
    def from_minari(cls, dataset_id: str) -> "Demonstrations":
        """Read a Minari dataset from the local folder (extra ``minari``)."""
        from eutree.data.minari_files import read_minari

        content = read_minari(dataset_id)
        with blamed(f"minari:{dataset_id}"):
            return cls(*content)

    def to_minari(self, dataset_id: str) -> None:
        """Write the kept episodes as a Minari dataset (extra ``minari``).

        Args:
            dataset_id: Its id, ending in a version: ``eutree/evasion2/human-v0``.
        """
        from eutree.data.minari_files import write_minari

        write_minari(dataset_id, (self.episodes, self.schema, self.environment, self.expert))


def derive(
    demonstrations: Demonstrations, declarations: Sequence[str | Feature], *, anew: bool = False
) -> Demonstrations:
    """Return demonstrations with derived features behind their observations.

    Args:
        demonstrations: The recorded episodes.
        declarations: ``"time_to_crossing = distance / speed"`` and the like; see
            ``eutree.formulas``.
        anew: Whether in place of those that they have.

    Raises:
        InvalidArgumentError: A declaration is none, or a value would not be finite.
        UnknownNameError: A formula names no feature.
    """
    known = demonstrations.schema
    schema = (known.measured if anew else known).derive(declarations)
    derivation = Derivation.of(schema)
    seen = []
    for episode in demonstrations.episodes:
        rows = derivation.of_episode(episode.observations[:, : derivation.n_measured])
        check_finite("derived features", rows)
        seen.append(replace(episode, observations=rows))
    return replace(demonstrations, episodes=tuple(seen), schema=schema)


def taught_in(demonstrations: Demonstrations) -> Integers:
    """Return the action to imitate at each transition of the kept episodes, [N]; ``CUT``: none."""
    return np.concatenate([np.empty(0, np.int64), *(e.taught for e in demonstrations)])


def check_shown(demonstrations: Demonstrations) -> None:
    """Raise InvalidArgumentError unless these are demonstrations with a transition."""
    if not check_kind("demonstrations", demonstrations, Demonstrations).n_transitions:
        raise InvalidArgumentError(
            "demonstrations must hold at least one transition, got "
            f"{len(demonstrations)} episodes without a step"
        )
    check_finite("observations", demonstrations.observations)


def weights_in(demonstrations: Demonstrations) -> Floats:
    """Return how much each transition of the kept episodes counts where it is imitated, [N]."""
    return np.concatenate([np.empty(0), *(one.weights for one in demonstrations.kept)])


def lessons(demonstrations: Demonstrations) -> tuple[Floats, Integers]:
    """Return the steps to imitate: observations [n, d] and actions [n], without those cut."""
    taught = taught_in(demonstrations)
    return demonstrations.observations[taught != CUT], taught[taught != CUT]


def lesson_masks(demonstrations: Demonstrations) -> Booleans | None:
    """Return which actions were allowed at these steps, [n, A]; None where none was masked."""
    allowed = allowed_in(demonstrations)
    return None if allowed is None else allowed[taught_in(demonstrations) != CUT]


def teaching(demonstrations: Demonstrations, taught: Integers) -> Demonstrations:
    """Return demonstrations with other actions to imitate, [N] as of ``taught_in``."""
    parts, begin = [], 0
    for episode in demonstrations.episodes:
        end = begin + len(episode) if episode.kept else begin
        parts.append(episode.teaching(taught[begin:end]) if episode.kept else episode)
        begin = end
    return replace(demonstrations, episodes=tuple(parts))


def check_rewards(demonstrations: Demonstrations, *, alone: bool = False) -> None:
    """Raise InvalidArgumentError unless there is something to learn from by reinforcement.

    Where these are learned from ``alone``, rewards that are all 0 say nothing.
    """
    without = "a tree that imitates them needs none: eutree fit"
    for number, episode in enumerate(demonstrations.episodes):
        if episode.kept and not episode.has_rewards:
            raise InvalidArgumentError(
                f"demonstrations must have rewards to be learned from by reinforcement, but those "
                f"of episode {number} are not known; {without}"
            )
    if alone and not any(episode.rewards.any() for episode in demonstrations.kept):
        raise InvalidArgumentError(
            f"demonstrations must have rewards to be learned from by reinforcement, but all of "
            f"theirs are 0; {without}"
        )
