"""The partition of a run, drawn while it grows."""

import re
from html import unescape
from pathlib import Path
from typing import Any

from eutree.errors import InvalidArgumentError
from eutree.files import make_folder, read_bytes, write_text
from eutree.learners.looking import partition_of, plane_of
from eutree.learners.partition import Plane
from eutree.report.partition_chart import partition_chart
from eutree.schema import Schema
from eutree.training.callback import TrainingModel
from eutree.wording import counted

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

    def init_callback(self, model: TrainingModel) -> None:
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
