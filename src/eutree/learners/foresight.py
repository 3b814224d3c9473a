"""A learner's plan: who acts in an episode, and what planning makes of the history.

Stands between ``UTree``, which knows state trees, and ``eutree.imagination``, which plans.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats, Integers
from eutree.imagination import ActionTree, Imagination, Plan, Transitions
from eutree.imagination.action_trees import from_decision_tree, to_decision_tree
from eutree.learners.history import TERMINAL, History
from eutree.trees import DecisionTree

_TREES = ("policy", "candidate", "explorer", "taught")
_EPISODES = ("proved", "tried", "helped")
_NUMBERS = ("planned_at", "demonstrations", "outdated")


class Foresight:
    """The plan of one learner.

    Args:
        imagination: How to plan.
        tree: The state tree to start from.
        actions: Action of each leaf.
        n_actions: Number of actions A.
        informed: Whether the actions are an expert's; if not, the first explorer acts at random.

    Attributes:
        plan: What the learner acts by.
    """

    def __init__(
        self,
        imagination: Imagination,
        tree: DecisionTree,
        actions: Integers,
        n_actions: int,
        *,
        informed: bool,
    ) -> None:
        self.plan = Plan(from_decision_tree(tree, actions))
        self._imagination = imagination
        self._n_features = tree.n_features
        self._n_actions = n_actions
        self._informed = informed

    def add_demonstrations(self, n_episodes: int) -> None:
        """Take the first episodes of the history as what the policy can do."""
        self.plan = replace(self.plan, proved=tuple(range(n_episodes)), demonstrations=n_episodes)

    def teach(self, tree: DecisionTree, actions: Integers) -> None:
        """Take a tree that follows what somebody has shown as one to begin from."""
        self.plan = replace(self.plan, taught=from_decision_tree(tree, actions))

    def begin_episode(self, exploration: float, generator: np.random.Generator) -> None:
        """Choose who acts: the explorer, or whoever is on trial."""
        plan = self.plan
        self._generator = generator
        blind = plan.explorer is None and not self._informed
        self._explores = blind or generator.random() < self._imagination.explorer_share
        actor = plan.on_trial
        self._exploration = 0.0
        if self._explores:
            actor = plan.policy if plan.explorer is None else plan.explorer
            self._exploration = 1.0 if blind else exploration
        self._tree, actions = to_decision_tree(actor, self._n_features)
        self._actions: list[int] = actions.tolist()

    def act(self, observation: Floats) -> int:
        """Return the action for the present observation, shape [d]."""
        if self._exploration > 0.0 and self._generator.random() < self._exploration:
            return int(self._generator.integers(self._n_actions))
        return self._actions[self._tree.leaf_of(observation.tolist())]

    def end_episode(self, episode: int, *, shown: bool) -> None:
        """Remember the episode as evidence, if it was not the explorer's and nobody helped."""
        if shown:
            self.plan = replace(self.plan, helped=(*self.plan.helped, episode))
        elif not self._explores:
            self.plan = self.plan.with_episode(episode)

    def keep(self, episodes: Integers) -> None:
        """Forget all episodes but these, which are numbered from 0 now."""
        self.plan = self.plan.keeping(episodes)

    def think(self, history: History, generator: np.random.Generator) -> bool:
        """Plan if it is time; return whether the policy is another one now."""
        if not history.size or not self._imagination.due(self.plan, history.n_seen):
            return False
        before = self.plan.policy
        data = transitions_of(history, self._n_actions)
        plan = self._imagination.plan(self.plan, data, generator)
        self.plan = replace(plan, planned_at=history.n_seen)
        return self.plan.policy is not before

    def policy(self) -> tuple[DecisionTree, Integers]:
        """Return the policy: its state tree, and the action of each leaf [L]."""
        return to_decision_tree(self.plan.policy, self._n_features)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all that the plan consists of."""
        state: dict[str, NDArray[Any]] = {
            name: np.array(getattr(self.plan, name), dtype=np.int64) for name in _EPISODES
        }
        if not self.plan.helped:
            del state["helped"]
        for name in _NUMBERS:
            state[name] = np.array([getattr(self.plan, name)])
        state["informed"] = np.array([self._informed])
        for name in _TREES:
            tree = getattr(self.plan, name)
            if tree is not None:
                state |= {f"{name}_{field}": getattr(tree, field) for field in ActionTree._fields}
        return state

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take back a ``state()``."""
        trees = {name: _tree(state, name) for name in _TREES if f"{name}_feature" in state}
        episodes = {name: tuple(state[name].tolist()) for name in _EPISODES if name in state}
        numbers = {name: int(state[name][0]) for name in _NUMBERS}
        self.plan = replace(
            self.plan,
            policy=trees["policy"],
            candidate=trees.get("candidate"),
            explorer=trees.get("explorer"),
            taught=trees.get("taught"),
            proved=episodes["proved"],
            tried=episodes["tried"],
            helped=episodes.get("helped", ()),
            **numbers,
        )
        self._informed = bool(state["informed"][0])


def transitions_of(history: History, n_actions: int) -> Transitions:
    """Return a history as planning sees it; what a gap divides counts as two episodes."""
    numbers = history.episodes.astype(np.int64)
    gaps = ~history.continues
    gaps[1:] &= numbers[1:] == numbers[:-1]
    gaps[:1] = False
    return Transitions(
        history.observations,
        history.actions.astype(np.int64),
        history.rewards,
        history.next_observations,
        history.entered == TERMINAL,
        numbers + np.cumsum(gaps),
        n_actions,
    )


def _tree(state: Mapping[str, NDArray[Any]], name: str) -> ActionTree:
    return ActionTree(*(np.array(state[f"{name}_{field}"]) for field in ActionTree._fields))
