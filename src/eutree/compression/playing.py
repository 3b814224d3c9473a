"""Common episodes of many trees in an environment, of which only those are run that differ.

All chance of an episode comes from its seed. So a tree that differs from another in one region
earns the same in every episode that does not visit it, and of those the other has run nothing has
to be run again: only episodes in which the recorded observations would be answered differently are.
Where the environment has a vector form, episodes of many trees run side by side in it; else they
are divided among processes.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.evaluation import Evaluation
from eutree.evaluation.evaluate import run_batch, same_parameters, vector_form
from eutree.evaluation.evaluation import Earned
from eutree.interaction import episode_seed
from eutree.interaction.episode import RunPairs, Stream, run_pairs
from eutree.interaction.making import Recipe
from eutree.parallel import Workers
from eutree.policies import TreePolicy

if TYPE_CHECKING:
    from eutree.world_model.rollouts import Gain

Move = tuple[int, float]  # a node, and its new threshold

COPIES = 4096  # episodes side by side
SCREENED = 4  # of so many starts one is enough to see that a change does harm
FAILURE = 0.2  # of the range of returns, that a failed episode costs beside its return


@dataclass(frozen=True, eq=False)
class Outcome(Earned):
    """The returns and successes of a tree from common starts."""

    returns: Floats  # [E]
    successes: Booleans | None  # [E]


class _Traces(NamedTuple):
    """Each step of the present tree's episodes, in any order."""

    features: Floats  # [N, d]
    actions: Integers  # [N]
    episode: Integers  # [N]


class _Forest:
    """Many trees as one policy of a batch: copy e decides by tree ``which[e]``."""

    def __init__(self, trees: Sequence[TreePolicy], which: Integers) -> None:
        sizes = [one.tree.n_nodes for one in trees]
        begin = np.cumsum([0, *sizes[:-1]])
        self._map = trees[0].features
        self._root, shift = begin[which], begin.repeat(sizes)
        self._depth = max(one.tree.depth for one in trees)
        feature, self._threshold, left, right = (
            np.concatenate([getattr(one.tree, name) for one in trees])
            for name in ("feature", "threshold", "left", "right")
        )
        ends, own = feature < 0, np.arange(feature.size)  # a leaf leads to itself
        self._feature = np.where(ends, 0, feature)
        self._left, self._right = (np.where(ends, own, side + shift) for side in (left, right))
        self._action = np.concatenate([one.actions[one.tree.leaf] for one in trees])
        self.features: list[Floats] = []  # of each step, [E, d]
        self.actions: list[Integers] = []  # [E]

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Integers, Any]:
        if not self.features:
            features = self._map.first(observation)
        else:
            features = self._map.next(self.features[-1], self.actions[-1], observation)
        node, row = self._root, np.arange(len(features))
        for _ in range(self._depth):
            goes_left = features[row, self._feature[node]] <= self._threshold[node]
            node = np.where(goes_left, self._left[node], self._right[node])
        self.features.append(features)
        self.actions.append(self._action[node])
        return self.actions[-1], state

    def traces(self, lengths: Integers, episodes: Integers) -> _Traces:
        """Return the steps before each episode's end."""
        alive = np.arange(len(self.features))[:, np.newaxis] < lengths  # [T, E]
        episode = np.broadcast_to(episodes, alive.shape)[alive]
        features, actions = np.array(self.features)[alive], np.array(self.actions)[alive]
        return _Traces(features, actions, episode)


@dataclass(eq=False)
class Ground:
    """The place where trees play, and how much they did."""

    env: gymnasium.Env[Any, Any]
    seed: int  # seed of all its episodes
    recipe: Recipe | None = None  # how other processes make it; None keeps all episodes in this one
    n_jobs: int | None = None  # processes, as joblib counts them
    stream: Stream = Stream.COMPRESSION
    steps: int = 0  # of the environment, so far
    episodes: int = 0  # so far
    _seeds: dict[int, int] = field(default_factory=dict, repr=False)

    @property
    def side_by_side(self) -> bool:
        """Whether the environment has a vector form with the same episodes."""
        return vector_form(self.env) is not None

    def play(
        self, trees: Sequence[TreePolicy], which: Integers, starts: Integers
    ) -> tuple[Outcome, _Traces]:
        """Return the outcome of each pair [P] of numbers, of a tree and a start, and its steps."""
        parts = []
        for start in set(starts.tolist()) - self._seeds.keys():
            self._seeds[start] = episode_seed(self.seed, start, self.stream)
        seeds = [self._seeds[start] for start in starts.tolist()]
        for first in range(0, len(seeds), COPIES):
            pairs = slice(first, first + COPIES)
            parts.append(self._batch(trees, which[pairs], seeds[pairs], first))
        outcomes, traces = zip(*parts, strict=True)
        self.steps += sum(len(one.actions) for one in traces)
        self.episodes += len(seeds)
        unknown = all(one.successes is None for one in outcomes)
        known = None if unknown else np.concatenate([one.counted_successes for one in outcomes])
        outcome = Outcome(np.concatenate([one.returns for one in outcomes]), known)
        return outcome, _Traces(*map(np.concatenate, zip(*traces, strict=True)))

    def _batch(
        self, trees: Sequence[TreePolicy], which: Integers, seeds: list[int], first: int
    ) -> tuple[Outcome, _Traces]:
        make = vector_form(self.env)
        vector = None if make is None else make(len(seeds))
        if vector is None or not same_parameters(vector, self.env):
            return self._divided(trees, which, seeds, first)
        forest = _Forest(trees, which)
        found = run_batch(forest, vector, seeds)
        if found is None:
            return self._divided(trees, which, seeds, first)
        traces = forest.traces(found.lengths, first + np.arange(len(seeds)))
        return Outcome(found.returns, found.successes), traces

    def _divided(
        self, trees: Sequence[TreePolicy], which: Integers, seeds: list[int], first: int
    ) -> tuple[Outcome, _Traces]:
        """Run episodes one by one, in blocks of which each process runs some."""
        pairs = [(trees[one], seed) for one, seed in zip(which.tolist(), seeds, strict=True)]
        if self.recipe is None:
            episodes = run_pairs(self.env, pairs)
        else:
            episodes = RunPairs(self.recipe).over(Workers(self.n_jobs), pairs, 256)
        found = Evaluation.of(episodes)
        features = [
            tree.features.of_episode(one.observations, one.actions)[:-1]
            for (tree, _), one in zip(pairs, episodes, strict=True)
        ]
        return (
            Outcome(found.returns, found.successes),
            _Traces(
                np.concatenate(features),
                np.concatenate([one.actions for one in episodes]),
                np.repeat(first + np.arange(len(seeds)), [len(one) for one in episodes]),
            ),
        )


class PairedEpisodes(ABC):
    """Episodes of a present tree from common starts, and those of challengers beside it."""

    present: TreePolicy  # the tree that ran last
    returns: Floats  # [E]; the return of each of its episodes
    features: Floats  # [N, d]; the features at steps of its episodes
    scale: float | None = None  # width of the range of the first tree's returns

    @property
    @abstractmethod
    def steps(self) -> int:
        """Steps so far."""

    @property
    def mean_return(self) -> float:
        """Mean return of the present tree."""
        return float(self.returns.mean())

    def redraw(self, tree: TreePolicy) -> None:
        """Let a tree run from starts that no tree has seen."""
        self._draw()
        self.run(tree)

    def run(self, tree: TreePolicy) -> None:
        """Let a tree run from the present starts."""
        self.present = tree
        self._play(tree)
        if self.scale is None:
            self.scale = float(np.ptp(self.returns))

    @abstractmethod
    def _draw(self) -> None:
        """Take other starts."""

    @abstractmethod
    def _play(self, tree: TreePolicy) -> None:
        """Set returns and features to those of a tree."""

    @abstractmethod
    def gains(
        self, challengers: Sequence[TreePolicy], *, few: bool = False, above: float = -np.inf
    ) -> "list[Gain]":
        """Return the gains of challengers over the present tree.

        A few of the starts are enough to see that a change does harm. A gain that is not ``above``
        is hopeless, and may be given up early.
        """

    def gains_of_moves(self, moves: Sequence[Move], *, few: bool = False) -> "list[Gain]":
        """Return the gains of moved thresholds, each alone, over the present tree."""
        return self.gains([moved(self.present, *one) for one in moves], few=few)


class CommonEpisodes(PairedEpisodes):
    """Episodes in an environment; none is given up, and few are a quarter of the starts."""

    outcome: Outcome  # the returns and successes of the present tree
    traces: _Traces  # each step of its episodes

    def __init__(self, ground: Ground, n: int, first: int = 0) -> None:
        self.ground = ground
        self.n = n  # starts of a draw
        self._begin = first - n

    @property
    def steps(self) -> int:
        """Environment steps so far."""
        return self.ground.steps

    def _draw(self) -> None:
        self._begin += self.n

    def _play(self, tree: TreePolicy) -> None:
        starts = self._begin + np.arange(self.n)
        self.outcome, self.traces = self.ground.play([tree], np.zeros(self.n, np.intp), starts)
        self.returns, self.features = self.outcome.returns, self.traces.features

    def worth(self, outcome: Outcome) -> Floats:
        """Return the worth of each episode: its return, less a price where it failed, [E]."""
        if outcome.successes is None and self.outcome.successes is None:
            return outcome.returns
        return outcome.returns - FAILURE * (self.scale or 0.0) * ~outcome.counted_successes

    def gains(
        self, challengers: Sequence[TreePolicy], *, few: bool = False, above: float = -np.inf
    ) -> "list[Gain]":
        """Return the gains of challengers over the present tree."""
        n = self.n // SCREENED if few else self.n
        own = self.worth(self.outcome)[:n]
        found = (self.worth(one) - own for one in self.outcomes(challengers, n))
        from eutree.world_model.rollouts import Gain

        return [Gain(float(g.mean()), float(g.std() / np.sqrt(n)), True) for g in found]

    def outcomes(self, challengers: Sequence[TreePolicy], n: int | None = None) -> list[Outcome]:
        """Return the outcomes of challengers from the first ``n`` of the present starts."""
        n = n or self.n
        touched = [self._departs(challenger, n) for challenger in challengers]
        which = np.repeat(np.arange(len(challengers)), [one.size for one in touched])
        own, counted = self.outcome, self.outcome.counted_successes
        played, episodes = Outcome(np.empty(0), None), np.empty(0, np.intp)
        if which.size:
            episodes = np.concatenate(touched)
            played, _ = self.ground.play(challengers, which, self._begin + episodes)
        found = []
        for number in range(len(challengers)):
            mine = which == number
            returns, successes = self.returns[:n].copy(), counted[:n].copy()
            returns[episodes[mine]] = played.returns[mine]
            successes[episodes[mine]] = played.counted_successes[mine]
            # Where successes alone are reported, an episode that says nothing was none.
            silent = mine.any() and played.successes is None and not successes.any()
            unknown = silent or own.successes is None
            found.append(Outcome(returns, None if unknown else successes))
        return found

    def _departs(self, challenger: TreePolicy, n: int) -> Integers:
        """Return the episodes in which a challenger does not do the same throughout."""
        traces = self.traces
        if challenger.features != self.present.features:  # it remembers more, or less
            return np.arange(n)
        other = challenger.actions[challenger.tree.leaf_index(traces.features)] != traces.actions
        episodes = np.unique(traces.episode[other])
        return episodes[episodes < n]


def moved(policy: TreePolicy, node: int, at: float) -> TreePolicy:
    """Return the tree with another threshold at a node."""
    threshold = policy.tree.threshold.copy()
    threshold[node] = at
    tree = replace(policy.tree, threshold=threshold)
    return replace(policy, tree=tree, leaves=None, ranks=None, locked=())
