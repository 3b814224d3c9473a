"""Reading a table of episodes row by row, keeping numbers and not text."""

import csv
import io
import re
from array import array
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from eutree.data.episode import Episode
from eutree.data.rows import DROPPED, MAX_NAMES
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import read_bytes
from eutree.schema import Feature, Schema, numbered_actions
from eutree.validation import check_choice

MAX_CSV = 32 * 2**20
MAX_EPISODES = 100_000

KNOWN = (
    "episode",
    "step",
    "action",
    "action_name",
    "reward",
    "terminated",
    "truncated",
    "seed",
    "ending",
    "is_success",
    "kept",
)
REQUIRED = ("episode", "action")
_INDEX = re.compile(r"[0-9]{1,5}")
_SEED = re.compile(r"[0-9]{1,99}")
_TRUTH = {"": None, "true": True, "false": False, "1": True, "0": False}

_Row = dict[str, str]


class CsvReader:
    """A table of episodes.

    Args:
        path: The file.
        schema: Names and units; made from the columns if None.
        columns: The table's own names of known columns: ``{"episode": "day"}``.
        delimiter: The character between two values.

    Attributes:
        episodes: The episodes, in the order in which they begin.
        schema: The schema that was given or made.

    Raises:
        FormatError: A column is missing, or a value is not what it must be; says which line.
        FileError: The file is missing or cannot be read.
    """

    def __init__(
        self,
        path: str | Path,
        schema: Schema | None,
        *,
        columns: Mapping[str, str] | None = None,
        delimiter: str = ",",
    ) -> None:
        self._path = path
        self._own_names = _checked_columns(columns or {})
        self._delimiter = _checked_delimiter(delimiter)
        self._codes: dict[str, int] = {}  # of the texts in the column action
        self._names: dict[str, str] = {}  # what action_name says about them
        groups: dict[str, _EpisodeRows] = {}
        rows = self._rows()
        header = next(rows)[1]
        self._features = [column for column in header if column not in KNOWN]
        if schema is not None and schema.n_features != len(self._features):
            reason = f"expected {schema.n_features} features, got columns {self._features}"
            raise FormatError(path, "line 1", reason)
        for line, row in rows:
            group = groups.setdefault(row["episode"], _EpisodeRows())
            if len(groups) > MAX_EPISODES:
                raise FormatError(path, f"line {line}", f"more than {MAX_EPISODES:,} episodes")
            self._add(group, line, row)
        self._texts = list(self._codes)
        self.schema = self._made_schema() if schema is None else schema
        self.episodes = tuple(self._episode(group) for group in groups.values())

    def _rows(self) -> Iterator[tuple[int, _Row]]:
        """Yield the columns, then each row, with the number of its line."""
        content = io.BytesIO(read_bytes(self._path, limit=MAX_CSV))
        text = io.TextIOWrapper(content, "utf-8-sig", newline="")
        reader = csv.reader(text, strict=True, delimiter=self._delimiter)
        try:
            columns = self._renamed(next(reader, []))
            yield 1, dict.fromkeys(columns, "")
            for values in reader:
                if len(values) != len(columns):
                    reason = f"expected {len(columns)} values, got {len(values)}"
                    raise FormatError(self._path, f"line {reader.line_num}", reason)
                yield reader.line_num, dict(zip(columns, values, strict=True))
        except csv.Error as error:
            raise FormatError(self._path, f"line {reader.line_num}", str(error)) from None
        except UnicodeDecodeError:
            reason = "not UTF-8 text"
            raise FormatError(self._path, f"after line {reader.line_num}", reason) from None

    def _renamed(self, found: list[str]) -> list[str]:
        """Return the table's columns under the names that we know them by."""
        for name in self._own_names.values():
            if name not in found:
                raise FormatError(self._path, "line 1", f"there is no column {name!r} in {found}")
        known = {own: name for name, own in self._own_names.items()}
        columns = [known.get(column, column) for column in found]
        self._check_columns(columns, found)
        return columns

    def _check_columns(self, columns: list[str], found: list[str]) -> None:
        for name in REQUIRED:
            if name not in columns:
                reason = (
                    f"there is no column {name!r} in {found}; required are 'episode' and 'action', "
                    "or columns named by --episode-column and --action-column "
                    "(in Python columns={'episode': ..., 'action': ...})"
                )
                if name == "episode":
                    reason += "; a log in one piece is one episode: give it a column of zeros"
                if len(found) == 1 and any(mark in found[0] for mark in ";\t|"):
                    reason += "; and what separates the values by --delimiter"
                raise FormatError(self._path, "line 1", reason)
        if len(set(columns)) < len(columns):
            twice = sorted({name for name in columns if columns.count(name) > 1})
            reason = f"two columns have the same name: {', '.join(map(repr, twice))}"
            raise FormatError(self._path, "line 1", reason)
        if not 1 <= len(set(columns) - set(KNOWN)) <= MAX_NAMES:
            raise FormatError(self._path, "line 1", "there is no column of a feature, or too many")

    def _add(self, group: "_EpisodeRows", line: int, row: _Row) -> None:
        """Add a row to its episode."""
        if group.observations and not group.last_row["action"]:
            reason = "only an episode's last row may have no action"
            raise FormatError(self._path, f"line {group.last_line}", reason)
        group.observations.extend(self._number(row, name, line) for name in self._features)
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

    def _add_reward(self, group: "_EpisodeRows", line: int, row: _Row) -> None:
        """Add the reward of a row: an episode has one for each action, or none."""
        known = bool(row.get("reward"))
        if group.rewards and known != group.has_rewards:
            reason = "reward must be there for every action of an episode, or for none"
            raise FormatError(self._path, f"line {line}", reason)
        group.has_rewards = known
        group.rewards.append(self._number(row, "reward", line) if known else 0.0)

    def _code(self, row: _Row, line: int) -> int:
        code = self._codes.setdefault(row["action"], len(self._codes))
        if code >= MAX_NAMES:
            raise FormatError(self._path, f"line {line}", f"more than {MAX_NAMES:,} actions")
        if row["action"] not in self._names and row.get("action_name"):
            self._names[row["action"]] = row["action_name"]
        return code

    def _made_schema(self) -> Schema:
        """Return a schema of what the columns and the actions tell."""
        actions = tuple(self._codes)
        if all(map(str.isdecimal, actions)):
            large = [a for a in actions if not _INDEX.fullmatch(a) or int(a) >= MAX_NAMES]
            if large:
                reason = f"must be an index below {MAX_NAMES:,}, got {large[0]}"
                raise FormatError(self._path, "action", reason)
            highest = max(map(int, actions), default=0)
            unnamed = numbered_actions(highest + 1)
            names = {int(text): name for text, name in self._names.items()}
            actions = tuple(names.get(k, name) for k, name in enumerate(unnamed))
        try:
            return Schema(tuple(map(Feature.from_label, self._features)), actions)
        except InvalidArgumentError as error:
            raise FormatError(self._path, "", str(error)) from None

    def _episode(self, group: "_EpisodeRows") -> Episode:
        row, line = group.last_row, group.last_line
        dropped = bool(row["action"])  # what the last action led to is not in the table
        extras = {DROPPED: self._index(group.actions[-1])} if dropped else {}
        count = len(group.actions) - dropped
        terminated, truncated = group.ends[0] if dropped else group.ends[1]
        actions = np.array([self._index(code) for code in group.actions[:count]], dtype=np.int64)
        try:
            return Episode(
                np.array(group.observations).reshape(-1, len(self._features)),
                actions,
                np.array(group.rewards)[:count],
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
        if _INDEX.fullmatch(text) and int(text) < len(names):
            return int(text)
        if text in names:
            return names.index(text)
        reason = f"must be one of {', '.join(names)} or its index, got {text!r}"
        raise FormatError(self._path, "action", reason)

    def _number(self, row: _Row, column: str, line: int) -> float:
        text = row[column]
        try:
            number = float(text)
        except ValueError:
            number = np.nan
        if not np.isfinite(number) or "_" in text:
            hint = ", with a decimal point" if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text) else ""
            reason = f"{column} must be a finite number{hint}, got {text!r}"
            raise FormatError(self._path, f"line {line}", reason)
        return number

    def _truth(self, row: _Row, column: str, line: int) -> bool | None:
        text = row.get(column, "").lower()
        if text not in _TRUTH:
            reason = f"{column} must be true or false, got {text!r}"
            raise FormatError(self._path, f"line {line}", reason)
        return _TRUTH[text]

    def _seed(self, row: _Row, line: int) -> int | None:
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
        self.last_row: _Row = {}


def _checked_columns(columns: Mapping[str, str]) -> dict[str, str]:
    for name in columns:
        check_choice("columns", name, KNOWN)
    return dict(columns)


def _checked_delimiter(delimiter: str) -> str:
    if len(delimiter) != 1 or delimiter in '"\r\n':
        raise InvalidArgumentError(
            f"delimiter must be one character, no quote and no end of line, got {delimiter!r}"
        )
    return delimiter
