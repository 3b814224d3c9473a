"""The panels beside a tree on the recorder's page, as values and in words.

The ways of doing a task beside each other: the person's, the tree of it, the practised one. And
the seconds that hurt: a strip for each episode.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans
from eutree.compression import RealEpisodes, compress
from eutree.compression.episodes import FrontEntry
from eutree.data import Demonstrations, Episode
from eutree.display import counted
from eutree.evaluation import Evaluation
from eutree.fitting.report import Person, result_in_words
from eutree.inspection import diff
from eutree.interaction import GuardedEnv, describe, run_episode
from eutree.policies import TreePolicy
from eutree.recording import keys_of_environment
from eutree.recording.tree_making import HurtView, Segment, StripView, WayView
from eutree.trees.text import printable

if TYPE_CHECKING:
    from eutree.fitting.hurting import Hurt, Hurting

PLAYED = 200  # episodes that each size plays
COUNTED = 50  # episodes that say how much a tree waits
CHANGES = 5  # sentences on the changes by practice
STRIPS = 6  # that are looked at


@dataclass(frozen=True, eq=False)
class Way:
    """A tree to choose: its name, the words of its button, its result, and where it is kept."""

    name: str
    keep: str
    tree: TreePolicy
    played: Evaluation
    path: Path


def smaller(
    tree: TreePolicy, observations: ArrayLike, env: gymnasium.Env[Any, Any], *, seed: int
) -> list[FrontEntry]:
    """Return the best smaller tree of each size by playing, the largest first.

    The recorded ``observations`` [N, d] are in the features of the tree.
    """
    real = RealEpisodes(env, episodes=PLAYED, searches=True)
    _, report = compress(tree, observations, env=real, seed=seed)
    return [entry for entry in report.front if entry.policy.n_leaves < tree.n_leaves]


def beside_each_other(
    ways: Sequence[Way],
    kept: TreePolicy,
    demonstrations: Demonstrations,
    env: gymnasium.Env[Any, Any],
    *,
    seed: int,
) -> dict[str, Any]:
    """Return a ``TreeView``'s fields on the ways and the changes by practice; none for one way.

    The tree of the person's way comes first; ``kept`` is the tree that is chosen at present. Played
    episodes, from ``seed`` on, say how much a tree waits.
    """
    if len(ways) < 2:
        return {}
    own = Person.of(demonstrations).whole
    idle, world = keys_of_environment(env, describe(env)).idle, GuardedEnv(env)
    shown = [episode for episode in demonstrations if episode.by_hand is None]
    rows = [] if own is None else [WayView(name="you", cells=_cells(own, shown, idle))]
    for way in ways:
        played = [run_episode(world, way.tree, seed + k) for k in range(COUNTED)]
        cells = _cells(way.played, played, idle)
        rows.append(WayView(name=way.name, cells=cells, keep=way.keep, is_kept=way.tree is kept))
    columns = ("", "reaches", "steps", *(() if idle is None else ("waits",)), "worst 5 %")
    changes = _changes(ways[0].tree, kept, demonstrations)
    return {"columns": columns, "ways": tuple(rows), "changes": changes}


def value(played: Evaluation | FrontEntry) -> float:
    """Return the share of successes where it is known, else the mean return."""
    return played.mean_return if played.success_rate is None else played.success_rate


def _cells(result: Evaluation, episodes: Iterable[Episode], idle: int | None) -> tuple[str, ...]:
    """Return the result of a way, its steps, how much of them it waits, and its worst episodes."""
    taken = np.concatenate([episode.actions for episode in episodes])
    waits = () if idle is None else (f"{100 * np.mean(taken == idle):.0f} %",)
    low = np.quantile(result.returns, 0.05)
    return (result_in_words(result), f"{result.mean_length:.1f}", *waits, f"{low:.4g}")


def _changes(
    before: TreePolicy, after: TreePolicy, demonstrations: Demonstrations
) -> tuple[str, ...]:
    """Return the decisions of a tree that an earlier one makes otherwise, where the person was."""
    if before is after or before.history != after.history:
        return ()
    rows = demonstrations.with_history(before.history).observations
    most = [box for box in diff(before, after, observations=rows).boxes[:CHANGES] if box.visited]
    return tuple(f"{100 * (box.visited or 0.0):.1f} % of your steps: {box.words}" for box in most)


def hurt_views(found: "Hurting", numbers: Sequence[int]) -> tuple[HurtView, ...]:
    """Return the segments found for the page; ``numbers`` are the episodes' in their folder."""
    return tuple(_hurt_view(one, found.demonstrations, numbers) for one in found.hurts)


def said_of(found: "Hurting") -> str:
    """Return in a sentence how much was found."""
    count = sum(one.after is not None for one in found.hurts)
    return f"{counted(count, 'group')} of steps hurt: see below." if count else "Nothing hurts."


def _hurt_view(one: "Hurt", shown: Demonstrations, numbers: Sequence[int]) -> HurtView:
    places = list(dict.fromkeys(part.episode for part in one.segments))
    return HurtView(
        what=one.what,
        title=_title(one, len(places), shown.schema.actions),
        why=f"{one.why[0].upper()}{one.why[1:]}.",
        reached=f"{one.reached[0].upper()}{one.reached[1:]}.",
        segments=tuple(replace(part, episode=numbers[part.episode]) for part in one.segments),
        strips=tuple(
            _strip(shown, place, numbers[place], [p for p in one.segments if p.episode == place])
            for place in places[:STRIPS]
        ),
    )


def _title(one: "Hurt", episodes: int, names: tuple[str, ...]) -> str:
    steps = sum(part.stop - part.start for part in one.segments)
    title = f"{one.what.capitalize()} {counted(steps, 'step')} of {counted(episodes, 'episode')}"
    if one.what != "flip":
        return title
    to = dict.fromkeys(printable(names[part.becomes or 0]) for part in one.segments)
    return f"{title} to {' or '.join(to)}"


def _strip(shown: Demonstrations, place: int, number: int, marked: list[Segment]) -> StripView:
    actions = shown.episodes[place].actions
    runs = [(action, len(list(steps))) for action, steps in groupby(actions.tolist())]
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
