"""The Continuous U-Tree (Table 1): a state tree, an MDP over its leaves, and the two phases.

Gathering: ``act`` chooses an action for an observation, ``observe`` takes what came of it, updates
Pr, R and Q and remembers the transition. Expansion: ``expand`` looks at each leaf for a cut across
which the distributions of q differ, splits where one does, and solves the MDP anew. The learner
never sees an environment: it takes transitions and returns actions.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.confidence import Confidence, doubt
from eutree.learners.foresight import Foresight
from eutree.learners.forgetting import Forgetting, LeafReservoirs, RecentEpisodes
from eutree.learners.history import TERMINAL, History
from eutree.learners.settings import Settings
from eutree.learners.solving import Solving
from eutree.learners.teaching import refined
from eutree.mdp import TabularMDP
from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.splitting import LeafSample, Split
from eutree.trees import DecisionTree
from eutree.trees.grafting import graft

_TREE_ARRAYS = ("feature", "threshold", "left", "right", "leaf")


@dataclass(frozen=True)
class LeafSplit:
    """A split that an expansion made: ``leaf`` kept the left side, ``new_leaf`` got the right."""

    leaf: int
    new_leaf: int
    split: Split


class UTree:
    """The learner of Table 1.

    Args:
        tree: The state tree to start from: a single leaf, or the expert tree's structure.
        n_actions: Number of actions A.
        settings: How to learn.
        inherited: Action of each leaf while nothing was tried in it: the expert's. The paper's
            settings value an untried action at 0, so there nothing is inherited.
        locked: Leaves that are never split and whose inherited action stays, without exploration.

    Attributes:
        tree: The present state tree; a value, so keeping a reference freezes it.
        history: All transitions stored so far.
        mdp: The MDP over the leaves (Eqs. 3 to 6).
        settings: How it learns.
        n_actions: Number of actions A.
    """

    def __init__(
        self,
        tree: DecisionTree,
        n_actions: int,
        settings: Settings,
        *,
        inherited: Integers | None = None,
        locked: Iterable[int] = (),
    ) -> None:
        self.tree = tree
        self.settings = settings
        rule = _forgetting(settings, tree.n_leaves, n_actions)
        self.history = History(tree.n_features, tree.n_leaves, rule)
        self.mdp = TabularMDP(
            tree.n_leaves,
            n_actions,
            settings.discount,
            untried=settings.untried_value,
        )
        self._solving = Solving(settings.solve_growth)
        self.n_actions = n_actions
        none = np.zeros(tree.n_leaves, dtype=np.int64)
        self._inherited = np.array(none if inherited is None else inherited)  # [L]
        self._tested_at = np.zeros(tree.n_leaves, dtype=np.int64)  # [L] seen at the last test
        self._locked = frozenset(locked)
        self._foresight = self._new_foresight(informed=inherited is not None)
        self._steps: list[tuple[Floats, int, float]] = []
        self._leaves: list[int] = []
        self._shown: list[bool] = []
        self._lessons = np.empty((0, tree.n_features))  # where something was shown of late

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all that the learner knows, between two episodes; ``from_state`` takes it back."""
        tree = {name: getattr(self.tree, name) for name in _TREE_ARRAYS}
        history = {f"history_{k}": v for k, v in self.history.state().items()}
        mdp = {f"mdp_{k}": v for k, v in self.mdp.state().items()}
        own: dict[str, NDArray[Any]] = {"tested_at": self._tested_at, "inherited": self._inherited}
        if len(self._lessons):
            own["lessons"] = self._lessons
        if self._locked:
            own["locked"] = np.array(sorted(self._locked))
        if self._foresight is None:
            return {**tree, **history, **mdp, **own, **self._solving.state()}
        plan = self._foresight.state()
        return {**tree, **history, **mdp, **own, **{f"plan_{k}": v for k, v in plan.items()}}

    @classmethod
    def from_state(
        cls, state: Mapping[str, NDArray[Any]], n_actions: int, settings: Settings
    ) -> "UTree":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        n_features = state["history_observations"].shape[1]
        tree = DecisionTree(n_features, **{name: state[name] for name in _TREE_ARRAYS})
        locked = state["locked"].tolist() if "locked" in state else ()
        learner = cls(tree, n_actions, settings, inherited=state["inherited"], locked=locked)
        rule = _forgetting(settings, tree.n_leaves, n_actions)
        learner.history = History.from_state(_part(state, "history_"), tree, rule)
        history = learner.history
        learner.mdp.observe_batch(history.left, history.actions, history.rewards, history.entered)
        learner.mdp.restore(_part(state, "mdp_"))
        learner._tested_at = np.array(state["tested_at"])
        learner._lessons = np.array(state.get("lessons", learner._lessons))
        if "solved_at" in state:
            learner._solving.solved_at = int(state["solved_at"][0])
        if learner._foresight is not None:
            learner._foresight.restore(_part(state, "plan_"))
        return learner

    def add_demonstrations(self, episodes: Iterable[Episode]) -> None:
        """Store the expert's transitions and solve the MDP for the first Q-table."""
        for episode in episodes:
            self.history.append_episode(
                episode.observations,
                episode.actions,
                episode.rewards,
                self.tree.leaf_index(episode.observations),
                terminated=episode.terminated,
                demonstrated=True,
            )
            self.history.forget()
        self._count_again()
        self._solving.solve(self.mdp, self.history)
        if self._foresight is not None:
            self._foresight.add_demonstrations(self.history.n_episodes)

    def begin_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Start an episode at its first observation, shape [d].

        All randomness of the episode comes from ``generator``, so a learner has no random state
        of its own between episodes.
        """
        self._steps.clear()
        self._shown.clear()
        self.mdp.savepoint()
        if self.settings.max_transitions is not None:
            self._rewards_before = self.mdp.reward_sums.copy()
        self._generator = generator
        self._first = observation
        if self._foresight is not None:
            self._foresight.begin_episode(self.settings.exploration, generator)
        self._leaves = [self.tree.leaf_of(observation.tolist())]

    def act(self) -> int:
        """Choose the action for the present observation: greedy (Eq. 1), random with epsilon."""
        if self._leaves[-1] in self._locked:
            return int(self._inherited[self._leaves[-1]])
        if self._foresight is not None:
            return self._foresight.act(self._steps[-1][0] if self._steps else self._first)
        if self._generator.random() < self.settings.exploration:
            return int(self._generator.integers(self.n_actions))
        return self._greedy(self._leaves[-1])

    def unsure(self, observation: Floats, confidence: Confidence) -> str:
        """Return why the learner would rather be shown what to do at ``observation``, or "".

        See :mod:`eutree.learners.confidence`. Nothing of the learner changes.
        """
        leaf = self.tree.leaf_of(observation.tolist())
        if leaf in self._locked:
            return ""
        rows = self.history.rows_leaving(leaf)
        returns, actions = self.targets(rows), self.history.actions[rows]
        best = self._greedy(leaf)
        return doubt(returns, actions.astype(np.int64), best, self.n_actions, confidence)

    def observe(
        self,
        action: int,
        reward: float,
        observation: Floats,
        *,
        terminated: bool,
        truncated: bool,
        shown: bool = False,
    ) -> None:
        """Take one transition from the present observation; store the episode at its end.

        ``shown`` marks the action as somebody else's: a demonstration.

        Updates Pr, R and Q by prioritized sweeping. A truncated episode is not a terminal one:
        its last transition enters the leaf of the last observation.
        """
        leaf = self.tree.leaf_of(observation.tolist())
        entered = TERMINAL if terminated else leaf
        self.mdp.observe(self._leaves[-1], action, reward, entered, self.settings.backups)
        self._steps.append((observation, action, reward))
        self._leaves.append(leaf)
        self._shown.append(shown)
        if terminated or truncated:
            self._end_episode(terminated=terminated)

    def abort_episode(self) -> None:
        """Forget the episode that is under way; the learner is as it was before it, to the bit."""
        if not self._steps:
            return
        states, entered = self._leaves[:-1], self._leaves[1:]
        actions = [action for _, action, _ in self._steps]
        rewards = [reward for _, _, reward in self._steps]
        self.mdp.forget_batch(states, actions, rewards, entered)
        self.mdp.rollback()
        self._steps.clear()

    def expand(self, generator: np.random.Generator) -> tuple[LeafSplit, ...]:
        """Split every leaf that deserves it, and solve the MDP (Table 1, expansion phase).

        Only leaves that exist when the phase begins are tested. ``generator`` serves permutation
        tests.
        """
        if self._steps:
            raise InvalidArgumentError("expand must be called between episodes, not within one")
        self._learn_from_shown()
        if self._foresight is not None:
            if self._foresight.think(self.history, generator):
                self._replace_tree(*self._foresight.policy())
            return ()
        made = []
        for leaf in self._due():
            split = self._split_of(leaf, generator)
            if split is not None:
                made.append(self._split(leaf, split))
                if self.settings.solve_each_split:
                    self._solving.solve(self.mdp, self.history)
        self._grow_tree(made)
        halves = [leaf for one in made for leaf in (one.leaf, one.new_leaf)]
        self._solving.after_splits(self.mdp, self.history, halves)
        return tuple(made)

    def greedy_actions(self) -> Int32s:
        """Return the action of each leaf (Eq. 1, or the plan's), shape [L]."""
        if self._foresight is not None:
            return self._inherited.astype(np.int32)
        values = self.mdp.action_values
        known = ~np.isnan(values)
        best = np.where(known, values, -np.inf).argmax(axis=1)
        learned = np.array(known.any(axis=1))
        learned[list(self._locked)] = False
        return np.where(learned, best, self._inherited).astype(np.int32)

    def targets(self, rows: Integers) -> Floats:
        """Return q of the stored transitions ``rows`` (Eq. 2), shape [n]."""
        return self.settings.target.of(
            self.history,
            rows,
            values=self.mdp.values,
            greedy=self.greedy_actions,
            discount=self.settings.discount,
        )

    def policy(
        self, schema: Schema, environment: EnvironmentSpec | None = None, *, history: int = 0
    ) -> TreePolicy:
        """Return the present policy, frozen.

        Args:
            schema: Names of the tree's features and of the actions.
            environment: The environment it is for.
            history: Number of previous observations among the features.
        """
        return TreePolicy(
            tree=self.tree,
            actions=self.greedy_actions().astype(np.int64),
            schema=schema,
            environment=environment,
            history=history,
            leaves=self._statistics(),
            locked=tuple(sorted(self._locked)),
        )

    def _greedy(self, leaf: int) -> int:
        """Return the action of one leaf; the same rule as ``greedy_actions``, for a single step."""
        best, best_value = -1, -np.inf
        for action, value in enumerate(self.mdp.action_values[leaf].tolist()):
            if value > best_value:
                best, best_value = action, value
        return best if best >= 0 else int(self._inherited[leaf])

    def _due(self) -> list[int]:
        """Return the leaves to test now: those that have grown enough since they were tested."""
        sizes = self.history.seen_leaving()[: self.tree.n_leaves]
        growth = self.settings.retest_growth
        due = (sizes >= self._tested_at * growth) | (growth == 1.0)  # an estimate may fall
        due[list(self._locked)] = False
        self._tested_at[due] = sizes[due]
        leaves: list[int] = np.flatnonzero(due).tolist()
        return leaves

    def _split_of(self, leaf: int, generator: np.random.Generator) -> Split | None:
        """Return the split that ``leaf`` deserves, or None."""
        sample = self._sample(leaf)
        split = self.settings.splitter.best(sample)
        if split is None:
            return None
        significance = self.settings.significance
        p = significance.p_value(split, sample, self.settings.splitter, generator)
        if p > significance.alpha:
            return None
        keeps = self.settings.gate.keeps(split, sample, action=self._greedy(leaf))
        return split if keeps else None

    def _sample(self, leaf: int) -> LeafSample:
        rows = self.history.rows_leaving(leaf)
        return LeafSample(
            observations=self.history.observations[rows],
            returns=self.targets(rows),
            actions=self.history.actions[rows].astype(np.int64),
            episodes=self.history.episodes[rows].astype(np.int64),
        )

    def _split(self, leaf: int, split: Split) -> LeafSplit:
        """Split ``leaf`` in all but the tree; relabel its transitions and recount just those."""
        greedy = self._greedy(leaf)
        new_leaf = self.mdp.add_state(float(self.mdp.values[leaf]))
        moved = self.history.split(leaf, new_leaf, split.feature, split.threshold)
        actions = self.history.actions
        self.mdp.relabel(
            actions[moved.rows],
            states=moved.old_left,
            next_states=moved.old_entered,
            new_states=moved.new_left,
            new_next_states=moved.new_entered,
        )
        rows = moved.leaving
        self.mdp.set_rewards(
            [leaf, new_leaf], self.history.left[rows], actions[rows], self.history.rewards[rows]
        )
        self._inherited[leaf] = greedy
        self._inherited = np.append(self._inherited, greedy)
        self._tested_at = np.append(self._tested_at, 0)
        self._tested_at[leaf] = 0
        return LeafSplit(leaf, new_leaf, split)

    def _grow_tree(self, made: Sequence[LeafSplit]) -> None:
        """Split the tree's leaves too: all at once, since a tree is a value."""
        cuts = [(one.leaf, one.split.feature, one.split.threshold) for one in made]
        self.tree = self.tree.split_each(cuts)

    def _end_episode(self, *, terminated: bool) -> None:
        leaves = np.array(self._leaves, dtype=np.int32)
        actions = np.array([step[1] for step in self._steps], dtype=np.int64)
        rewards = np.array([step[2] for step in self._steps])
        observations = np.concatenate([self._first, *(step[0] for step in self._steps)])
        stored = self.history.append_episode(
            observations.reshape(len(leaves), -1),
            actions,
            rewards,
            leaves,
            terminated=terminated,
            generator=self._generator,
            demonstrated=np.array(self._shown, dtype=np.bool_),
        )
        self._remember_lessons()
        self._steps.clear()
        if self._foresight is not None:
            self._foresight.end_episode(self.history.n_episodes - 1, shown=any(self._shown))
        if not stored.all():
            entered = np.append(leaves[1:-1], TERMINAL if terminated else leaves[-1])
            self._uncount(leaves[:-1], actions, rewards, entered, stored)
        self._forget()

    def _uncount(
        self, left: Int32s, actions: Integers, rewards: Floats, entered: Integers, stored: Booleans
    ) -> None:
        """Take back the counts of those transitions of the last episode that were not stored."""
        out = ~stored
        self.mdp.forget_batch(left[out], actions[out], rewards[out], entered[out])
        state = self.mdp.state()
        state["reward_sums"] = self._rewards_before  # to the bit: as if never added
        np.add.at(state["reward_sums"], (left[stored], actions[stored]), rewards[stored])
        self.mdp.restore(state)

    def _forget(self) -> None:
        """Forget what the history holds too much; count what is left."""
        kept = self.history.forget()
        if kept is None:
            return
        if self._foresight is not None:
            self._foresight.keep(kept)
        self._count_again()

    def _count_again(self) -> None:
        """Count the stored transitions (Eqs. 3, 4); V, Q and the queue stay."""
        state = self.mdp.state()
        self.mdp = self._counted()
        self.mdp.restore(state | {"reward_sums": self.mdp.reward_sums.copy()})

    def _counted(self) -> TabularMDP:
        """Return the MDP of the stored transitions (Eqs. 3, 4), not solved."""
        settings, history = self.settings, self.history
        mdp = TabularMDP(
            self.tree.n_leaves, self.n_actions, settings.discount, untried=settings.untried_value
        )
        mdp.observe_batch(history.left, history.actions, history.rewards, history.entered)
        return mdp

    def _remember_lessons(self) -> None:
        """Remember where in the episode somebody showed what to do, until the next expansion."""
        if not any(self._shown):
            return
        observations = [self._first, *(step[0] for step in self._steps[:-1])]
        seen = zip(observations, self._shown, strict=True)
        shown = [observation for observation, is_shown in seen if is_shown]
        self._lessons = np.concatenate([self._lessons, shown])

    def _learn_from_shown(self) -> None:
        """Refine the leaves in which something was shown since the last time."""
        if not len(self._lessons):
            return
        lessons, self._lessons = self._lessons, self._lessons[:0]
        history = self.history
        rows = history.demonstrated
        lately = set(self.tree.leaf_index(lessons).tolist()) - self._locked
        leaves = np.array(sorted(lately & set(history.left[rows].tolist())), dtype=np.int64)
        if not leaves.size:
            return
        tree, actions = refined(
            self.tree,
            self.greedy_actions().astype(np.int64),
            history.observations[rows],
            history.actions[rows].astype(np.int64),
            self.n_actions,
            leaves=leaves,
        )
        if self._foresight is None:
            self._replace_tree(tree, actions)
        else:
            self._foresight.teach(tree, actions)

    def _new_foresight(self, *, informed: bool) -> Foresight | None:
        imagination = self.settings.imagination
        if imagination is None:
            return None
        return Foresight(imagination, self.tree, self._inherited, self.n_actions, informed=informed)

    def _replace_tree(self, tree: DecisionTree, actions: Integers) -> None:
        """Take another state tree; label all transitions anew and count them (Eqs. 3, 4).

        What is locked in the present one is kept: the new tree stands in for the rest.
        """
        if self._locked:
            kept = {leaf: int(self._inherited[leaf]) for leaf in self._locked}
            tree, actions, self._locked = graft(self.tree, kept, tree, actions)
        self.tree, self._inherited = tree, actions
        self._tested_at = np.zeros(tree.n_leaves, dtype=np.int64)
        self.history.relabel(tree)
        self.mdp = self._counted()
        self._solving.solve(self.mdp, self.history)

    def _statistics(self) -> LeafStatistics:
        """Return visits, Q and its standard error for each leaf and action."""
        shape = (self.tree.n_leaves, self.n_actions)
        visits = self.mdp.visits
        deviations = np.full(shape, np.nan)
        for leaf in range(self.tree.n_leaves):
            rows = self.history.rows_leaving(leaf)
            returns, actions = self.targets(rows), self.history.actions[rows]
            for action in range(self.n_actions):
                mine = returns[actions == action]
                if mine.size > 1:
                    deviations[leaf, action] = mine.std(ddof=1) / np.sqrt(mine.size)
        values = np.where(visits > 0, self.mdp.action_values, np.nan)
        return LeafStatistics(visits, values, deviations)


def _forgetting(settings: Settings, n_leaves: int, n_actions: int) -> Forgetting | None:
    """Return what a learner of these settings forgets by: a planner needs whole episodes."""
    if settings.max_transitions is None:
        return None
    if settings.imagination is not None:
        return RecentEpisodes(settings.max_transitions)
    return LeafReservoirs(settings.max_transitions, n_leaves, n_actions)


def _part(state: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, NDArray[Any]]:
    """Return the entries whose names begin with ``prefix``, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
