"""The Continuous U-Tree: Table 1 of the paper, and nothing else.

*Gathering.* ``act`` chooses an action for an observation, ``observe`` takes its outcome and updates
Pr, R and Q (Eqs. 3 to 6), ``end_episode`` stores the transitions.

*Expansion.* ``update`` looks at each leaf for the cut across which the distributions of q (Eq. 2)
differ most, splits where the difference is significant, and solves the MDP over the leaves.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.declared import (
    LOCKED_PART,
    MOST,
    TREE_PART,
    Found,
    Part,
    Stored,
    arrays_of,
    bounds_part,
    history_parts,
)
from eutree.learners.episode_buffer import random_action, store
from eutree.learners.forgetting import LeafReservoirs
from eutree.learners.history import History
from eutree.learners.learner import (
    Arrays,
    Decisions,
    LeafSplit,
    MethodOfParts,
    Needs,
    Problem,
    Start,
    Step,
    Update,
)
from eutree.learners.u_tree.leaves import LeafEpisode, LeafSteps, OneStep, Target
from eutree.mdp import TabularMDP, TransitionCounts
from eutree.policies.leaf_statistics import leaf_statistics
from eutree.splitting import KolmogorovSmirnov, LeafSample, Naive, SignificanceTest, Split
from eutree.trees import DecisionTree
from eutree.validation import check_amounts, check_measures, check_number


@dataclass(frozen=True, kw_only=True)
class Discretizer(MethodOfParts):
    """The choices that the learner of Table 1 asks for, beside the cut that a leaf deserves.

    Attributes:
        discount: gamma of Eqs. 2 and 5.
        exploration: epsilon, the probability of a random action while gathering.
        gathering_episodes: Episodes of a data gathering phase, between two expansions.
        target: How q of a transition is defined (Eq. 2).
        solve_each_split: Solve the MDP after every split, as Table 1 says, instead of once at the
            end of an expansion.
        solve_growth: Solve the MDP exactly only in an expansion to which the history has grown to
            this many times its size at the last exact solution; those between leave it to
            prioritized sweeping, from the leaves they split. 1 solves in every expansion.
        retest_growth: A leaf is tested again only when it holds this many times the transitions
            that it held at its last test; 1 tests every leaf in every expansion.
        untried_value: Q of an action never tried in a leaf; None leaves it out of the maximum.
        backups: Prioritized-sweeping backups after each step (Moore & Atkeson 1993).
        max_transitions: Most transitions remembered between two episodes: a uniform sample of
            those of each leaf and action. None remembers all.
    """

    name: ClassVar[str]
    needs: ClassVar[Needs] = Needs(keeps_locks=True)

    discount: float = 0.99
    exploration: float = 0.1
    gathering_episodes: int = 20
    target: Target = OneStep()
    solve_each_split: bool = True
    solve_growth: float = 1.0
    retest_growth: float = 1.0
    untried_value: float | None = 0.0
    backups: int = 5
    max_transitions: int | None = None

    def __post_init__(self) -> None:
        check_measures(self, "discount exploration", low=0.0, high=1.0)
        check_measures(self, "solve_growth retest_growth", low=1.0)
        if self.untried_value is not None:
            check_number("untried_value", self.untried_value)
        check_amounts(self, gathering_episodes=1, backups=0, max_transitions=1)

    def cut(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the cut that a leaf deserves, or None."""
        raise NotImplementedError

    def start(self, problem: Problem, start: Start) -> "UTree":
        """Return the learner at its start: Table 1's initialization."""
        return UTree.begun(problem, start, self)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of a learner's state."""
        forgetting = () if self.max_transitions is None else bounds_part("LA")
        solved = (_SOLVED_AT,) if self.solve_growth > 1.0 else ()
        return (*_TREE_AND_LEAVES, *forgetting, *solved, _MDP)


@dataclass(frozen=True, kw_only=True)
class UTreeMethod(Discretizer):
    """The choices that Table 1 makes or leaves open.

    Attributes:
        splitter: Which cut of a leaf is its best.
        significance: Whether the best cut is more than chance (the stopping criterion).
    """

    name: ClassVar[str] = "u-tree"
    deleted: ClassVar[Mapping[str, Any]] = {"gate": {"type": "AnyGain"}}

    splitter: KolmogorovSmirnov = KolmogorovSmirnov(score="scaled", compare="pooled", min_leaf=1)
    significance: SignificanceTest = Naive()

    @property
    def reads_the_paper(self) -> bool:
        """Whether leaves are cut by the paper's stopping criterion, read literally."""
        return isinstance(self.significance, Naive)

    def cut(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the best cut of a leaf if it is significant, or None (the stopping criterion)."""
        split = self.splitter.best(sample)
        if split is None:
            return None
        p = self.significance.p_value(split, sample, self.splitter, generator)
        return None if p > self.significance.alpha else split


def _is_queue(found: Found) -> None:
    queue = found.state["mdp_queue"]
    if np.unique(queue).size != queue.size:
        raise found.refuse("mdp_queue", "a state stands in it twice")


_TREE_AND_LEAVES = (TREE_PART, *history_parts(tree="tree"), LOCKED_PART)
_SOLVED_AT = Part({"solved_at": Stored("i8", "1", low=0, most="history_n_seen", at="_solved_at")})
_MDP = Part(
    {
        "mdp_values": Stored("f8", "L"),
        "mdp_action_values": Stored("f8", "LA", nan=True),
        "mdp_reward_sums": Stored("f8", "LA"),
        "mdp_priority": Stored("f8", "L", inf=True),
        "mdp_queue": Stored("i4", "Q", low=0, below="L"),
        "tested_at": Stored("i8", "L", low=0, most=MOST, at="_tested_at"),
        "prior": Stored("i8", "L", low=0, below="A", at="_prior"),
    },
    _is_queue,
    at="mdp",
    prefix="mdp_",
    save=TabularMDP.state,
    make=lambda learner, state: learner.counted(state),
)


BACKUPS_PER_LEAF = 20  # of prioritized sweeping for each leaf that a split has made or shrunk


class UTree:
    """The learner of Table 1.

    Args:
        tree: The state tree to start from: a single leaf, or the expert tree's structure.
        n_actions: Number of actions A.
        method: How to learn.
        prior: Action of each leaf while nothing was tried in it: the expert's, shape [L]. Where an
            untried action has a value, it is never asked for.
        locked: Leaves that are never split and whose prior action stays, without exploration.

    Attributes:
        tree: The present state tree; a value, so keeping a reference freezes it.
        history: All transitions stored so far.
        mdp: The MDP over the leaves (Eqs. 3 to 6).
        method: How it learns.
        n_actions: Number of actions A.
    """

    def __init__(
        self,
        tree: DecisionTree,
        n_actions: int,
        method: Discretizer,
        *,
        prior: Integers | None = None,
        locked: Iterable[int] = (),
    ) -> None:
        self.tree = tree
        self.n_actions = n_actions
        self.method = method
        room, shape = method.max_transitions, (tree.n_leaves, n_actions)
        forgetting = None if room is None else LeafReservoirs(room, *shape)
        self.history = History(tree.n_features, tree.n_leaves, forgetting)
        self.mdp = self.counted()
        self._solved_at = 0  # transitions ever seen when the MDP was solved last
        none = np.zeros(tree.n_leaves, dtype=np.int64)
        self._prior = np.array(none if prior is None else prior)  # [L]
        self._tested_at = none.copy()  # [L] transitions seen to leave each at its last test
        self._locked = frozenset(locked)
        self._steps = LeafSteps()

    @classmethod
    def begun(cls, problem: Problem, start: Start, method: Discretizer) -> Self:
        """Return the learner at its start: a single leaf or the expert tree, its history."""
        tree, actions, locked = start.first_leaves(problem)
        learner = cls(tree, problem.n_actions, method, prior=actions, locked=locked)
        if start.episodes:
            learner.add_demonstrations(start.episodes)
        return learner

    def add_demonstrations(self, episodes: Iterable[Episode]) -> None:
        """Store the expert's transitions and solve the MDP for the first Q-table."""
        for episode in episodes:
            leaves = self.tree.leaf_index(episode.observations)
            store(self.history, episode, leaves, demonstrated=True)
            self.history.forget()
        self._recount()
        self._solve()

    # Data gathering phase (Table 1) -------------------------------------------------------------

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; all its chance is ``generator``."""
        self.mdp.savepoint()
        if self.method.max_transitions is not None:
            self._rewards_before = self.mdp.counts.reward_sums.copy()
        self._steps.start(self.tree, self.mdp, observation, generator)

    def act(self, allowed: Booleans | None = None) -> int:
        """Choose the action for the present observation: greedy (Eq. 1), random with epsilon."""
        leaf, generator = self._steps.leaf, self._steps.generator
        if leaf not in self._locked and generator.random() < self.method.exploration:
            return random_action(generator, self.n_actions, allowed)
        locked = leaf in self._locked
        action = int(self._prior[leaf]) if locked else self._steps.greedy(self._prior)
        if allowed is None or allowed[action]:
            return action
        # Eq. 1 among the allowed ones; those that were never tried are the last.
        values = np.nan_to_num(self.mdp.action_values[leaf], nan=-np.finfo(np.float64).max)
        return int(np.where(allowed, values, -np.inf).argmax())

    def observe(self, step: Step) -> None:
        """Take a step; update Pr, R and Q by prioritized sweeping (Eqs. 3 to 6)."""
        self._steps.add(step, self.method.backups)

    def end_episode(self) -> None:
        """Store the transitions (o, a, r, o') of the episode, each in leaf L(o)."""
        one = self._steps.finish()
        stored = store(self.history, one.steps, one.leaves, self._steps.generator)
        if self.method.max_transitions is not None:
            if not stored.all():
                self._uncount(one, stored)
            if self.history.forget() is not None:
                self._recount()

    def _uncount(self, episode: LeafEpisode, stored: Booleans) -> None:
        """Take back the counts of those transitions of the last episode that were not stored."""
        left, actions, rewards = episode.leaves[:-1], episode.steps.actions, episode.steps.rewards
        out = ~stored
        self.mdp.counts.forget(left[out], actions[out], rewards[out], episode.entered[out])
        state = self.mdp.state()
        state["reward_sums"] = self._rewards_before  # to the bit: as if never added
        np.add.at(state["reward_sums"], (left[stored], actions[stored]), rewards[stored])
        self.mdp.restore(state)

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""
        if not len(self._steps):
            return
        episode, leaves, entered = self._steps.finish()
        self.mdp.counts.forget(leaves[:-1], episode.actions, episode.rewards, entered)
        self.mdp.rollback()

    # Expansion phase (Table 1) ------------------------------------------------------------------

    def update(self, generator: np.random.Generator) -> Update:
        """Split every leaf that deserves it, and solve the MDP (Table 1, expansion phase).

        Only leaves that exist when the phase begins are tested. ``generator`` serves permutation
        tests.
        """
        if len(self._steps):
            raise InvalidArgumentError("update must be called between episodes, not within one")
        made = []
        for leaf in self._due():
            rows = self.history.leaving.of(leaf)  # what left it, T(s, a) of all actions
            sample = LeafSample(
                observations=self.history.observations[rows],
                returns=self.targets(rows),
                actions=self.history.actions[rows].astype(np.int64),
                episodes=self.history.episodes[rows].astype(np.int64),
            )
            split = self.method.cut(sample, generator)
            if split is not None:
                made.append(self._split(leaf, split))
                if self.method.solve_each_split:
                    self._solve()
        self.tree = self.tree.split_each([(s.leaf, s.feature, s.threshold) for s in made])
        halves = [leaf for split in made for leaf in (split.leaf, split.new_leaf)]
        if self._is_to_be_solved():
            self._solve()
        elif halves:
            self.mdp.queue(halves)
            self.mdp.sweep(BACKUPS_PER_LEAF * len(halves))
        return Update(tuple(made))

    def _due(self) -> list[int]:
        """Return the leaves to test now: those that have grown enough since they were tested."""
        sizes = self.history.seen_leaving()[: self._tested_at.size]
        grown = sizes >= self._tested_at * self.method.retest_growth
        due = grown | (self.method.retest_growth == 1.0)  # an estimate may fall
        due[list(self._locked)] = False
        self._tested_at[due] = sizes[due]
        leaves: list[int] = np.flatnonzero(due).tolist()
        return leaves

    def _solve(self) -> None:
        self.mdp.solve()
        self._solved_at = self.history.n_seen

    def _is_to_be_solved(self) -> bool:
        """Return whether so many transitions have come that an exact solution pays.

        A history that has not grown at all is being learned from again, as without an environment:
        no step will come that sweeps.
        """
        new = self.history.n_seen - self._solved_at
        return new == 0 or new >= (self.method.solve_growth - 1.0) * (self.history.size - new)

    def _split(self, leaf: int, split: Split) -> LeafSplit:
        """Split ``leaf`` in all but the tree; relabel its transitions and recount just those."""
        known = self.mdp.action_values[leaf]  # as ``greedy_actions``, which looks at every leaf
        greedy = int(self._prior[leaf] if np.isnan(known).all() else np.nanargmax(known))
        new_leaf = self.mdp.add_state(float(self.mdp.values[leaf]))
        moved = self.history.split(leaf, new_leaf, split.feature, split.threshold)
        actions = self.history.actions
        self.mdp.counts.relabel(
            actions[moved.rows],
            states=moved.old_left,
            next_states=moved.old_entered,
            new_states=moved.new_left,
            new_next_states=moved.new_entered,
        )
        rows = moved.leaving
        self.mdp.counts.set_rewards(
            [leaf, new_leaf], self.history.left[rows], actions[rows], self.history.rewards[rows]
        )
        self._prior[leaf] = greedy
        self._prior = np.append(self._prior, greedy)
        self._tested_at = np.append(self._tested_at, 0)  # both halves are new
        self._tested_at[leaf] = 0
        return LeafSplit(leaf, new_leaf, int(split.feature), float(split.threshold))

    # What it knows ------------------------------------------------------------------------------

    def targets(self, rows: Integers) -> Floats:
        """Return q of the stored transitions ``rows`` (Eq. 2), shape [n]."""
        return self.method.target.of(
            self.history,
            rows,
            values=self.mdp.values,
            greedy=self.greedy_actions,
            discount=self.method.discount,
        )

    def greedy_actions(self) -> Int32s:
        """Return the action of each leaf (Eq. 1), shape [L]."""
        values = self.mdp.action_values
        known = ~np.isnan(values)
        best = np.where(known, values, -np.inf).argmax(axis=1)
        learned = np.array(known.any(axis=1))
        learned[list(self._locked)] = False
        return np.where(learned, best, self._prior).astype(np.int32)

    def decisions(self) -> Decisions:
        """Return the state tree with the greedy action of each leaf, and Q."""
        targets = self.targets(np.arange(self.history.size))
        return Decisions(
            self.tree,
            self.greedy_actions().astype(np.int64),
            leaf_statistics(
                self.history.left,
                self.history.actions,
                targets,
                visits=self.mdp.counts.visits,
                values=self.mdp.action_values,
            ),
            tuple(sorted(self._locked)),
        )

    def state(self) -> Arrays:
        """Return all that the learner knows, between two episodes."""
        return arrays_of(self, self.method.parts)

    def counted(self, state: Arrays | None = None) -> TabularMDP:
        """Return an MDP over the leaves that counts the history; its ``state()`` may be known."""
        rows = self.history.left, self.history.actions, self.history.rewards, self.history.entered
        shape = {"n_states": self.tree.n_leaves, "n_actions": self.n_actions}
        counts = TransitionCounts.of(*rows, **shape)
        mdp = TabularMDP(counts, self.method.discount, untried=self.method.untried_value)
        if state is not None:
            mdp.restore({"reward_sums": counts.reward_sums.copy()} | state)
        return mdp

    def _recount(self) -> None:
        """Count the transitions that are stored now; V, Q and the queue stay."""
        state = self.mdp.state()
        del state["reward_sums"]
        self.mdp = self.counted(state)
