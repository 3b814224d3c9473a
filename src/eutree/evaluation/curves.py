"""Learning curves: frozen evaluations along a run, as text and as data frames.

The text form is CSV with a header line; floats are written so that they read back to the same
bits, an absent success rate as an empty field.
"""

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any

import msgspec
import numpy as np

from eutree.display import counted, fixed
from eutree.errors import FormatError, blamed
from eutree.validation import data_frame


@dataclass(frozen=True)
class CurvePoint:
    """One frozen evaluation along a learning run.

    Attributes:
        episode: Episodes of experience before it.
        steps: Environment steps of experience before it.
        success_rate: Share of successful episodes; None where the environment reports none.
        mean_return: Mean undiscounted return.
        n_leaves: Leaves of the frozen policy.
    """

    episode: int
    steps: int
    success_rate: float | None
    mean_return: float
    n_leaves: int

    def describe(self) -> str:
        """Return the point in a few words, for a progress line."""
        success = "" if self.success_rate is None else f"success {self.success_rate:.0%}, "
        earned = f"{self.mean_return:{fixed(1, [self.mean_return])}}"
        return f"{success}return {earned}, {counted(self.n_leaves, 'leaf')}"


COLUMNS = tuple(field.name for field in fields(CurvePoint))


def curve_to_csv(points: Sequence[CurvePoint]) -> str:
    """Return a learning curve as CSV text, one point a line."""
    return table_to_csv(COLUMNS, map(astuple, points))


def table_to_csv(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV text; what is None is an empty field."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(rows)
    return text.getvalue()


def curve_to_pandas(points: Sequence[CurvePoint]) -> Any:
    """Return a data frame with a row for each point: steps, success, return, leaves; index episode.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    return curves_to_pandas({None: points})


def curves_to_pandas(curves: Mapping[int | None, Sequence[CurvePoint]]) -> Any:
    """Return the curves of several runs as one data frame; index: seed, episode.

    Args:
        curves: By the run's seed; None where it does not matter, and then it is in no index.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    points = [(seed, point) for seed, curve in curves.items() for point in curve]
    index: dict[str, Any] = {"episode": np.array([p.episode for _, p in points], dtype=np.int64)}
    if None not in curves:
        index = {"seed": np.array([seed for seed, _ in points], dtype=np.int64), **index}
    kinds = {"steps": np.int64, "success_rate": float, "mean_return": float, "n_leaves": np.int64}
    columns = {  # a rate of None becomes NaN
        name: np.array([getattr(point, name) for _, point in points], dtype=kind)
        for name, kind in kinds.items()
    }
    return data_frame(columns, index=index)


def curve_from_csv(text: str, *, path: str = "curve") -> tuple[CurvePoint, ...]:
    """Return the learning curve of a CSV text; columns may stand in any order.

    Args:
        text: Text that ``curve_to_csv`` wrote.
        path: Where it came from, for messages.

    Raises:
        FormatError: The text is no learning curve; names the line.
    """
    rows = csv.DictReader(io.StringIO(text))
    try:
        missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
        if missing:
            raise FormatError(path, "line 1", f"must name the columns {', '.join(missing)}")
        return tuple(_point(row, path, rows.line_num) for row in rows)
    except csv.Error as error:
        raise FormatError(path, f"line {rows.line_num}", str(error)) from None


def _point(row: dict[str, str], path: str, line: int) -> CurvePoint:
    with blamed(path, f"line {line}", msgspec.ValidationError):
        known = {name: row[name] or None for name in COLUMNS}
        point = msgspec.convert(known, CurvePoint, strict=False)
    if not math.isfinite(point.mean_return) or not 0.0 <= (point.success_rate or 0.0) <= 1.0:
        raise FormatError(path, f"line {line}", f"must hold finite numbers, got {row}")
    return point
