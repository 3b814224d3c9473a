"""Tables as machines write them: their columns, times, text, empty cells, unmarked episodes."""

import csv
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from eutree.data.episode import MAX_NAMES
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import opened_text
from eutree.validation import check_choice, check_number

HOLD, LEAVE_OUT = "hold", "drop"
MAX_CATEGORIES = 100  # of one column: each is a feature
_SECONDS = {"s": 1, "min": 60, "h": 3600, "d": 86400}
_SPAN = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h|d)?")
TIMES = tuple(  # of a time that cannot be read, for a message
    f"{day} {hour}"
    for day in ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%Y/%m/%d", "%d.%m.%y")
    for hour in ("%H:%M", "%H:%M:%S", "%I:%M %p")
)
_UNIT = re.compile(r"(?P<name>.*\S)\s+\((?P<unit>[^()]*)\)")

Row = dict[str, str]


@dataclass(frozen=True, kw_only=True)
class LogFormat:
    """How a machine's log is to be read as episodes.

    Attributes:
        drop: Columns that are no features.
        nominal: Columns of text, a choice of categories: each category becomes a feature that is 1
            where it is chosen, ``"mode is auto"``, of a one-hot group; of two categories one
            feature is enough, 1 at the later one by the alphabet.
        missing: What an empty cell means: ``"hold"``, the value before it in the episode; a number;
            ``"drop"``, the row is left out, and the episode ends before it, since what its last
            action led to is not known. Refused if "".
        time: Column of the time, which is no feature: seconds, or ISO 8601.
        time_format: Its form as ``datetime.strptime`` has it, where it is another.
        episode_gap: Seconds between two rows after which a new episode begins.
        actions: Names of the actions in the order of their indices, where the order matters.
    """

    drop: tuple[str, ...] = ()
    nominal: tuple[str, ...] = ()
    missing: str = ""
    time: str = ""
    time_format: str = ""
    episode_gap: float | None = None
    actions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.missing not in ("", HOLD, LEAVE_OUT) and not _is_number(self.missing):
            raise InvalidArgumentError(
                f"missing must be {HOLD}, {LEAVE_OUT} or a number, got {self.missing!r}"
            )
        if self.episode_gap is not None:
            check_number("episode_gap", self.episode_gap, low=0.0, low_open=True)
        if (self.episode_gap is not None or self.time_format) and not self.time:
            raise InvalidArgumentError("time must name the column that a gap is seen in, got ''")


def seconds_of(text: str) -> float:
    """Return how long a span is: ``90``, ``90s``, ``15min``, ``1h``, ``2d``.

    >>> seconds_of("1.5h")
    5400.0
    """
    match = _SPAN.fullmatch(text.strip())
    if match is None:
        raise InvalidArgumentError(
            f"--episode-gap must be a span as 90s, 15min, 1h or 2d, got {text!r}"
        )
    return float(match[1]) * _SECONDS[match[2] or "s"]


def label(column: str) -> str:
    """Return a column's name with its unit in brackets, as a schema has it.

    >>> label("level (m)")
    'level [m]'
    """
    match = _UNIT.fullmatch(column)
    return f"{match['name']} [{match['unit']}]" if match else column


def is_nothing(text: str) -> bool:
    """Return whether a cell of numbers is empty, or says that there was no value."""
    return text.strip().lower() in _NOTHING


def hint(text: str, column: str) -> str:
    """Return what may be done about a cell that is no number, to follow "got ...'"."""
    if is_nothing(text):
        return f"; an empty cell is filled by --missing {HOLD} or a number, or its row left out"
    if _is_date(text):
        return f"; name the time by --time {column!r}"
    return f"; text is a choice of categories by --nominal {column!r}, or left out by --drop"


_NOTHING = ("", "nan", "na", "n/a", "null")
MAX_CSV = 512 * 2**20

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
_DELIMITERS = ",;\t|"


class CsvTable:
    """The columns and rows of a file.

    Args:
        path: The file.
        columns: The table's own names of known columns, as ``Demonstrations.from_csv`` has them.
        delimiter: The character between two values; None for the one that the first line shows.
        log: How it is to be read as episodes.

    Attributes:
        features: The columns that are features, once the rows are read.
        delimiter: The character between two values, once the rows are read.

    Raises:
        InvalidArgumentError: ``columns`` names an unknown column, or ``delimiter`` is none.
    """

    def __init__(
        self, path: str | Path, columns: Mapping[str, str], delimiter: str | None, log: LogFormat
    ) -> None:
        self._path = path
        self._log = log
        for name in columns:
            check_choice("columns", name, KNOWN)
        if delimiter is not None and (len(delimiter) != 1 or delimiter in '"\r\n'):
            raise InvalidArgumentError(
                f"delimiter must be one character, no quote and no end of line, got {delimiter!r}"
            )
        self._own_names = columns
        self.delimiter = delimiter
        self.features: list[str] = []

    def rows(self) -> Iterator[tuple[int, Row]]:
        """Yield each row with the number of its line.

        Raises:
            FormatError: A column is missing, or a row has not as many values; says which line.
            FileError: The file is missing or cannot be read.
        """
        with opened_text(self._path, limit=MAX_CSV) as text:
            reader: Any = None
            try:
                if self.delimiter is None:
                    # The mark that divides the first line into most parts.
                    self.delimiter = max(_DELIMITERS, key=text.readline().count)
                    text.seek(0)
                reader = csv.reader(text, strict=True, delimiter=self.delimiter)
                yield from self._read(reader)
            except csv.Error as error:
                raise FormatError(self._path, f"line {reader.line_num}", str(error)) from None
            except UnicodeDecodeError:
                reason = "not UTF-8 text"
                raise FormatError(
                    self._path, f"after line {reader.line_num if reader else 0}", reason
                ) from None

    def _read(self, reader: Any) -> Iterator[tuple[int, Row]]:
        columns = self._renamed(next(reader, []))
        apart = {*KNOWN, *self._log.drop, self._log.time}
        self.features = [column for column in columns if column not in apart]
        self._check_features(columns)
        for values in reader:
            if not values:
                continue  # an empty line
            if len(values) != len(columns):
                reason = f"expected {len(columns)} values, got {len(values)}"
                raise FormatError(self._path, f"line {reader.line_num}", reason)
            yield reader.line_num, dict(zip(columns, values, strict=True))

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
            if name not in columns and not (name == "episode" and self._log.time):
                reason = (
                    f"there is no column {name!r} in {found}; required are 'episode' and 'action', "
                    "or columns named by --episode-column and --action-column "
                    "(in Python columns={'episode': ..., 'action': ...})"
                )
                if name == "episode":
                    reason += (
                        "; where nothing marks the episodes, --time COLUMN, with --episode-gap 1h "
                        "for those that a pause divides"
                    )
                if len(found) == 1:
                    reason += "; and what separates the values by --delimiter"
                raise FormatError(self._path, "line 1", reason)
        if len(set(columns)) < len(columns):
            twice = sorted({name for name in columns if columns.count(name) > 1})
            reason = f"two columns have the same name: {', '.join(map(repr, twice))}"
            raise FormatError(self._path, "line 1", reason)

    def _check_features(self, columns: Iterable[str]) -> None:
        named = (*self._log.drop, *self._log.nominal, *filter(None, [self._log.time]))
        for name in named:
            if name not in columns:
                reason = f"there is no column {name!r} in {list(columns)}"
                raise FormatError(self._path, "line 1", reason)
        if not 1 <= len(self.features) <= MAX_NAMES:
            raise FormatError(self._path, "line 1", "there is no column of a feature, or too many")


class LogRows:
    """The rows of a log: which episode each belongs to, and its empty cells filled.

    Args:
        path: The file, for messages.
        log: How to read it.
        table: Whose columns they have.
    """

    def __init__(self, path: str | Path, log: LogFormat, table: CsvTable) -> None:
        self._path = path
        self._log = log
        self._table = table
        self._episodes: dict[str, _Progress] = {}

    def episode_of(self, line: int, row: Row) -> tuple[str, int] | None:
        """Return the episode of a row and fill its empty cells; None where it is left out.

        Raises:
            FormatError: Time goes back, or is none.
        """
        name = row.get("episode", "")
        progress = self._episodes.setdefault(name, _Progress())
        if self._log.time:
            self._advance(progress, line, row)
        if self._log.missing and not self._fill(progress, row):
            return None
        progress.before = row
        return name, progress.part

    def _advance(self, progress: "_Progress", line: int, row: Row) -> None:
        now = self._seconds(row[self._log.time], line)
        if progress.time is not None:
            step = now - progress.time
            if step < 0:
                reason = (
                    f"{self._log.time} goes back, to {row[self._log.time]!r}: sort the rows, or "
                    "name the column of the episodes"
                )
                raise FormatError(self._path, f"line {line}", reason)
            if self._log.episode_gap is not None and step > self._log.episode_gap:
                progress.break_off()
        progress.time = now

    def _fill(self, progress: "_Progress", row: Row) -> bool:
        """Fill the empty cells of a row; return False where it is to be left out."""
        numbers = [column for column in self._table.features if column not in self._log.nominal]
        texts = [*self._log.nominal, *(("action",) if self._log.missing == HOLD else ())]
        empty = [column for column in numbers if is_nothing(row[column])]
        empty += [column for column in texts if not row[column].strip()]
        if not empty:
            return True
        if self._log.missing == LEAVE_OUT:
            progress.break_off()
            return False
        if self._log.missing == HOLD and progress.before is None:
            return False  # there is nothing yet to hold
        for column in empty:
            held = progress.before if self._log.missing == HOLD else None
            row[column] = self._log.missing if held is None else held[column]
        return True

    def _seconds(self, text: str, line: int) -> float:
        try:
            if self._log.time_format:
                return datetime.strptime(text.strip(), self._log.time_format).timestamp()
            if _is_number(text):
                return float(text)
            return datetime.fromisoformat(text.strip()).timestamp()
        except (ValueError, OverflowError, OSError):
            wanted = self._log.time_format or "seconds, or as 2026-03-01 14:05:00"
            fits = next((form for form in TIMES if _has_form(text, form)), TIMES[0])
            reason = (
                f"{self._log.time} must be a time, {wanted}, got {text!r}"
                f"; another form is told by --time-format '{fits}'"
            )
            raise FormatError(self._path, f"line {line}", reason) from None


class _Progress:
    """Where the reading of an episode stands."""

    __slots__ = ("before", "part", "time")

    def __init__(self) -> None:
        self.before: Row | None = None
        self.part = 0
        self.time: float | None = None

    def break_off(self) -> None:
        """Let the next row begin a new episode."""
        self.part += 1
        self.before = None


def _has_form(text: str, form: str) -> bool:
    try:
        datetime.strptime(text.strip(), form)
    except ValueError:
        return False
    return True


def _is_number(text: str) -> bool:
    try:
        return abs(float(text)) < float("inf") and "_" not in text
    except ValueError:
        return False


def _is_date(text: str) -> bool:
    try:
        return datetime.fromisoformat(text.strip()) is not None
    except ValueError:
        return bool(re.match(r"\s*\d{1,4}[-./]\d{1,2}[-./]\d{1,4}", text))
