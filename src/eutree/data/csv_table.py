"""The table of a file: its columns under the names that we know them by, and its rows."""

import csv
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from eutree.data.log_format import LogFormat, Row
from eutree.data.rows import MAX_NAMES
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import opened_text
from eutree.validation import check_choice

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
        columns: The table's own names of known columns: ``{"episode": "day"}``.
        delimiter: The character between two values; None for the one that the first line shows.
        log: How a machine's log is to be read as episodes.

    Attributes:
        features: The columns that are features, once the rows are read.
        delimiter: The character between two values, once the rows are read.

    Raises:
        InvalidArgumentError: ``columns`` names an unknown column, or ``delimiter`` is none.
    """

    def __init__(
        self,
        path: str | Path,
        columns: Mapping[str, str],
        delimiter: str | None,
        log: LogFormat,
    ) -> None:
        self._path = path
        self._log = log
        self._own_names = _checked_columns(columns)
        self.delimiter = _checked_delimiter(delimiter)
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
                    self.delimiter = _delimiter_of(text.readline())
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


def _checked_columns(columns: Mapping[str, str]) -> dict[str, str]:
    for name in columns:
        check_choice("columns", name, KNOWN)
    return dict(columns)


def _checked_delimiter(delimiter: str | None) -> str | None:
    if delimiter is not None and (len(delimiter) != 1 or delimiter in '"\r\n'):
        raise InvalidArgumentError(
            f"delimiter must be one character, no quote and no end of line, got {delimiter!r}"
        )
    return delimiter


def _delimiter_of(header: str) -> str:
    """Return the mark that divides the first line into most parts; a comma where none does."""
    return max(_DELIMITERS, key=header.count)
