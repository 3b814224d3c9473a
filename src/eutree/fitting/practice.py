"""Practice: a fitted tree learns on, from what was shown and from what it has played."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium

from eutree.data import Demonstrations, Episode
from eutree.learners import ModelPlanning, PlanningMethod
from eutree.policies import TreePolicy
from eutree.policy_search.planner import Planner
from eutree.training import Run, learn
from eutree.training.callback import CallbackLike

MOST_KNOWN = 20_000  # steps of what a tree has played that practice begins with

# Hundreds of episodes are known to begin with, so it is planned early and often: waiting until they
# have grown by 6 % would leave a hundred episodes of practice one or two challengers. Nearly all of
# them were played by the tree itself, so they say what it can do.
METHOD = PlanningMethod(
    gathering_episodes=10,
    planner=Planner(growth=1.02, trust_demonstrations=True),
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
    on_progress: Callable[[Run], None] | None = None,
    callback: CallbackLike | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[TreePolicy, ...]:
    """Return what learning makes of a tree in ``episodes`` episodes: one tree, or two.

    The first is the policy. The second is the challenger whose evaluation the end of the practice
    has cut short, if there is one: mostly the better of both. Let them play, and take the better.

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
    runs: list[Run] = []

    def follow(run: Run) -> None:
        runs[:] = [run]
        if on_progress is not None:
            on_progress(run)

    policy = learn(
        env,
        demonstrations=replace(demonstrations, episodes=known),
        expert=tree,
        method=METHOD,
        history=tree.history,
        episodes=episodes,
        evaluate_every=max(episodes, 1),
        evaluation_episodes=1,
        judge_episodes=0,
        seed=seed,
        callback=callback,
        stop=stop,
        on_progress=follow,
    ).policy
    return (policy, *(tree for run in runs for tree in _on_trial(run)))


def _on_trial(run: Run) -> list[TreePolicy]:
    learner = run.learner
    found = learner.on_trial() if isinstance(learner, ModelPlanning) else None
    return [] if found is None else [found.policy(run.beginning.problem)]


def _recent(episodes: tuple[Episode, ...]) -> tuple[Episode, ...]:
    """Return the last episodes, of ``MOST_KNOWN`` steps at most."""
    steps, kept = 0, []
    for episode in reversed(episodes):
        steps += len(episode)
        if steps > MOST_KNOWN:
            break
        kept.append(episode)
    return tuple(reversed(kept))
