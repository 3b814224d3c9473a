"""Adaptive Q-learning: split by visits, explore by optimism.

AdaQL (Sinclair, Banerjee & Yu 2019) keeps a partition of states and actions for each step of an
episode. Here, as in SPAQL (Araujo et al. 2020), one partition serves all steps, and one tree of
states serves all actions. With t visits of a leaf and action, H the horizon,

    Q(s, a) <- (1 - alpha) Q(s, a) + alpha [r + bonus / sqrt(t) + gamma V(s')]
    alpha = (H + 1) / (H + t),   V(s) = min(best, max_a Q(s, a))

and a leaf of depth k is cut in two once it was visited ``first_split`` times 4^(k / d): a box whose
sides are halved holds a fourth of the error. Halves take over Q and t. There is no test: it is the
honest answer to "why not simply split by visits?".

*best*, the largest return to go that was ever seen, caps V and is the value of an untried action;
the bonus is in units of the range of returns seen. A leaf is cut at the middle of the observations
in it, across the feature in which they spread widest, in units of the changes of one step; cuts are
made between two episodes, so a discarded one leaves no trace.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.data import Episode
from eutree.features import threshold_between
from eutree.learners import (
    Decisions,
    History,
    LeafSplit,
    Needs,
    Part,
    Problem,
    Start,
    Step,
    Stored,
    Update,
)
from eutree.learners.declared import LOCKED_PART, TREE_PART, arrays_of, history_parts
from eutree.learners.episode_buffer import EpisodeBuffer, FinishedEpisode, store
from eutree.learners.learner import Arrays, MethodOfParts
from eutree.policies import LeafStatistics
from eutree.trees import DecisionTree
from eutree.validation import check_integer, check_number
from eutree_lab.step_scale import step_scale

_OWN = Part({
    "prior": Stored("i8", "L", low=0, below="A", at="_prior"),
    "depth": Stored("i8", "L", low=0, below="L", at="_depth"),
    "values": Stored("f8", "LA", at="values"),
    "tried": Stored("i8", "LA", low=0, most=2**31, at="_tried"),
    "returns_seen": Stored("f8", "2", at="_seen"),
})  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AdaptiveQMethod(MethodOfParts):
    """The choices of adaptive Q-learning.

    Attributes:
        discount: gamma.
        bonus: Optimism of a first visit, in units of the range of returns seen.
        horizon: H of the rates; a larger one forgets early estimates faster.
        first_split: Visits after which a leaf of the start is cut.
        max_leaves: No leaf is cut when there are this many.
        gathering_episodes: Episodes between two looks at which leaves to cut.
    """

    name: ClassVar[str] = "adaptive-q"
    needs: ClassVar[Needs] = Needs(keeps_locks=True)
    parts = (TREE_PART, *history_parts(tree="tree"), LOCKED_PART, _OWN)

    discount: float = 0.99
    bonus: float = 0.1
    horizon: int = 20
    first_split: int = 32
    max_leaves: int = 512
    gathering_episodes: int = 1

    def __post_init__(self) -> None:
        check_number("discount", self.discount, low=0.0, high=1.0)
        check_number("bonus", self.bonus, low=0.0)
        check_integer("horizon", self.horizon, low=1)
        check_integer("first_split", self.first_split, low=2)
        check_integer("max_leaves", self.max_leaves, low=1)
        check_integer("gathering_episodes", self.gathering_episodes, low=1)

    def start(self, problem: Problem, start: Start) -> "AdaptiveQ":
        """Return the learner at its start: the leaves of an expert tree are the first boxes."""
        tree, actions, locked = start.first_leaves(problem)
        learner = AdaptiveQ(tree, problem.n_actions, self, prior=actions, locked=locked)
        if start.episodes:
            learner.add_demonstrations(start.episodes)
        return learner


class AdaptiveQ:
    """The learner of adaptive Q-learning.

    Args:
        tree: The first boxes: a single leaf, or the expert tree's structure.
        n_actions: Number of actions A.
        method: How to learn.
        prior: Action of each leaf among those of equal Q: the expert's, shape [L].
        locked: Leaves that are never cut and whose prior action stays.

    Attributes:
        tree: The present boxes; a value, so keeping a reference freezes it.
        values: Q, shape [L, A].
        history: All transitions stored so far.
    """

    def __init__(
        self,
        tree: DecisionTree,
        n_actions: int,
        method: AdaptiveQMethod,
        *,
        prior: Integers | None = None,
        locked: Iterable[int] = (),
    ) -> None:
        self.tree = tree
        self.n_actions = n_actions
        self.method = method
        self.history = History(tree.n_features, tree.n_leaves)
        none = np.zeros(tree.n_leaves, dtype=np.int64)
        self._prior = np.array(none if prior is None else prior)  # [L]
        self._locked = frozenset(locked)
        self._depth = np.zeros(tree.n_leaves, dtype=np.int64)  # [L] cuts since the start
        self.values = np.zeros((tree.n_leaves, n_actions))
        self._tried = np.zeros(self.values.shape, dtype=np.int64)
        self._seen = np.zeros(2)  # lowest and highest return to go
        self._buffer = EpisodeBuffer()

    def add_demonstrations(self, episodes: Iterable[Episode]) -> None:
        """Store the expert's transitions and learn from them, the last of an episode first."""
        for episode in episodes:
            leaves = self.tree.leaf_index(episode.observations).astype(np.int32)
            finished = FinishedEpisode(
                episode.observations, episode.actions, episode.rewards, episode.terminated
            )
            store(self.history, finished, leaves, demonstrated=True)
            self._remember_returns(finished)
            for t in range(len(episode) - 1, -1, -1):
                ended = episode.terminated and t == len(episode) - 1
                self._learn(
                    int(leaves[t]),
                    int(episode.actions[t]),
                    float(episode.rewards[t]),
                    None if ended else int(leaves[t + 1]),
                )

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]."""
        self._buffer.start(observation, generator)
        self._before = self.values.copy(), self._tried.copy()
        self._leaves = [self.tree.leaf_of(observation.tolist())]

    def act(self) -> int:
        """Return the action of highest Q; optimism explores, so nothing is left to chance."""
        return self._greedy(self._leaves[-1])

    def observe(self, step: Step) -> None:
        """Take what came of an action, and update Q."""
        self._buffer.add(step)
        leaf = self.tree.leaf_of(step.observation.tolist())
        entered = None if step.terminated else leaf
        self._learn(self._leaves[-1], step.action, step.reward, entered)
        self._leaves.append(leaf)

    def end_episode(self) -> None:
        """Store the episode, whose last step was terminated or truncated."""
        episode = self._buffer.finish()
        store(self.history, episode, np.array(self._leaves, dtype=np.int32))
        self._remember_returns(episode)

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""
        if len(self._buffer):
            self.values, self._tried = self._before
            self._buffer.clear()

    def update(self, generator: np.random.Generator) -> Update:
        """Cut every leaf in two that has been visited often enough for its size."""
        made = []
        sizes = self._tried.sum(axis=1)
        wanted = self.method.first_split * 4.0 ** (self._depth / self.tree.n_features)
        for leaf in np.flatnonzero(sizes >= wanted).tolist():
            if leaf not in self._locked and len(self.values) < self.method.max_leaves:
                cut = self._cut_of(leaf)
                if cut is not None:
                    made.append(self._cut(leaf, *cut))
        self.tree = self.tree.split_each([(s.leaf, s.feature, s.threshold) for s in made])
        return Update(tuple(made))

    def decisions(self) -> Decisions:
        """Return the tree and the greedy action of each leaf."""
        actions = np.array([self._greedy(leaf) for leaf in range(self.tree.n_leaves)])
        values = np.where(self._tried > 0, self.values, np.nan)
        unknown = np.full(values.shape, np.nan)
        visits = np.zeros(
            values.shape, dtype=np.int64
        )  # halves of a leaf have its trials, not these
        np.add.at(visits, (self.history.left, self.history.actions), 1)
        statistics = LeafStatistics(visits, values, unknown)
        return Decisions(self.tree, actions, statistics, tuple(sorted(self._locked)))

    def state(self) -> Arrays:
        """Return all that is known between two episodes."""
        return arrays_of(self, self.method.parts)

    @property
    def _best(self) -> float:
        return float(self._seen[1])

    def _greedy(self, leaf: int) -> int:
        """Return the action of highest Q; one never tried has the best, the prior wins ties."""
        if leaf in self._locked:
            return int(self._prior[leaf])
        q = np.where(self._tried[leaf] > 0, self.values[leaf], self._best)
        prior = int(self._prior[leaf])
        return prior if q[prior] == q.max() else int(q.argmax())

    def _learn(self, leaf: int, action: int, reward: float, entered: int | None) -> None:
        """Update Q by one transition; ``entered`` is None at a terminal state."""
        method = self.method
        self._tried[leaf, action] += 1
        t = int(self._tried[leaf, action])
        value = 0.0
        if entered is not None:
            q = np.where(self._tried[entered] > 0, self.values[entered], self._best)
            value = min(self._best, float(q.max()))
        optimism = method.bonus * float(self._seen[1] - self._seen[0]) / np.sqrt(t)
        target = reward + optimism + method.discount * value
        alpha = (method.horizon + 1) / (method.horizon + t)
        self.values[leaf, action] += alpha * (target - self.values[leaf, action])

    def _remember_returns(self, episode: FinishedEpisode) -> None:
        """Widen the range of returns to go by those of an episode."""
        ahead = 0.0
        for reward in episode.rewards[::-1].tolist():
            ahead = reward + self.method.discount * ahead
            self._seen[0] = min(self._seen[0], ahead)
            self._seen[1] = max(self._seen[1], ahead)

    def _cut_of(self, leaf: int) -> tuple[int, float] | None:
        """Return feature and threshold of a leaf's cut; None where all its observations agree."""
        seen = self.history.observations[self.history.leaving.of(leaf)]
        if not len(seen):
            return None
        scale = step_scale(self.history.observations, self.history.next_observations)
        low, high = seen.min(axis=0), seen.max(axis=0)
        feature = int(((high - low) / scale).argmax())
        if not low[feature] < high[feature]:
            return None
        return feature, threshold_between(float(low[feature]), float(high[feature]))

    def _cut(self, leaf: int, feature: int, threshold: float) -> LeafSplit:
        """Cut a leaf in all but the tree; the halves take over its values and visits."""
        new_leaf = len(self.values)
        self.history.split(leaf, new_leaf, feature, threshold)
        self._depth[leaf] += 1
        self._depth = np.append(self._depth, self._depth[leaf])
        self._prior[leaf] = self._greedy(leaf)
        self._prior = np.append(self._prior, self._prior[leaf])
        self.values = np.concatenate([self.values, self.values[leaf : leaf + 1]])
        self._tried = np.concatenate([self._tried, self._tried[leaf : leaf + 1]])
        return LeafSplit(leaf, new_leaf, feature, threshold)
