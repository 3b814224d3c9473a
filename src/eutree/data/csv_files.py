"""Demonstrations as CSV: one row for each observation, floats written so that they read back.

The columns ``episode`` and ``action`` are required, ``step``, ``action_name``, ``reward``,
``terminated``, ``truncated``, ``seed``, ``ending``, ``is_success``, ``kept`` and ``allowed`` are
known; every other column is a feature, its unit in brackets: ``position [m]``. The last row of an
episode has no action: it shows where the last action led. In a log without such rows the last
action of each episode is dropped, because its successor is not known; the episode's extras keep it,
under ``dropped_action``. Of an episode's seed, ending, success and whether it is kept the last row
that says something counts. Actions are indices, names, or quantities; so are those that are
``allowed``, several divided by blanks, or by ``|`` where names have blanks; an empty cell allows
all. An episode has a reward for each action, or none at all.
"""

import csv
import io
import math
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.data.episode import ALLOWED, DROPPED, MAX_NAMES, Episode
from eutree.data.log_format import (
    HOLD,
    INDEX,
    KNOWN,
    LEAVE_OUT,
    MASKED,
    LogFormat,
    NominalColumn,
    action_of,
    are_named,
    are_quantities,
    column_of,
    hint,
    is_nothing,
    is_quantity,
    label,
    order_of,
    truth,
)
from eutree.errors import FormatError, InvalidArgumentError, blamed
from eutree.files import opened_text, write_text
from eutree.schema import Feature, Schema, numbered_actions
from eutree.validation import check_choice, check_finite

MAX_CSV = 512 * 2**20
MAX_NUMBERS = 24 * 2**20  # of all rows: features, action and reward
MAX_EPISODES = 100_000
MAX_CATEGORIES = 100  # of one column: each is a feature

_DELIMITERS = ",;\t|"
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+(?:[eE][-+]?\d+)?\s*")
_FLOAT_INDEX = re.compile(r"[0-9]{1,5}\.0")  # as pandas writes it in a column with empty cells
_QUOTED = re.compile(r'"[^"]*(?:"|$)')
_SEED = re.compile(r"[0-9]{1,99}")
_FACTS = ("seed", "ending", "is_success", "kept")  # of an episode, whichever of its rows says so


def read_csv(
    path: str | Path,
    schema: Schema | None,
    *,
    columns: Mapping[str, str] | None = None,
    delimiter: str | None = None,
    log: LogFormat | None = None,
) -> tuple[tuple[Episode, ...], Schema, int, int]:
    """Return the episodes of a table, in the order in which they begin, and their schema.

    Beside them the number of rows that were filled where cells were empty, and of those left out.
    The arguments are those of ``Demonstrations.from_csv``.

    Raises:
        InvalidArgumentError: ``columns`` names an unknown column, or ``delimiter`` is none.
        FormatError: A column is missing, or a value is not of its column's kind; names the line.
        FileError: The file is missing or cannot be read.
    """
    columns, log = columns or {}, log or LogFormat()
    for name in columns:
        check_choice("columns", name, MASKED)
    if delimiter is not None and (len(delimiter) != 1 or delimiter in '"\r\n'):
        raise InvalidArgumentError(
            f"delimiter must be one character, no quote and no end of line, got {delimiter!r}"
        )
    with opened_text(path, limit=MAX_CSV) as text:
        reader: Any = None
        try:
            if delimiter is None:  # the mark that divides the first line into most parts
                delimiter = max(_DELIMITERS, key=_QUOTED.sub("", text.readline()).count)
                text.seek(0)
            reader = csv.reader(text, strict=True, delimiter=delimiter)
            with blamed(path, "line 1"):
                table = _Table(log.columns_of(next(reader, []), columns), delimiter, log, path)
            for values in reader:
                if values:  # else it is an empty line
                    table.add(values, reader.line_num)
        except InvalidArgumentError as error:
            raise FormatError(path, f"line {table.line}", str(error)) from None
        except csv.Error as error:
            raise FormatError(path, f"line {reader.line_num}", str(error)) from None
    return *table.read(schema), table.filled, table.left_out


@dataclass(slots=True)
class _EpisodeRows:
    """The rows of one episode so far, as numbers and not as text."""

    observations: "array[float]" = field(default_factory=lambda: array("d"))
    actions: "array[int]" = field(default_factory=lambda: array("q"))
    rewards: "array[float]" = field(default_factory=lambda: array("d"))
    has_rewards: bool = True
    masks: "array[int]" = field(default_factory=lambda: array("q"))  # number of each row's mask
    # Terminated and truncated after the last action but one, and after the last.
    ends: tuple[tuple[bool, bool], tuple[bool, bool]] = ((False, False), (False, False))
    last_line: int = 0
    last_step: float = math.nan  # its number in the column step; NaN where it has none
    was_filled: bool = False  # whether the last row had empty cells
    last_row: dict[str, str] = field(default_factory=dict)
    facts: dict[str, str] = field(default_factory=dict)  # the last that a row says of the episode


class _Table:
    """A table while it is read, row by row.

    A fault of a row is an InvalidArgumentError; ``line`` is its place.
    """

    def __init__(
        self, columns: list[str], delimiter: str, log: LogFormat, path: str | Path
    ) -> None:
        apart = {*MASKED, log.time, ""}  # without a name: numbers of rows, and what was dropped
        self._columns, self._delimiter, self._log, self._path = columns, delimiter, log, path
        self._features = [column for column in columns if column not in apart]
        if not self._features:
            raise InvalidArgumentError(f"there is no column of a feature in {columns}")
        if len(self._features) > MAX_NAMES:
            raise InvalidArgumentError(f"more than {MAX_NAMES:,} columns of features")
        self._codes: dict[str, int] = {}  # of the texts in the column action
        self._names: dict[str, str] = {}  # their names by action_name
        self._masks: dict[tuple[int, ...], int] = {}  # numbers of the sets of codes in allowed
        self._taken: dict[tuple[int, int], tuple[int, str, str]] = {}  # under each mask; and where
        self._categories: dict[str, dict[str, int]] = {name: {} for name in log.nominal}
        self._numbers = [column for column in self._features if column not in log.nominal]
        self._groups: list[_EpisodeRows] = []
        self._present: dict[str, _EpisodeRows] = {}  # of each episode that may go on
        self._parted: set[str] = set()  # episodes in parts, or without their first row
        self._held: dict[str, dict[str, str]] = {}  # the last text of each column of its rows
        self._times: dict[str, float] = {}  # of its last row
        self._order: slice | list[int] = slice(None)  # of the features, as a schema has them
        self._chosen: dict[str, NominalColumn] = {}  # what is made of each nominal column
        self._size = self.filled = self.left_out = 0
        self.line = 1

    def add(self, values: list[str], line: int) -> None:
        """Add a row, unless it is to be left out."""
        self.line = line
        if len(values) != len(self._columns):
            raise InvalidArgumentError(f"expected {len(self._columns)} values, got {len(values)}")
        row = dict(zip(self._columns, values, strict=True))
        row["action"] = self._action_text(row["action"])
        name = row.get("episode", "")
        if self._log.time:
            self._pass_time(name, row[self._log.time])
        is_filled = self._fill(name, row) if self._log.missing else False
        if is_filled is None:
            self.left_out += 1
            return
        self.filled += is_filled
        group = self._present.get(name)
        if group is None:
            group = self._present[name] = _EpisodeRows()
            self._groups.append(group)
        self._size += len(self._features) + 2 + (ALLOWED in row) * len(self._codes)
        if len(self._groups) > MAX_EPISODES:
            raise InvalidArgumentError(f"more than {MAX_EPISODES:,} episodes")
        if self._size > MAX_NUMBERS:
            raise InvalidArgumentError(f"more than {MAX_NUMBERS:,} numbers")
        self._add(group, row)
        group.was_filled = is_filled

    def _pass_time(self, name: str, text: str) -> None:
        """Go on to the time of a row; a long pause ends the episode."""
        now = self._log.seconds(text)
        step = now - self._times.get(name, now)
        if step < 0:
            other = f" of episode {name}" if name else ", or name the column of the episodes"
            raise InvalidArgumentError(
                f"{self._log.time} goes back, to {text!r}: sort the rows{other}"
            )
        if self._log.episode_gap is not None and step > self._log.episode_gap:
            self._cut(name)
            self._held.pop(name, None)
        self._times[name] = now

    def _cut(self, name: str) -> None:
        """Part an episode: the first alone has its seed, the last how it ended."""
        group = self._present.pop(name, _EpisodeRows())
        if name:
            self._parted.add(name)
            group.facts |= {"ending": "", "is_success": ""}

    def _fill(self, name: str, row: dict[str, str]) -> bool | None:
        """Fill the empty cells of a row; return whether it has any, None to leave it out."""
        empty = [column for column in self._numbers if is_nothing(row[column])]
        empty += [column for column in self._log.nominal if not row[column].strip()]
        if empty and self._log.missing == LEAVE_OUT:
            self._cut(name)
            return None
        held = dict.fromkeys(empty, self._log.missing)
        if self._log.missing == HOLD:
            held = self._held.setdefault(name, {})
            known = {*self._features, "action"}.difference(empty)
            held |= {column: row[column] for column in known if row[column]}
            if name not in self._present and not row["action"]:
                empty.append("action")
        if not held.keys() >= {*empty}:
            return None  # there is nothing yet to hold
        row |= {column: held[column] for column in empty}
        return bool(empty)

    def _add(self, group: _EpisodeRows, row: dict[str, str]) -> None:
        before = group.last_row
        if group.observations and not before["action"]:
            if self._log.missing != HOLD:
                self.line = group.last_line
                raise InvalidArgumentError(
                    "only an episode's last row may have no action; by --missing hold the one "
                    "before it goes on"
                )
            before["action"] = list(self._codes)[group.actions[-1]]
            self.filled += not group.was_filled
            self._act(group, before)
        text = row.get("step", "")
        step = float(text) if is_quantity(text) else math.nan
        if step <= group.last_step:
            raise InvalidArgumentError(
                f"step must grow within an episode, got {row['step']} after {before['step']}: sort "
                "the rows, or name a column that tells the episodes apart"
            )
        group.observations.extend([self._value(row, name) for name in self._features])
        group.last_line, group.last_row, group.last_step = self.line, row, step
        facts = _FACTS[1:] if row.get("episode") in self._parted else _FACTS  # no seed
        group.facts |= {name: row[name] for name in facts if row.get(name)}
        if row["action"]:
            self._act(group, row)
        ends = truth(row, "terminated") is True, truth(row, "truncated") is True
        if row["action"] or not group.actions:
            group.ends = (group.ends[-1], ends)
        else:  # behind the last action: the episode ended there, whichever row says so
            last = group.ends[-1]
            group.ends = (group.ends[0], (last[0] or ends[0], last[1] or ends[1]))

    def _act(self, group: _EpisodeRows, row: dict[str, str]) -> None:
        """Add the action of a row, what it earned, and what else was allowed."""
        if any(group.ends[-1]):
            raise InvalidArgumentError("the episode ended on an earlier line")
        group.actions.append(self._code(row["action"]))
        name = row.get("action_name")
        if name and name != (meant := self._names.setdefault(row["action"], name)):
            raise InvalidArgumentError(f"{row['action']} must mean {meant!r}, got {name!r}")
        if ALLOWED in row:
            group.masks.append(self._mask(row["action"], row[ALLOWED].strip()))
        known = bool(row.get("reward"))
        if group.rewards and known != group.has_rewards:
            raise InvalidArgumentError(
                "reward must be there for every action of an episode, or for none"
            )
        group.has_rewards = known
        group.rewards.append(self._number(row, "reward") if known else 0.0)

    def _action_text(self, text: str) -> str:
        """Return a cell of the actions: a number with its point, nothing where it says so."""
        text = text.strip()
        if text in self._codes or text in self._log.actions:
            return text
        if text and is_nothing(text) and self._has_quantities:
            return ""
        return self._with_point(text)

    def _with_point(self, text: str) -> str:
        is_decimal = self._delimiter != "," and _DECIMAL_COMMA.fullmatch(text)
        return text.replace(",", ".") if is_decimal else text

    @cached_property
    def _has_quantities(self) -> bool:
        """Whether all actions of the table that say something are numbers: no row tells alone."""
        at = self._columns.index("action")
        with opened_text(self._path, limit=MAX_CSV) as text:
            rows = csv.reader(text, delimiter=self._delimiter)
            next(rows)
            cells = (self._with_point(row[at].strip()) for row in rows if len(row) > at)
            return all(is_nothing(cell) or is_quantity(cell) for cell in cells)

    def _code(self, text: str) -> int:
        code = self._codes.setdefault(text, len(self._codes))
        if code >= MAX_NAMES:
            raise InvalidArgumentError(f"more than {MAX_NAMES:,} actions")
        return code

    def _mask(self, action: str, cell: str) -> int:
        """Return the number of the set of actions that a cell allows."""
        is_one = cell in self._codes or "|" in cell  # a name, or names, perhaps with blanks
        texts = cell.split("|") if is_one else cell.split()
        codes = {self._code(text) for text in map(self._action_text, texts) if text}
        mask = self._masks.setdefault(tuple(sorted(codes)), len(self._masks))
        self._taken.setdefault((mask, self._codes[action]), (self.line, action, cell))
        return mask

    def _value(self, row: dict[str, str], column: str) -> float:
        """Return the number in a cell, that of its category where it is text."""
        if column not in self._categories:
            return self._number(row, column)
        codes, text = self._categories[column], row[column].strip()
        if not text:
            raise InvalidArgumentError(f"{column} must be a category, got ''{hint('', column)}")
        code = codes.setdefault(text, len(codes))
        if code >= MAX_CATEGORIES:
            raise InvalidArgumentError(
                f"{column} has more than {MAX_CATEGORIES} categories; leave it out by --drop"
            )
        return float(code)

    def _number(self, row: dict[str, str], column: str) -> float:
        text = self._with_point(row[column])
        try:
            number = float(text)
        except ValueError:
            number = None
        if number is not None and math.isfinite(number) and "_" not in text:
            return number
        comma = _DECIMAL_COMMA.fullmatch(text)
        more = ", with a decimal point" if comma else ""
        known = comma or (number is not None and not is_nothing(text))
        helps = "" if known else hint(text, column)
        raise InvalidArgumentError(f"{column} must be a finite number{more}, got {text!r}{helps}")

    def read(self, schema: Schema | None) -> tuple[tuple[Episode, ...], Schema]:
        """Return the episodes and their schema, which is made of the table if it is not given."""
        path, texts = self._path, self._texts(schema)
        with blamed(path):
            for column, known in self._categories.items():
                self._chosen[column] = NominalColumn.of(column, tuple(known), schema)
        if schema is None:
            with blamed(path, "action"):
                actions = self._made_actions(texts)
            with blamed(path):
                schema = Schema(tuple(self._made_features()), actions)
        else:
            with blamed(path, "line 1"):
                self._order = order_of(tuple(self._made_features()), schema)
        by_name = bool(self._log.actions) or are_named({*texts}, self._names, schema.actions)
        asked, wanted = self._log.actions, ", ".join(schema.actions)
        with blamed(path, "action"):
            if asked and {*asked} != {*schema.actions}:
                raise InvalidArgumentError(f"--actions must be {wanted}, in the log's order")
            numbers = [action_of(_named(text, asked), schema, by_name) for text in texts]
            for text, name in self._names.items():
                meant = schema.actions[numbers[texts.index(text)]]
                if name in schema.actions and name != meant:
                    raise InvalidArgumentError(f"{text} must mean {meant!r}, got {name!r}")
        numbers_of_codes = np.array(numbers, dtype=np.int64)
        masks = np.zeros((len(self._masks), schema.n_actions), dtype=np.bool_)
        for mask, codes in zip(masks, self._masks, strict=True):
            mask[numbers_of_codes[list(codes)] if codes else slice(None)] = True
        for (number, code), (line, action, cell) in self._taken.items():
            if not masks[number, numbers[code]]:
                said = f"{ALLOWED} must have the action taken, {action!r}: {cell!r}"
                raise FormatError(path, f"line {line}", said)
        episodes = []
        for group in self._groups:
            with blamed(path, f"line {group.last_line}"):
                episodes.append(self._episode(group, numbers_of_codes, masks))
        return tuple(episodes), schema

    def _texts(self, schema: Schema | None) -> list[str]:
        """Return the texts of the actions by their codes; of 1.0 that is an index only 1.

        It is one where it has a name, or stands under masks of 0, 1 and 2, and sets no levels.
        """
        known = {*self._log.actions}
        if schema is not None:
            known = {*schema.actions, *(str(n) for one in schema.controls for n in one.levels)}
        floats = set(filter(_FLOAT_INDEX.fullmatch, self._codes))
        others = self._codes.keys() - floats
        may_be = self._masks if others else known or self._names
        if not may_be or known >= floats or not all(map(INDEX.fullmatch, others)):
            return list(self._codes)
        short = {text: text[:-2] for text in floats}
        self._names = {short.get(text, text): name for text, name in self._names.items()}
        return [short.get(text, text) for text in self._codes]

    def _made_features(self) -> Iterator[Feature]:
        """Yield the features of all columns; a nominal one makes several, or a code."""
        for column in self._features:
            if column in self._chosen:
                yield from self._chosen[column].features
            else:
                yield Feature.from_label(label(column))

    def _made_actions(self, texts: Sequence[str]) -> tuple[str, ...]:
        """Return the names of the actions, as far as the table tells them."""
        if self._log.actions:
            return self._log.actions
        if are_quantities({*texts}, self._names):
            return tuple({float(text): text for text in sorted(texts, key=float)}.values())
        if all(map(str.isdecimal, texts)):
            large = [text for text in texts if not INDEX.fullmatch(text) or int(text) >= MAX_NAMES]
            if large:
                raise InvalidArgumentError(f"must be an index below {MAX_NAMES:,}, got {large[0]}")
            unnamed = numbered_actions(max(map(int, texts), default=0) + 1)
            names = {int(text): name for text, name in self._names.items()}
            return tuple(names.get(k, name) for k, name in enumerate(unnamed))
        return tuple(self._names.get(text, text) for text in texts)

    def _observations(self, group: _EpisodeRows) -> Floats:
        """Return the observations of an episode, categories as features of their own, [T, d]."""
        values = np.frombuffer(group.observations).reshape(-1, len(self._features))
        columns: list[Floats] = []
        for column, numbers in zip(self._features, values.T, strict=True):
            choice = self._chosen.get(column)
            columns.append(numbers[:, None] if choice is None else choice.of_codes(numbers))
        return np.hstack(columns)[:, self._order]

    def _episode(self, group: _EpisodeRows, numbers_of_codes: Integers, masks: Booleans) -> Episode:
        actions = numbers_of_codes[np.frombuffer(group.actions, dtype=np.int64)]
        dropped = bool(group.last_row["action"])  # where the last action led is not in the table
        observations = self._observations(group)
        if dropped and self._log.ends_in_place and group.ends[1][0]:
            observations, dropped = np.concatenate([observations, observations[-1:]]), False
        count = len(actions) - dropped
        terminated, truncated = group.ends[0] if dropped else group.ends[1]
        allowed = masks[np.frombuffer(group.masks, dtype=np.int64)[:count]]
        seed = group.facts.get("seed", "")
        if seed and not _SEED.fullmatch(seed):
            raise InvalidArgumentError(f"seed must be an integer >= 0, got {seed!r}")
        return Episode(
            observations,
            actions[:count],
            np.frombuffer(group.rewards)[:count],
            terminated=terminated,
            truncated=truncated,
            seed=int(seed) if seed else None,
            ending=group.facts.get("ending", ""),
            is_success=truth(group.facts, "is_success"),
            kept=truth(group.facts, "kept") is not False,
            has_rewards=group.has_rewards,
            steps={} if allowed.all() else {ALLOWED: allowed},
            extras={DROPPED: int(actions[-1])} if dropped else {},
        )


def _named(text: str, names: Sequence[str]) -> str:
    """Return the name of an action that the log has as its number among them."""
    is_number = text not in names and INDEX.fullmatch(text) and int(text) < len(names)
    return names[int(text)] if is_number else text


def write_csv(path: str | Path, episodes: Sequence[Episode], schema: Schema) -> None:
    """Write all episodes, discarded ones included.

    Raises:
        InvalidArgumentError: A feature has the name of a known column, or a value is not finite.
        FileError: The file cannot be written.
    """
    features = list(map(column_of, schema.features))
    if set(features) & set(MASKED) or len(set(features)) < len(features):
        raise InvalidArgumentError(f"features must not be named like columns, got {features}")
    buffer = io.StringIO()
    writer = csv.writer(buffer)
    masked = any(episode.allowed is not None for episode in episodes)
    writer.writerow([*(MASKED if masked else KNOWN), *features])
    for number, episode in enumerate(episodes):
        check_finite(f"episode {number}: observations", episode.observations)
        check_finite(f"episode {number}: rewards", episode.rewards)
        writer.writerows(_lines(number, episode, schema, masked))
    write_text(path, buffer.getvalue())


def _lines(number: int, episode: Episode, schema: Schema, masked: bool) -> Iterator[list[str]]:
    success = "" if episode.is_success is None else str(episode.is_success).lower()
    seed = "" if episode.seed is None else str(episode.seed)
    tail = [seed, episode.ending, success, str(episode.kept).lower()]
    masks = () if episode.allowed is None else episode.allowed
    allowed = [" ".join(map(str, np.flatnonzero(mask))) for mask in masks]
    for step, observation in enumerate(episode.observations.tolist()):
        last = step >= len(episode) - 1
        ends = [str(end and last).lower() for end in (episode.terminated, episode.truncated)]
        middle = ["", "", ""]
        if step < len(episode):
            action = int(episode.actions[step])
            reward = repr(float(episode.rewards[step])) if episode.has_rewards else ""
            middle = [str(action), schema.actions[action], reward]
        may = [allowed[step] if step < len(allowed) else ""] if masked else []
        yield [str(number), str(step), *middle, *ends, *tail, *may, *map(repr, observation)]
