"""The partition of a run, drawn while it grows."""

import math
import re
from collections.abc import Sequence
from html import escape, unescape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.files import make_folder, read_bytes, write_text
from eutree.learners.looking import partition_of, plane_of
from eutree.learners.partition import Partition, Plane, PlaneRegion
from eutree.report.chart import ticks
from eutree.report.html import asset
from eutree.schema import Feature, Schema
from eutree.wording import counted

if TYPE_CHECKING:
    from eutree.training.callback import TrainingModel

_STYLES = 5
_SIDE, _LEFT, _RIGHT, _TOP, _BOTTOM = 420.0, 52.0, 10.0, 10.0, 44.0
_FAINT = 0.12  # the least that is known
_ROOM = 15.0  # pixels in either direction that a number in a region needs


def partition_chart(
    partition: Partition, schema: Schema, *, path: Floats | None = None, standalone: bool = True
) -> str:
    """Return a partition as a drawing.

    Pointing at a region shows its action and its value.

    Args:
        partition: The partition.
        schema: Names of the features and actions.
        path: Where an episode went, shape [T, 2], in the features of the plane.
        standalone: Whether the drawing brings its own style; a page that embeds several drawings
            has ``asset("chart.css")`` and ``asset("partition.css")`` once instead.
    """
    plane = partition.plane
    features = [schema.features[axis] for axis in plane.axes]
    label = (
        f"{counted(len(partition.regions), 'region')}, {features[0].name} to the right, "
        f"{features[1].name} upwards"
    )
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart partition" role="img" '
        f'viewBox="0 0 {_SIDE:.0f} {_SIDE:.0f}"><title>{escape(label)}</title>'
        f"<desc>{escape(partition_caption(partition, schema))}</desc>"
    ]
    if standalone:
        style = asset("colours.css") + asset("chart.css") + asset("partition.css")
        lines.append(f"<style>{escape(style, quote=False)}</style>")
    strengths = _strengths([region.value for region in partition.regions])
    for region, strength in zip(partition.regions, strengths, strict=True):
        lines.append(_region(partition, region, strength, schema))
    lines += [f'<polygon class="goal" points="{_places(partition, g)}"/>' for g in partition.goals]
    radius = max(1.0, min(2.6, 40.0 / math.sqrt(max(len(partition.points), 1))))
    lines += [
        f'<circle class="point" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"/>'
        for x, y in _pixels(partition, partition.points).tolist()
    ]
    if path is not None and len(path) > 1:
        lines.append(f'<polyline class="path" points="{_places(partition, path)}"/>')
    return "\n".join([*lines, *_axes(partition, features), "</svg>"])


def partition_caption(partition: Partition, schema: Schema) -> str:
    """Return what a drawing shows besides its axes, in one sentence."""
    finite = [r.value for r in partition.regions if math.isfinite(r.value)]
    words = [counted(len(partition.regions), "region")]
    if len(partition.points):
        words.append(f"{len(partition.points)} {partition.points_are}")
    if partition.values and finite:
        words.append(f"{partition.values} {min(finite):.4g} to {max(finite):.4g}")
    lost = sum(region.value == math.inf for region in partition.regions)
    if lost:
        words.append(f"{lost} lost")
    plane = partition.plane
    others = [
        f"{feature.name} = {value:.4g}"
        for axis, (feature, value) in enumerate(zip(schema.features, plane.at, strict=True))
        if axis not in plane.axes
    ]
    where = f" at {', '.join(others[:4])}{', ...' if len(others) > 4 else ''}" if others else ""
    return ", ".join(words) + where


def _strengths(values: Sequence[float]) -> list[float]:
    """Return how strong each region is drawn, by the rank of its value; NaN where unknown.

    Ranks, because a few values far from the others would leave no difference between these.
    """
    known = sorted({value for value in values if math.isfinite(value)})
    place = {value: number / max(len(known) - 1, 1) for number, value in enumerate(known)}
    return [
        _FAINT + (0.8 - _FAINT) * place[value] if math.isfinite(value) else math.nan
        for value in values
    ]


def _region(partition: Partition, region: PlaneRegion, strength: float, schema: Schema) -> str:
    said = [] if region.action is None else [schema.actions[region.action]]
    style = f"action-{(region.action or 0) % _STYLES}"
    if region.action is None:
        style = "cell"
    if not math.isnan(region.value):
        said.append(f"{partition.values} {region.value:.4g}")
    if region.value == math.inf:
        style, strength = "lost", 1.0
    opacity = 0.4 if math.isnan(strength) else strength
    parts = [
        f'<polygon class="region {style}" points="{_places(partition, region.outline)}" '
        f'fill-opacity="{opacity:.2f}"/>'
    ]
    if region.action is None and math.isfinite(region.value):
        pixels = _pixels(partition, region.outline)
        if (np.ptp(pixels, axis=0) > _ROOM).all():
            x, y = pixels.mean(axis=0)
            parts.append(
                f'<text class="number" x="{x:.1f}" y="{y + 4:.1f}" text-anchor="middle">'
                f"{region.value:.4g}</text>"
            )
    title = f"<title>{escape(', '.join(said))}</title>" if said else ""
    return f"<g>{''.join(parts)}{title}</g>"


def _axes(partition: Partition, features: Sequence[Feature]) -> list[str]:
    """Return the frame, round numbers along it, and the features' names."""
    plane, bottom, right = partition.plane, _SIDE - _BOTTOM, _SIDE - _RIGHT
    lines = [
        f'<rect class="frame" x="{_LEFT}" y="{_TOP}" width="{right - _LEFT}" '
        f'height="{bottom - _TOP}"/>'
    ]
    for axis in (0, 1):
        low, high = plane.low[axis], plane.high[axis]
        for tick in ticks(float(low), float(high)):
            if not low <= tick <= high:
                continue
            place = np.where(np.arange(2) == axis, tick, plane.low)
            x, y = _pixels(partition, place[np.newaxis])[0]
            where = (
                f'x="{x:.1f}" y="{y + 15:.1f}" text-anchor="middle"'
                if axis == 0
                else f'x="{x - 6:.1f}" y="{y + 4:.1f}" text-anchor="end"'
            )
            lines.append(f"<text {where}>{tick:.4g}</text>")
    middle = (_TOP + bottom) / 2
    return [
        *lines,
        f'<text x="{(_LEFT + right) / 2:.1f}" y="{_SIDE - 8:.1f}" text-anchor="middle">'
        f"{escape(_titled(features[0]))}</text>"
        f'<text transform="translate(13 {middle:.1f}) rotate(-90)" text-anchor="middle">'
        f"{escape(_titled(features[1]))}</text>",
    ]


def _pixels(partition: Partition, places: Floats) -> Floats:
    """Return places of the plane, shape [N, 2], in the drawing's own unit."""
    plane = partition.plane
    share = (np.clip(places, plane.low, plane.high) - plane.low) / (plane.high - plane.low)
    across = _LEFT + share[:, 0] * (_SIDE - _RIGHT - _LEFT)
    upwards = _SIDE - _BOTTOM - share[:, 1] * (_SIDE - _BOTTOM - _TOP)
    return np.stack([across, upwards], axis=1)


def _places(partition: Partition, places: Floats) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in _pixels(partition, places).tolist())


def _titled(feature: Feature) -> str:
    return f"{feature.name} [{feature.unit}]" if feature.unit else feature.name


DRAWINGS = "partitions"
"""Folder of the drawings in a run folder."""

_NAME = re.compile(r"after-(\d+)-updates\.svg")
_MOST = 2**24  # bytes of a drawing
_SAID = re.compile(r"<desc>(.*?)</desc>", re.DOTALL)


class PartitionCallback:
    """Draws a learner's partition over two of its features while it learns.

    There is a drawing after 0, 1, 2, 4, 8, ... updates, and one at the end: what is in ``folder``
    already, of a run that was interrupted, stays. A region has the hue of its action and is
    stronger the more it is worth; the line is the way of the last episode.

    Args:
        x: Feature drawn to the right, by its name.
        y: Feature drawn upwards, another one.
        folder: Where the drawings go.

    Raises:
        UnknownNameError: When the run begins: there is no such feature.
    """

    def __init__(self, x: str, y: str, folder: str | Path) -> None:
        if x == y:
            raise InvalidArgumentError(f"x and y must be two features, got {x!r} twice")
        self.x, self.y = x, y
        self.folder = Path(folder)

    def init_callback(self, model: "TrainingModel") -> None:
        """Take the run."""
        self._run = model.run

    def on_training_start(self, locals_: dict[str, Any], globals_: dict[str, Any]) -> None:
        """Find the features."""
        self._plane(self._schema())  # an unknown name is no news for the end of a run

    def on_rollout_start(self) -> None:
        """Draw after 0, 1, 2, 4, ... updates."""
        updates = self._run.at.updates
        if updates & (updates - 1) == 0:  # 0 or a power of two
            self._draw(updates)

    def on_training_end(self) -> None:
        """Draw what has come of it."""
        self._draw(self._run.at.updates)

    def _draw(self, updates: int) -> None:
        path = make_folder(self.folder) / f"after-{updates:06d}-updates.svg"
        if path.exists():
            return
        learner, schema = self._run.learner, self._schema()
        plane = self._plane(schema)
        partition = partition_of(learner, plane)
        history = learner.history
        last = history.observations[history.episodes == history.episodes.max(initial=0)]
        write_text(path, partition_chart(partition, schema, path=last[:, plane.axes]))

    def _schema(self) -> Schema:
        run = self._run
        return run.learner.decisions().policy(run.beginning.problem).schema

    def _plane(self, schema: Schema) -> Plane:
        return plane_of(self._run.learner, schema, self.x, self.y)


def drawings(folder: str | Path) -> list[tuple[str, str]]:
    """Return what ``PartitionCallback`` drew: a caption and the drawing's text, in order."""
    found = []
    for path in sorted(Path(folder).glob("*.svg")):
        name = _NAME.fullmatch(path.name)
        if name is not None:
            text = read_bytes(path, limit=_MOST).decode(errors="replace")
            said = _SAID.search(text)
            words = unescape(said[1]) if said else ""
            found.append((f"After {counted(int(name[1]), 'update')}: {words}", text))
    return found
