"""A Continuous U-Tree whose leaves keep their action until there is evidence for another one.

The greedy action of a leaf (Eq. 1) is the best of some means, most of them of a few transitions: in
a tree that has just been split the luckiest action leads, not the best one, and the values of the
leaves before it count on that luck. Where there is an expert's policy, this loses it.

Here a leaf has an action that it *keeps*: the expert's, or that of the leaf it was split from.
Values are those of the kept policy. Of each leaf and action

    q(s, a) = mean of the lambda-returns of T(s, a), lambda = 1, cut at the first action not kept
    V(s)    = q(s, kept(s))

which is solved by iteration, since a return that was cut ends in V. Such a return includes the
consequences of an action, so leaves that lump unlike moments together do not mix their futures.
Another action takes the place of the kept one where

    q(s, a) - q(s, kept) > errors * sqrt(var / n(s, a) + var / n(s, kept))

with the variance of all returns of the leaf, so that a few equal ones are no certainty; this is
policy iteration that moves by tests. An action that was kept and then found worse gives way in the
same manner.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Self

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.data import Episode
from eutree.learners import Decisions, LambdaReturn, LeafSplit, Problem, Start, Update, UTree
from eutree.learners.u_tree import Discretizer
from eutree.policies.leaf_statistics import returns_by_action
from eutree.splitting import Split
from eutree.trees import DecisionTree

FEWEST = 10  # transitions of an action before it can take the place of another
MOST_ROUNDS = 20  # changes of the policy in an update, each followed by an evaluation
MOST_SWEEPS, PRECISION = 100, 1e-3  # of an evaluation: at most, and the change at which it ends
TARGET = LambdaReturn(decay=1.0)


class EvidentUTree(UTree):
    """A Continuous U-Tree with a kept action for each leaf; ``_prior`` holds these.

    Args:
        tree: The state tree to start from.
        n_actions: Number of actions A.
        method: How to learn; its ``evidence`` is the standard errors by which another action must
            be better. Its ``target`` is not asked: the return is part of the rule.
        prior: Action that each leaf keeps at first, shape [L]; 0 if there is none.
        locked: Leaves whose action stays.
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
        super().__init__(tree, n_actions, method, prior=prior, locked=locked)
        self._errors = float(getattr(method, "evidence", None) or 0.0)
        self._values: Floats = np.zeros(tree.n_leaves)  # [L] of the kept policy

    @classmethod
    def begun(cls, problem: Problem, start: Start, method: Discretizer) -> Self:
        """Return the learner at its start; without a tree it keeps what was done most often."""
        learner = super().begun(problem, start, method)
        if start.expert is None and start.episodes:
            taken = np.zeros((learner.tree.n_leaves, learner.n_actions), dtype=np.int64)
            np.add.at(taken, (learner.history.left, learner.history.actions), 1)
            learner._prior = taken.argmax(axis=1)
            learner._weigh()
        return learner

    def add_demonstrations(self, episodes: Iterable[Episode]) -> None:
        """Store the expert's transitions, and find what the kept policy is worth."""
        super().add_demonstrations(episodes)
        self._weigh()

    def update(self, generator: np.random.Generator) -> Update:
        """Split leaves, and change the actions for which there is evidence."""
        self._evaluate()  # episodes were stored since
        update = super().update(generator)
        self._weigh()
        return update

    def targets(self, rows: Integers) -> Floats:
        """Return the return of the kept policy after each of the stored transitions, shape [n]."""
        return TARGET.of(
            self.history,
            rows,
            values=self._values,
            greedy=self.greedy_actions,
            discount=self.method.discount,
        )

    def greedy_actions(self) -> Int32s:
        """Return the action that each leaf keeps, shape [L]."""
        return self._prior.astype(np.int32)

    def decisions(self) -> Decisions:
        """Return the state tree with the kept action of each leaf, and the mean returns."""
        statistics = returns_by_action(
            self.history.left,
            self.history.actions,
            self.targets(np.arange(self.history.size)),
            n_leaves=self.tree.n_leaves,
            n_actions=self.n_actions,
        )
        return replace(super().decisions(), statistics=statistics)

    def _split(self, leaf: int, split: Split) -> LeafSplit:
        kept = self._prior[leaf]
        made = super()._split(leaf, split)
        self._prior[[leaf, made.new_leaf]] = kept  # not the greedy one
        self._values = np.append(self._values, self._values[leaf])
        return made

    def _weigh(self) -> None:
        """Let actions take the place of kept ones until none has the evidence for it."""
        for _ in range(MOST_ROUNDS):
            returns = self._evaluate()
            better = self._better(returns)
            if np.array_equal(better, self._prior):
                return
            self._prior = better

    def _evaluate(self) -> Floats:
        """Find V of the kept policy; return the returns of all transitions, shape [N].

        A leaf in which the kept action was never tried is worth what was got there.
        """
        rows = np.arange(self.history.size)
        left, n_leaves = self.history.left.astype(np.int64), len(self._values)
        kept = self.history.actions == self._prior[left]
        kept |= np.bincount(left, kept, minlength=n_leaves)[left] == 0
        counts = np.bincount(left, kept, minlength=n_leaves)
        for _ in range(MOST_SWEEPS):
            returns = self.targets(rows)
            means = np.bincount(left, returns * kept, minlength=n_leaves) / np.maximum(counts, 1)
            values = np.where(counts > 0, means, self._values)
            change = np.abs(values - self._values).max(initial=0.0)
            self._values = values
            if change <= PRECISION:
                break
        return returns

    def _better(self, returns: Floats) -> Integers:
        """Return the action of each leaf after those with enough evidence took their place."""
        shape = (len(self._values), self.n_actions)
        left = self.history.left.astype(np.int64)
        cells = left * self.n_actions + self.history.actions
        counts = np.bincount(cells, minlength=shape[0] * shape[1])
        means = np.bincount(cells, returns, minlength=counts.size) / np.maximum(counts, 1)
        squares = np.bincount(left, (returns - means[cells]) ** 2, minlength=shape[0])
        n, q = counts.reshape(shape), means.reshape(shape)
        variance = squares / np.maximum(n.sum(axis=1) - 1, 1)  # [L] within the actions
        leaves = np.arange(shape[0])
        n_kept, q_kept = n[leaves, self._prior], q[leaves, self._prior]
        with np.errstate(divide="ignore", invalid="ignore"):
            errors = np.sqrt(variance[:, np.newaxis] * (1.0 / n + 1.0 / n_kept[:, np.newaxis]))
            lead = q - q_kept[:, np.newaxis] - self._errors * errors
        lead[(n < FEWEST) | (n_kept == 0)[:, np.newaxis]] = -np.inf  # nothing to compare
        lead[leaves, self._prior] = 0.0
        best: Integers = lead.argmax(axis=1)
        fixed = list(self._locked)
        best[fixed] = self._prior[fixed]
        return best
