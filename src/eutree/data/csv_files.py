"""Demonstrations as CSV: one row for each observation, floats written so that they read back.

The columns ``episode`` and ``action`` are required, ``step``, ``action_name``, ``reward``,
``terminated``, ``truncated``, ``seed``, ``ending``, ``is_success`` and ``kept`` are known; every
other column is a feature, its unit in brackets: ``position [m]``. The last row of an episode has
no action: it is what the last action led to. In a log without such rows the last action of each
episode is dropped, because what it led to is not known; the episode's extras keep it, under
``dropped_action``. Actions are indices, or names. An episode has a reward for each action, or none
at all.
"""

import csv
import io
import math
import re
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from eutree.arrays import Floats
from eutree.data.episode import DROPPED, MAX_NAMES, Episode
from eutree.data.log_format import (
    KNOWN,
    MAX_CATEGORIES,
    CsvTable,
    LogFormat,
    LogRows,
    Row,
    hint,
    is_nothing,
    label,
)
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import write_text
from eutree.schema import Feature, Schema, numbered_actions
from eutree.validation import check_finite

MAX_NUMBERS = 24 * 2**20  # of all rows: features, action and reward
MAX_EPISODES = 100_000

_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+(?:[eE][-+]?\d+)?\s*")
_INDEX = re.compile(r"[0-9]{1,5}")
_SEED = re.compile(r"[0-9]{1,99}")
_TRUTH = {"": None, "true": True, "false": False, "1": True, "0": False}


class CsvReader:
    """A table of episodes.

    It is read row by row, keeping numbers and not text. The arguments are those of
    ``Demonstrations.from_csv``.

    Attributes:
        episodes: The episodes, in the order in which they begin.
        schema: The schema that was given or made.

    Raises:
        InvalidArgumentError: ``columns`` names an unknown column, or ``delimiter`` is none.
        FormatError: A column is missing, or a value is not what it must be; says which line.
        FileError: The file is missing or cannot be read.
    """

    def __init__(
        self,
        path: str | Path,
        schema: Schema | None,
        *,
        columns: Mapping[str, str] | None = None,
        delimiter: str | None = None,
        log: LogFormat | None = None,
    ) -> None:
        self._path = path
        self._log = log or LogFormat()
        self._table = CsvTable(path, columns or {}, delimiter, self._log)
        self._codes: dict[str, int] = {}  # of the texts in the column action
        self._names: dict[str, str] = {}  # what action_name says about them
        self._categories: dict[str, dict[str, int]] = {name: {} for name in self._log.nominal}
        groups: dict[tuple[str, int], _EpisodeRows] = {}
        log_rows = LogRows(path, self._log, self._table)
        numbers = 0
        for line, row in self._table.rows():
            episode = log_rows.episode_of(line, row)
            if episode is None:
                continue
            group = groups.setdefault(episode, _EpisodeRows())
            numbers += len(self._table.features) + 2
            if len(groups) > MAX_EPISODES:
                raise FormatError(path, f"line {line}", f"more than {MAX_EPISODES:,} episodes")
            if numbers > MAX_NUMBERS:
                raise FormatError(path, f"line {line}", f"more than {MAX_NUMBERS:,} numbers")
            self._add(group, line, row)
        names = self._labels()
        if schema is not None and schema.n_features != len(names):
            reason = f"expected {schema.n_features} features, got columns {names}"
            raise FormatError(path, "line 1", reason)
        self._texts = list(self._codes)
        self.schema = self._made_schema() if schema is None else schema
        indices = [self._index(code) for code in range(len(self._texts))]
        self._indices = np.array(indices, dtype=np.int64)
        self.episodes = tuple(self._episode(group) for group in groups.values())

    def _labels(self) -> list[str]:
        """Return the features, one for each category of a nominal column of more than two."""
        labels = []
        for column in self._table.features:
            if len(self._categories.get(column, ())) > 2:
                labels += [f"{column} is {name}" for name in sorted(self._categories[column])]
            else:
                labels.append(label(column))
        return labels

    def _add(self, group: "_EpisodeRows", line: int, row: Row) -> None:
        """Add a row to its episode."""
        if group.observations and not group.last_row["action"]:
            reason = "only an episode's last row may have no action"
            raise FormatError(self._path, f"line {group.last_line}", reason)
        group.observations.extend([self._value(row, name, line) for name in self._table.features])
        group.last_line, group.last_row = line, row
        if row["action"]:
            if any(group.ends[-1]):
                reason = "the episode ended on an earlier line"
                raise FormatError(self._path, f"line {line}", reason)
            group.actions.append(self._code(row, line))
            self._add_reward(group, line, row)
        if row["action"] or not group.actions:
            flags = (self._truth(row, name, line) for name in ("terminated", "truncated"))
            group.ends = (group.ends[-1], (next(flags) is True, next(flags) is True))

    def _add_reward(self, group: "_EpisodeRows", line: int, row: Row) -> None:
        """Add the reward of a row: an episode has one for each action, or none."""
        known = bool(row.get("reward"))
        if group.rewards and known != group.has_rewards:
            reason = "reward must be there for every action of an episode, or for none"
            raise FormatError(self._path, f"line {line}", reason)
        group.has_rewards = known
        group.rewards.append(self._number(row, "reward", line) if known else 0.0)

    def _code(self, row: Row, line: int) -> int:
        code = self._codes.setdefault(row["action"], len(self._codes))
        if code >= MAX_NAMES:
            raise FormatError(self._path, f"line {line}", f"more than {MAX_NAMES:,} actions")
        if row["action"] not in self._names and row.get("action_name"):
            self._names[row["action"]] = row["action_name"]
        return code

    def _made_schema(self) -> Schema:
        """Return a schema of what the columns and the actions tell."""
        actions = tuple(self._codes)
        if self._log.actions:
            actions = self._log.actions
        elif all(map(str.isdecimal, actions)):
            large = [a for a in actions if not _INDEX.fullmatch(a) or int(a) >= MAX_NAMES]
            if large:
                reason = f"must be an index below {MAX_NAMES:,}, got {large[0]}"
                raise FormatError(self._path, "action", reason)
            highest = max(map(int, actions), default=0)
            unnamed = numbered_actions(highest + 1)
            names = {int(text): name for text, name in self._names.items()}
            actions = tuple(names.get(k, name) for k, name in enumerate(unnamed))
        elif all(map(_is_quantity, actions)):
            actions = tuple(sorted(actions, key=float))
        try:
            return Schema(tuple(map(self._feature, self._labels())), actions)
        except InvalidArgumentError as error:
            raise FormatError(self._path, "", str(error)) from None

    def _feature(self, name: str) -> Feature:
        if name in self._categories:
            categories = tuple(sorted(self._categories[name]))
            return Feature(name, "", 0.0, len(categories) - 1.0, True, categories)
        column, _, category = name.rpartition(" is ")
        if category in self._categories.get(column, ()):
            return Feature(name, low=0.0, high=1.0, is_integer=True, group=column)
        return Feature.from_label(name)

    def _observations(self, group: "_EpisodeRows") -> Floats:
        """Return the observations of an episode, categories as features of their own, [T, d]."""
        values = np.frombuffer(group.observations).reshape(-1, len(self._table.features))
        if not self._categories:
            return values
        columns: list[Floats] = []
        for number, column in enumerate(self._table.features):
            if column in self._categories:
                codes = self._categories[column]
                each = [1.0 * (values[:, number] == codes[name]) for name in sorted(codes)]
                columns += each if len(codes) > 2 else each[1:] or [np.zeros(len(values))]
            else:
                columns.append(values[:, number])
        return np.stack(columns, axis=1)

    def _episode(self, group: "_EpisodeRows") -> Episode:
        row, line = group.last_row, group.last_line
        dropped = bool(row["action"])  # what the last action led to is not in the table
        extras = {DROPPED: int(self._indices[group.actions[-1]])} if dropped else {}
        count = len(group.actions) - dropped
        terminated, truncated = group.ends[0] if dropped else group.ends[1]
        actions = self._indices[np.frombuffer(group.actions, dtype=np.int64)[:count]]
        try:
            return Episode(
                self._observations(group),
                actions,
                np.frombuffer(group.rewards)[:count],
                terminated=terminated,
                truncated=truncated,
                seed=self._seed(row, line),
                ending=row.get("ending", ""),
                is_success=self._truth(row, "is_success", line),
                kept=self._truth(row, "kept", line) is not False,
                has_rewards=group.has_rewards,
                extras=extras,
            )
        except InvalidArgumentError as error:
            raise FormatError(self._path, f"line {line}", str(error)) from None

    def _index(self, code: int) -> int:
        """Return the action that a text in the column means: an index, or else a name."""
        text, names = self._texts[code], self.schema.actions
        if self._log.actions and text in names:
            return names.index(text)
        if _INDEX.fullmatch(text) and int(text) < len(names):
            return int(text)
        if text in names:
            return names.index(text)
        reason = f"must be one of {', '.join(names)} or its index, got {text!r}"
        raise FormatError(self._path, "action", reason)

    def _value(self, row: Row, column: str, line: int) -> float:
        """Return the number in a cell, that of its category where it is text."""
        if column not in self._categories:
            return self._number(row, column, line)
        codes, text = self._categories[column], row[column].strip()
        if not text:
            reason = f"{column} must be a category, got {text!r}{hint(text, column)}"
            raise FormatError(self._path, f"line {line}", reason)
        code = codes.setdefault(text, len(codes))
        if code >= MAX_CATEGORIES:
            reason = f"{column} has more than {MAX_CATEGORIES} categories; leave it out by --drop"
            raise FormatError(self._path, f"line {line}", reason)
        return float(code)

    def _number(self, row: Row, column: str, line: int) -> float:
        text = row[column]
        if self._table.delimiter != "," and _DECIMAL_COMMA.fullmatch(text):
            text = text.replace(",", ".")
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number) or "_" in text:
            comma = _DECIMAL_COMMA.fullmatch(text)
            more = ", with a decimal point" if comma else ""
            special = _is_special(text) and not is_nothing(text)
            what = "" if comma or special else hint(text, column)
            reason = f"{column} must be a finite number{more}, got {text!r}{what}"
            raise FormatError(self._path, f"line {line}", reason)
        return number

    def _truth(self, row: Row, column: str, line: int) -> bool | None:
        text = row.get(column, "").lower()
        if text not in _TRUTH:
            reason = f"{column} must be true or false, got {text!r}"
            raise FormatError(self._path, f"line {line}", reason)
        return _TRUTH[text]

    def _seed(self, row: Row, line: int) -> int | None:
        text = row.get("seed", "")
        if text and not _SEED.fullmatch(text):
            reason = f"seed must be an integer >= 0, got {text!r}"
            raise FormatError(self._path, f"line {line}", reason)
        return int(text) if text else None


class _EpisodeRows:
    """The rows of one episode so far."""

    __slots__ = ("actions", "ends", "has_rewards", "last_line", "last_row", "observations",
                 "rewards")  # fmt: skip

    def __init__(self) -> None:
        self.observations = array("d")
        self.actions = array("q")
        self.rewards = array("d")
        self.has_rewards = True
        # Terminated and truncated after the last action but one, and after the last.
        self.ends = ((False, False), (False, False))
        self.last_line = 0
        self.last_row: Row = {}


def _is_special(text: str) -> bool:
    """Return whether a text is read as a number, but as none that is finite."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _is_quantity(text: str) -> bool:
    return _is_special(text) and math.isfinite(float(text))


def write_csv(path: str | Path, episodes: Sequence[Episode], schema: Schema) -> None:
    """Write all episodes, discarded ones included.

    Raises:
        InvalidArgumentError: A feature has the name of a known column, or a value is not finite.
        FileError: The file cannot be written.
    """
    features = [f"{f.name} [{f.unit}]" if f.unit else f.name for f in schema.features]
    if set(features) & set(KNOWN) or len(set(features)) < len(features):
        raise InvalidArgumentError(f"features must not be named like columns, got {features}")
    buffer = io.StringIO()
    writer = csv.writer(buffer)
    writer.writerow([*KNOWN, *features])
    for number, episode in enumerate(episodes):
        check_finite(f"episode {number}: observations", episode.observations)
        check_finite(f"episode {number}: rewards", episode.rewards)
        writer.writerows(_lines(number, episode, schema))
    write_text(path, buffer.getvalue())


def _lines(number: int, episode: Episode, schema: Schema) -> list[list[str]]:
    success = "" if episode.is_success is None else str(episode.is_success).lower()
    seed = "" if episode.seed is None else str(episode.seed)
    tail = [seed, episode.ending, success, str(episode.kept).lower()]
    lines = []
    for step, observation in enumerate(episode.observations.tolist()):
        last = step >= len(episode) - 1
        ends = [str(end and last).lower() for end in (episode.terminated, episode.truncated)]
        middle = ["", "", ""]
        if step < len(episode):
            action = int(episode.actions[step])
            reward = repr(float(episode.rewards[step])) if episode.has_rewards else ""
            middle = [str(action), schema.actions[action], reward]
        lines.append([str(number), str(step), *middle, *ends, *tail, *map(repr, observation)])
    return lines
