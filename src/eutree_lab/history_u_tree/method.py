"""McCallum's U-Tree (1996) on continuous and discrete percepts: memory as distinctions.

U-Tree grows a tree whose tests may look back: at a feature of the percept h steps ago, or at the
action taken then. With thresholds for distinctions that is the Continuous U-Tree on the stacked
features of a :class:`eutree.features.FeatureMap`, and this is all it is made of, plus one thing: a
*fringe* deeper than one level. No single cut can show a distinction that takes two tests (the
exclusive or of two past percepts). A fringe of depth 2 tries a cut that shows nothing by itself,
and looks below it; the chance of finding something in so many places is allowed for.

With no previous observations, no previous actions and a fringe of depth 1 it is the Continuous
U-Tree, byte for byte.

A memory multiplies the leaves, and each of them has few transitions. With ``evidence`` a leaf keeps
its action until another one is significantly better (:mod:`eutree_lab.history_u_tree.evidence`).

*Copying.* An expert's actions come in runs. C4.5 that may look at the last action learns to repeat
it, is right almost always, and fails at the one moment that counts (de Haan et al. 2019). So the
expert tree is made of observations alone; only the learner's own distinctions see actions.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError
from eutree.features import FeatureMap, threshold_between
from eutree.learners import (
    Decisions,
    History,
    Needs,
    Part,
    Problem,
    Start,
    Step,
    Stored,
    Update,
    UTree,
    UTreeMethod,
)
from eutree.learners.declared import Declared, give_back
from eutree.learners.learner import Arrays
from eutree.policies import TreePolicy
from eutree.splitting import (
    KolmogorovSmirnov,
    LeafSample,
    Maximal,
    Permutation,
    SignificanceTest,
    Split,
)
from eutree.splitting.significance import sidak
from eutree.trees import DecisionTree
from eutree.validation import check_integer, check_number
from eutree_lab.history_u_tree.evidence import EvidentUTree

PERMUTED = Permutation(alpha=0.01)
MOST_FIRST = 8  # continuous features whose best cuts a fringe of depth 2 looks below


@dataclass(frozen=True, kw_only=True)
class HistoryUTreeMethod(UTreeMethod):
    """The choices of the Continuous U-Tree, and of its memory.

    Attributes:
        history: Number of previous observations among the features.
        past_actions: Number of previous actions among the features.
        fringe: Depth of the fringe, 1 or 2.
        evidence: Standard errors by which another action must be better before it takes the place
            of the one that a leaf keeps (:mod:`eutree_lab.history_u_tree.evidence`); None takes
            the greedy action, as published.
    """

    name: ClassVar[str] = "history-u-tree"
    needs: ClassVar[Needs] = Needs(keeps_locks=True)

    splitter: KolmogorovSmirnov = KolmogorovSmirnov(
        score="calibrated", compare="action", min_leaf=10
    )
    significance: SignificanceTest = PERMUTED
    solve_each_split: bool = False
    solve_growth: float = 1.1
    retest_growth: float = 1.5
    untried_value: float | None = None
    history: int = 1
    past_actions: int = 1
    fringe: int = 2
    evidence: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("history", self.history, low=0)
        check_integer("past_actions", self.past_actions, low=0)
        check_integer("fringe", self.fringe, low=1, high=2)
        if self.evidence is not None:
            check_number("evidence", self.evidence, low=0.0)

    def cut(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the best cut of a leaf if it, or one just below it, is significant."""
        split = super().cut(sample, generator)
        if split is not None or self.fringe == 1:
            return split
        return self._cut_above(sample, generator)

    def start(self, problem: Problem, start: Start) -> "HistoryUTree":  # type: ignore[override]  # it wraps the tree
        """Return the learner at its start; an expert tree sees no previous actions."""
        features = self.features(problem)
        episodes = tuple(episode.with_features(features) for episode in start.episodes)
        expert = None if start.expert is None else _widened(start.expert, features)
        stacked = replace(start, expert=expert, episodes=episodes)
        return HistoryUTree(self._kind.begun(self._stacked(problem), stacked, self), features)

    def restore(self, problem: Problem, start: Start, state: Arrays) -> "HistoryUTree":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        learner = self.start(problem, replace(start, episodes=()))
        give_back(learner.tree, self.parts, state)
        return learner

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return the declaration of a ``state()``, in the features of present and past."""
        return super().declared(self._stacked(problem), start)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of a learner's state."""
        return super().parts if self.evidence is None else (*super().parts, _KEPT)

    def features(self, problem: Problem) -> FeatureMap:
        """Return how a problem's observations and actions become features."""
        if past := problem.history or problem.past_actions:
            raise InvalidArgumentError(
                f"history must be 0 with method {self.name!r}, which remembers by itself as its "
                f"settings history and past_actions say, got {past}"
            )
        return FeatureMap(
            n_observed=problem.n_features,
            n_actions=problem.n_actions,
            observations=self.history,
            actions=self.past_actions,
        )

    @property
    def _kind(self) -> type[UTree]:
        return UTree if self.evidence is None else EvidentUTree

    def _stacked(self, problem: Problem) -> Problem:
        schema = problem.schema.with_history(self.history, self.past_actions)
        return replace(problem, schema=schema)

    def _cut_above(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the cut below which another one is significant, allowing for all that were tried.

        The law of the maximum is tabulated, so a level of any size can be asked of it.
        """
        test = Maximal(alpha=self.significance.alpha)
        best, p_best, tried = None, 1.0, 0
        for first in self._first_cuts(sample):
            for side in (False, True):
                inside = (sample.observations[:, first.feature] > first.threshold) == side
                below = _part(sample, inside)
                tried += 1
                second = self.splitter.best(below)
                if second is None:
                    continue
                p = test.p_value(second, below, self.splitter, generator)
                if p < p_best:
                    best, p_best = first, p
        return best if best is not None and sidak(p_best, tried) <= test.alpha else None

    def _first_cuts(self, sample: LeafSample) -> Iterator[Split]:
        """Yield cuts to look below: of features of two values all, of others the best few."""
        found: list[Split] = []
        for feature in range(sample.observations.shape[1]):
            values = np.unique(sample.observations[:, feature])
            if values.size == 2:
                yield _cut_between(sample, feature, values)
            elif values.size > 2:
                column = replace(sample, observations=sample.observations[:, [feature]].copy())
                split = self.splitter.best(column)
                if split is not None:
                    found.append(replace(split, feature=feature))
        found.sort(key=lambda split: -self.splitter.value(split))
        yield from found[:MOST_FIRST]


_KEPT = Part({"kept_values": Stored("f8", "L", at="_values")})


class HistoryUTree:
    """A Continuous U-Tree that is fed the present and the past.

    Args:
        tree: The Continuous U-Tree over the stacked features.
        features: How observations and actions become these features.

    Attributes:
        tree: The Continuous U-Tree.
    """

    def __init__(self, tree: UTree, features: FeatureMap) -> None:
        self.tree = tree
        self._features = features

    @property
    def history(self) -> History:
        """The store of all transitions, of stacked features."""
        return self.tree.history

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; nothing was done before."""
        self._seen = self._features.first(observation)
        self.tree.start_episode(self._seen, generator)

    def act(self) -> int:
        """Return the action for the present features."""
        return self.tree.act()

    def observe(self, step: Step) -> None:
        """Take what came of an action."""
        self._seen = self._features.next(self._seen, step.action, step.observation)
        self.tree.observe(step._replace(observation=self._seen))

    def end_episode(self) -> None:
        """Store the episode, whose last step was terminated or truncated."""
        self.tree.end_episode()

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""
        self.tree.discard_episode()

    def update(self, generator: np.random.Generator) -> Update:
        """Split leaves by distinctions of the present and the past."""
        return self.tree.update(generator)

    def decisions(self) -> Decisions:
        """Return the tree, whose features are the present and the past."""
        return replace(self.tree.decisions(), features=self._features)

    def state(self) -> Arrays:
        """Return all that is known between two episodes."""
        return self.tree.state()


def _widened(expert: TreePolicy, features: FeatureMap) -> TreePolicy:
    """Return an expert tree of single observations as one over the stacked features.

    These begin with the observation, so its tests are the same.
    """
    tree = DecisionTree(
        features.n_features,
        feature=expert.tree.feature,
        threshold=expert.tree.threshold,
        left=expert.tree.left,
        right=expert.tree.right,
        leaf=expert.tree.leaf,
    )
    schema = expert.schema.with_history(features.observations, features.actions)
    return replace(
        expert,
        tree=tree,
        schema=schema,
        history=features.observations,
        past_actions=features.actions,
    )


def _cut_between(sample: LeafSample, feature: int, values: Floats) -> Split:
    """Return the cut between the two values of a feature; it need not tell returns apart."""
    left, right = values.tolist()
    n_left = int((sample.observations[:, feature] == left).sum())
    return Split(
        feature=feature,
        threshold=threshold_between(left, right),
        statistic=0.0,
        scaled_statistic=0.0,
        n_left=n_left,
        n_right=len(sample.returns) - n_left,
    )


def _part(sample: LeafSample, rows: Booleans) -> LeafSample:
    """Return some of a leaf's tuples."""
    return LeafSample(
        observations=sample.observations[rows],
        returns=sample.returns[rows],
        actions=sample.actions[rows],
        episodes=None if sample.episodes is None else sample.episodes[rows],
    )
