"""Segments of demonstrations: runs of one action, what may be cut or flipped, and how it is kept.

What was done stays in the demonstrations; beside it stands what is to be imitated in its place
(``Episode.taught``).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Booleans, Integers
from eutree.data import Demonstrations
from eutree.data.demonstrations import taught_in, teaching
from eutree.data.episode import CUT
from eutree.recording.tree_making import Segment


def accepted(demonstrations: Demonstrations, segments: Iterable[Segment]) -> Demonstrations:
    """Return demonstrations of which some segments are cut or flipped; what was done stays."""
    episodes = list(demonstrations.episodes)
    for one in segments:
        episode = episodes[one.episode]
        episodes[one.episode] = episode.teaching_in(one.start, one.stop, one.becomes)
    return replace(demonstrations, episodes=tuple(episodes))


def restored(demonstrations: Demonstrations) -> Demonstrations:
    """Return demonstrations with nothing cut or flipped."""
    return teaching(demonstrations, demonstrations.actions)


@dataclass(frozen=True, eq=False)
class Edit:
    """Steps to try without: ``rows`` [n] of the kept transitions, what each ``becomes`` [n]."""

    rows: Integers  # [n]
    becomes: Integers  # [n]
    why: str


NONE = -2  # no run of keys before, or after


@dataclass(frozen=True, eq=False)
class KeyRuns:
    """The kept transitions of demonstrations, as runs of one action.

    Attributes:
        taught: What is imitated, [N].
        episode: The number of the episode, [N].
        run: The number of the run, [N].
        from_start: Steps from the beginning of the run, [N].
        to_end: Steps to the end of the run, [N].
        before: What is imitated before the run; ``NONE`` where the episode begins with it, [N].
        after: The same behind it, [N].
    """

    taught: Integers  # [N]
    episode: Integers  # [N]
    run: Integers  # [N]
    from_start: Integers  # [N]
    to_end: Integers  # [N]
    before: Integers  # [N]
    after: Integers  # [N]

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> "KeyRuns":
        """Return the runs of demonstrations."""
        taught = taught_in(demonstrations)
        kept = [(k, len(e)) for k, e in enumerate(demonstrations.episodes) if e.kept]
        episode = np.repeat([k for k, _ in kept], [length for _, length in kept])
        new = np.ones(len(taught), dtype=bool)
        new[1:] = (taught[1:] != taught[:-1]) | (episode[1:] != episode[:-1])
        run = np.cumsum(new) - 1
        first, place = np.flatnonzero(new), np.arange(len(taught))
        last = np.append(first[1:], len(taught)) - 1
        of_run, its_episode = taught[first], episode[first]
        before, after = (np.full(len(first), NONE) for _ in range(2))
        same = its_episode[1:] == its_episode[:-1]
        before[1:][same], after[:-1][same] = of_run[:-1][same], of_run[1:][same]
        return cls(
            taught, episode, run, place - first[run], last[run] - place, before[run], after[run]
        )

    def edits(self, rows: Integers, why: str) -> Iterator[Edit]:
        """Yield that these steps are cut, or flipped to what was done after them, or before."""
        rows = rows[self.taught[rows] != CUT]
        if rows.size:
            yield Edit(rows, np.full(rows.size, CUT), why)
        for other in (self.after, self.before):
            known = rows[other[rows] >= 0]
            if known.size:
                yield Edit(known, other[known], why)

    def pieces(self, rows: Integers) -> list[Integers]:
        """Return some steps, ascending, as consecutive ones of one run each."""
        ends = np.flatnonzero((np.diff(rows) > 1) | (np.diff(self.run[rows]) > 0)) + 1
        return [piece for piece in np.split(rows, ends) if piece.size]


def last_steps(episode: Integers, count: int) -> Booleans:
    """Return which steps are among the last ``count`` of their episode, [N]."""
    last = np.append(episode[1:] != episode[:-1], True)
    place = np.arange(episode.size)
    ends = np.flatnonzero(last)
    return ends[np.searchsorted(ends, place)] - place < count


def segments_of(known: Demonstrations, edit: Edit) -> tuple[Segment, ...]:
    """Return the steps of an edit as segments, in order."""
    kept = [(k, step) for k, e in enumerate(known.episodes) if e.kept for step in range(len(e))]
    found: list[Segment] = []
    for row, becomes in sorted(zip(edit.rows.tolist(), edit.becomes.tolist(), strict=True)):
        number, step = kept[row]
        episode = known.episodes[number]
        action, to = int(episode.actions[step]), None if becomes == CUT else becomes
        last = found[-1] if found else None
        if last and (last.episode, last.stop, last.action, last.becomes) == (
            number, step, action, to
        ):  # fmt: skip
            found[-1] = replace(last, stop=step + 1)
        else:
            found.append(Segment(number, step, step + 1, None, action, to))
    return tuple(replace(one, seconds=_seconds(known, one)) for one in found)


def _seconds(known: Demonstrations, one: Segment) -> tuple[float, float] | None:
    """Return when a segment begins and ends, where the times of the steps were measured."""
    time = known.episodes[one.episode].steps.get("time")
    if time is None or len(time) < 2 or not np.isfinite(time).all():
        return None
    ends = np.append(time, 2 * time[-1] - time[-2]) - time[0]
    return round(float(ends[one.start]), 3), round(float(ends[one.stop]), 3)
