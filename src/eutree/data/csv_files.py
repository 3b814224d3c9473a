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
from collections.abc import Mapping, Sequence
from pathlib import Path

from eutree.data.csv_reader import KNOWN, CsvReader
from eutree.data.episode import Episode
from eutree.data.log_format import LogFormat
from eutree.errors import InvalidArgumentError
from eutree.files import write_text
from eutree.schema import Schema
from eutree.validation import check_finite


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


def read_csv(
    path: str | Path,
    schema: Schema | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    delimiter: str | None = None,
    log: LogFormat | None = None,
) -> tuple[tuple[Episode, ...], Schema]:
    """Read episodes, and the schema that the columns tell unless one is given.

    Args:
        path: The file.
        schema: Names and units, if known.
        columns: The table's own names of known columns: ``{"episode": "day"}``.
        delimiter: The character between two values; None for the one that the first line shows.
        log: How a machine's log is to be read as episodes.

    Raises:
        InvalidArgumentError: ``columns`` names an unknown column, or ``delimiter`` is none.
        FormatError: A column is missing, or a value is not what it must be; says which line.
        FileError: The file is missing or cannot be read.
    """
    reader = CsvReader(path, schema, columns=columns, delimiter=delimiter, log=log)
    return reader.episodes, reader.schema


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
