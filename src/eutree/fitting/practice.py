"""Practice: a fitted tree learns on, from what was shown and from what it has played."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium

from eutree.data import Demonstrations, Episode
from eutree.learners.model_planning import PlanningMethod
from eutree.policies import TreePolicy
from eutree.policy_search.planner import Planner
from eutree.training.callback import CallbackLike
from eutree.training.learn import Progress, learn

MOST_KNOWN = 20_000  # steps of what a tree has played that practice begins with

# Hundreds of episodes are known to begin with, so it is planned early and often: waiting until they
# have grown by 6 % would leave a hundred episodes of practice one or two challengers. Nearly all of
# them were played by the tree itself, so they say what it can do.
METHOD = PlanningMethod(
    gathering_episodes=10,
    planner=Planner(growth=1.02, incumbent_first=0),
    unpruned_start=False,
)


def practise(
    tree: TreePolicy,
    demonstrations: Demonstrations,
    played: tuple[Episode, ...],
    env: gymnasium.Env[Any, Any],
    *,
    episodes: int,
    seed: int = 0,
    on_progress: Progress | None = None,
    callback: CallbackLike | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> TreePolicy:
    """Return what learning makes of a tree in ``episodes`` episodes.

    Learning begins with what the tree has played, besides what was shown: the model of the world in
    which it plans is better by that, for nothing.

    Args:
        tree: The tree to go on from.
        demonstrations: What was shown.
        played: What the tree has played since; the last ``MOST_KNOWN`` steps are used.
        env: Where to practise.
        episodes: How long.
        seed: The same seed gives the same tree.
        on_progress: Called after each episode, as by ``eutree.learn``.
        callback: Follows the run, as in ``eutree.learn``.
        stop: Asked before every step; True ends the practice at its last finished episode.
    """
    known = (*demonstrations.episodes, *_recent(played))
    return learn(
        env,
        demonstrations=replace(demonstrations, episodes=known),
        expert=tree,
        method=METHOD,
        history=tree.history,
        episodes=episodes,
        evaluate_every=max(episodes, 1),
        evaluation_episodes=1,
        seed=seed,
        callback=callback,
        stop=stop,
        on_progress=on_progress,
    ).policy


def _recent(episodes: tuple[Episode, ...]) -> tuple[Episode, ...]:
    """Return the last episodes, of ``MOST_KNOWN`` steps at most."""
    steps, kept = 0, []
    for episode in reversed(episodes):
        steps += len(episode)
        if steps > MOST_KNOWN:
            break
        kept.append(episode)
    return tuple(reversed(kept))
