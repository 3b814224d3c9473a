"""The ways of doing a task beside each other: the person's, the tree of it, what practice made."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from eutree.compression import RealEpisodes, compress
from eutree.compression.report import FrontEntry
from eutree.data import Demonstrations, Episode
from eutree.evaluation import Evaluation
from eutree.fitting.report import Person, result_in_words
from eutree.inspection import diff
from eutree.interaction import GuardedEnv, describe, run_episode
from eutree.policies import TreePolicy
from eutree.recording import keys_of_environment
from eutree.recording.tree_making import WayView

PLAYED = 200  # episodes that each size plays
COUNTED = 50  # episodes that say how much a tree waits
CHANGES = 5  # sentences on what practice changed


@dataclass(frozen=True, eq=False)
class Way:
    """A tree to choose: its name, the words of its button, what it reached, where it is kept."""

    name: str
    keep: str
    tree: TreePolicy
    played: Evaluation
    path: Path


def smaller(
    tree: TreePolicy, observations: ArrayLike, env: gymnasium.Env[Any, Any], *, seed: int
) -> list[FrontEntry]:
    """Return the best smaller tree of each size by playing, the largest first.

    Args:
        tree: The tree.
        observations: Recorded observations, shape [N, d], in its features.
        env: Where trees play.
        seed: Seed of the episodes.
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
    """Return a ``TreeView``'s fields on the ways, and on what practice changed; none for one way.

    Args:
        ways: The trees to choose from, the tree of the person's way first.
        kept: The tree that is chosen at present.
        demonstrations: What the person has shown.
        env: Where it is counted how much a tree waits.
        seed: Seed of these episodes.
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
    """Return what a way reaches, its steps, how much of them it waits, and its worst episodes."""
    taken = np.concatenate([episode.actions for episode in episodes])
    waits = () if idle is None else (f"{100 * np.mean(taken == idle):.0f} %",)
    low = np.quantile(result.returns, 0.05)
    return (result_in_words(result), f"{result.mean_length:.1f}", *waits, f"{low:.4g}")


def _changes(
    before: TreePolicy, after: TreePolicy, demonstrations: Demonstrations
) -> tuple[str, ...]:
    """Return what a tree does otherwise than an earlier one, where the person was."""
    if before is after or before.history != after.history:
        return ()
    rows = demonstrations.with_history(before.history).observations
    boxes = diff(before, after, observations=rows).boxes
    most = [box for box in boxes[:CHANGES] if box.visited]
    return tuple(f"{100 * (box.visited or 0.0):.1f} % of your steps: {box.words}" for box in most)
