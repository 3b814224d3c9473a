"""Seconds that hurt, as the recorder's page shows them: a strip for each episode, and words."""

from collections.abc import Iterator, Sequence

import numpy as np

from eutree.arrays import Booleans
from eutree.data import Demonstrations, Episode
from eutree.fitting.hurting import Hurt, Hurting
from eutree.fitting.segments import Segment
from eutree.recording.tree_making import HurtView, SegmentView, StripView
from eutree.trees.text import printable
from eutree.wording import counted

STRIPS = 6  # that are looked at


def hurt_views(found: Hurting, numbers: Sequence[int]) -> tuple[HurtView, ...]:
    """Return what was found for the page.

    Args:
        found: What was found.
        numbers: The number of each episode in its folder.
    """
    return tuple(_hurt_view(one, found.demonstrations, numbers) for one in found.hurts)


def said_of(found: Hurting) -> str:
    """Return in a sentence how much was found."""
    count = sum(one.after is not None for one in found.hurts)
    return f"{counted(count, 'group')} of steps hurt: see below." if count else "Nothing hurts."


def _hurt_view(one: Hurt, shown: Demonstrations, numbers: Sequence[int]) -> HurtView:
    places = list(dict.fromkeys(part.episode for part in one.segments))
    return HurtView(
        what=one.what,
        title=_title(one, len(places), shown.schema.actions),
        why=f"{one.why[0].upper()}{one.why[1:]}.",
        reached=f"{one.reached[0].upper()}{one.reached[1:]}.",
        segments=tuple(
            SegmentView(
                episode=part.episode,
                start=part.start,
                stop=part.stop,
                action=part.action,
                becomes=part.becomes,
            )
            for part in one.segments
        ),
        strips=tuple(
            _strip(shown, place, numbers[place], [p for p in one.segments if p.episode == place])
            for place in places[:STRIPS]
        ),
    )


def _title(one: Hurt, episodes: int, names: tuple[str, ...]) -> str:
    steps = sum(part.stop - part.start for part in one.segments)
    title = f"{one.what.capitalize()} {counted(steps, 'step')} of {counted(episodes, 'episode')}"
    if one.what != "flip":
        return title
    to = dict.fromkeys(printable(names[part.becomes or 0]) for part in one.segments)
    return f"{title} to {' or '.join(to)}"


def _strip(shown: Demonstrations, place: int, number: int, marked: list[Segment]) -> StripView:
    actions = shown.episodes[place].actions
    ends = [*(np.flatnonzero(np.diff(actions)) + 1).tolist(), len(actions)]
    runs = [
        (int(actions[end - 1]), end - start)
        for start, end in zip([0, *ends[:-1]], ends, strict=True)
    ]
    names = [printable(name) for name in shown.schema.actions]
    course = ", ".join(f"{names[action]} {length}" for action, length in runs)
    which = "; ".join(part.words(shown.schema, None) for part in marked)
    return StripView(
        number=number,
        runs=tuple(runs),
        keys=tuple(_held(shown.episodes[place])),
        marks=tuple((part.start, part.stop) for part in marked),
        words=f"Episode {number}, {counted(len(actions), 'step')}: {course}. Marked: {which}.",
    )


def _held(episode: Episode) -> Iterator[tuple[str, int, int]]:
    """Yield each key with the first step that it was held at, and the one after the last."""
    names, held = episode.extras.get("keys", ()), episode.steps.get("keys")
    if held is None or held.ndim != 2:
        return
    for name, column in zip(names, held.T, strict=False):
        padded: Booleans = np.concatenate([[False], column.astype(bool), [False]])
        edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            yield str(name), start, stop
