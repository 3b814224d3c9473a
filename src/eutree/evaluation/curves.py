"""Learning curves: frozen evaluations along a run, as text and averaged over runs.

The text form is CSV with a header line; floats are written so that they read back to the same
bits, an absent success rate as an empty field.
"""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from eutree.arrays import Floats, Integers, frozen
from eutree.errors import FormatError, InvalidArgumentError
from eutree.evaluation.bootstrap import draw_rows
from eutree.evaluation.intervals import check_confidence
from eutree.frames import data_frame
from eutree.wording import counted


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
        return f"{success}return {self.mean_return:.1f}, {counted(self.n_leaves, 'leaf')}"


COLUMNS = tuple(field.name for field in fields(CurvePoint))


def curve_to_csv(points: Sequence[CurvePoint]) -> str:
    """Return a learning curve as CSV text, one point a line."""
    lines = [",".join(COLUMNS)]
    for point in points:
        lines.append(",".join(_text(getattr(point, name)) for name in COLUMNS))
    return "\n".join(lines) + "\n"


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
    rates = [math.nan if p.success_rate is None else p.success_rate for _, p in points]
    columns = {
        "steps": np.array([p.steps for _, p in points], dtype=np.int64),
        "success_rate": np.array(rates, dtype=np.float64),
        "mean_return": np.array([p.mean_return for _, p in points], dtype=np.float64),
        "n_leaves": np.array([p.n_leaves for _, p in points], dtype=np.int64),
    }
    return data_frame(columns, index=index)


def _text(value: float | None) -> str:
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def curve_from_csv(text: str, *, path: str = "curve") -> tuple[CurvePoint, ...]:
    """Return the learning curve of a CSV text; columns may stand in any order.

    Args:
        text: What ``curve_to_csv`` wrote.
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
    try:
        success = float(row["success_rate"]) if row["success_rate"] else None
        point = CurvePoint(
            episode=int(row["episode"]),
            steps=int(row["steps"]),
            success_rate=success,
            mean_return=float(row["mean_return"]),
            n_leaves=int(row["n_leaves"]),
        )
    except (TypeError, ValueError) as error:
        raise FormatError(path, f"line {line}", str(error)) from None
    if not math.isfinite(point.mean_return) or not 0.0 <= (success or 0.0) <= 1.0:
        raise FormatError(path, f"line {line}", f"must hold finite numbers, got {row}")
    return point


@dataclass(frozen=True, eq=False)
class Band:
    """A mean over runs at each point of a curve, with its bootstrap interval."""

    mean: Floats  # [P]
    low: Floats  # [P]
    high: Floats  # [P]

    def __post_init__(self) -> None:
        for name in ("mean", "low", "high"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, eq=False)
class AverageCurve:
    """The learning curves of several runs, averaged point by point.

    Attributes:
        episodes: Episodes of experience before each point.
        success_rate: Mean success rate; None where the environment reports none.
        mean_return: Mean return.
        n_leaves: Mean number of leaves.
        n_runs: How many runs they are means of.
    """

    episodes: Integers  # [P]
    success_rate: Band | None
    mean_return: Band
    n_leaves: Band
    n_runs: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "episodes", frozen(self.episodes))


def average_curves(
    curves: Sequence[Sequence[CurvePoint]],
    *,
    confidence: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> AverageCurve:
    """Return the mean curve of several runs, with percentile bootstrap intervals over runs.

    Whole runs are drawn, the same at all points.

    Args:
        curves: One curve per run, all evaluated after the same episodes.
        confidence: Of the interval at each point.
        resamples: How many times runs are drawn.
        seed: Source of chance.
    """
    if not curves or not curves[0]:
        raise InvalidArgumentError("curves must hold at least one run with one point, got none")
    episodes = [point.episode for point in curves[0]]
    for number, curve in enumerate(curves):
        if [point.episode for point in curve] != episodes:
            raise InvalidArgumentError(
                f"curves must be evaluated after the same episodes; run {number} differs from run 0"
            )
    rows = draw_rows(len(curves), resamples=resamples, seed=seed)

    def band(name: str) -> Band | None:
        table = [[getattr(point, name) for point in curve] for curve in curves]
        if any(value is None for values in table for value in values):
            return None
        return _band(np.array(table, dtype=np.float64), rows, confidence)

    mean_return, n_leaves = band("mean_return"), band("n_leaves")
    if mean_return is None or n_leaves is None:
        raise InvalidArgumentError("curves must know their returns and leaves at every point")
    return AverageCurve(
        np.array(episodes), band("success_rate"), mean_return, n_leaves, len(curves)
    )


def _band(table: Floats, rows: Integers, confidence: float) -> Band:
    """Return the mean of a table [R, P] over its rows, with the interval of the draws [B, R]."""
    tail = (1 - check_confidence(confidence)) / 2
    shares = np.zeros((len(rows), len(table)))  # [B, R] how often each run was drawn, of all draws
    np.add.at(shares, (np.arange(len(rows))[:, np.newaxis], rows), 1.0 / len(table))
    low, high = np.quantile(shares @ table, [tail, 1 - tail], axis=0)
    return Band(table.mean(axis=0), low, high)
