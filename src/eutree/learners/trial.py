"""A trial: another tree takes the incumbent's place only when real episodes speak for it.

Methods that learn values lose a good expert's policy while they learn: values of what was seldom
tried are wrong, and the greedy tree of wrong values crashes where the expert did not. Here the
expert's tree is the *incumbent*, and the tree of each update may become the *challenger*. In every
second episode one of both acts, without exploration: the challenger, then the incumbent from the
same start. It wins when the mean gain is above 0 by a lower bound that holds at any time and for
losses that have not been seen yet (:mod:`eutree.contests.betting`), and is dropped when it
falls behind or does not decide.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats, Integers
from eutree.contests.betting import lower_bound
from eutree.trees import DecisionTree
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import from_decision_tree, to_decision_tree

ERROR = 0.05  # chance of taking a tree that is no better
FEWEST = 5  # pairs before a challenger is dropped for being behind
MOST = 100  # pairs after which one that does not decide is dropped


class Trial:
    """An incumbent tree, perhaps a challenger, and what they earned from common starts.

    Args:
        tree: The incumbent.
        actions: Action of each of its leaves, shape [L].

    Attributes:
        incumbent: The tree that is the policy.
        challenger: The tree on trial; None if there is none.
        gains: What the challenger earned more than the incumbent, start by start.
        adopted: How many challengers have won.
    """

    def __init__(self, tree: DecisionTree, actions: Integers) -> None:
        self.incumbent = from_decision_tree(tree, actions)
        self.challenger: ActionTree | None = None
        self.gains: list[float] = []
        self.adopted = 0
        self._first = np.nan  # return of the challenger where the incumbent's is still to come
        self._lowest, self._highest = np.inf, -np.inf  # returns seen
        self._turn, self._pairs = 0, 0

    def acting(self) -> ActionTree | None:
        """Return the tree whose turn the next episode is; None if it is the learner's own."""
        if self.challenger is None or self._turn % 2 == 0:
            return None
        return self.challenger if np.isnan(self._first) else self.incumbent

    def next_start(self) -> int | None:
        """Return the number of the start that both trees have in common; None if any will do."""
        return None if self.acting() is None else self._pairs

    def episode_over(self, earned: float) -> None:
        """Take the return of an episode; of a pair's second one, judge."""
        acted = self.acting()
        self._turn += 1
        self._lowest, self._highest = min(self._lowest, earned), max(self._highest, earned)
        if acted is None:
            return
        if np.isnan(self._first):
            self._first = earned
            return
        self.gains.append(self._first - earned)
        self._first = np.nan
        self._pairs += 1
        self._judge()

    def challenge(self, tree: DecisionTree, actions: Integers) -> bool:
        """Put a tree on trial unless one is or it is the incumbent; return whether it is now."""
        if self.challenger is not None:
            return False
        rival = from_decision_tree(tree, actions)
        if _same(rival, self.incumbent):
            return False
        self.challenger, self.gains = rival, []
        return True

    def decided(self, n_features: int) -> tuple[DecisionTree, Integers]:
        """Return the incumbent and the action of each of its leaves."""
        tree, actions = to_decision_tree(self.incumbent, n_features)
        return tree, actions.astype(np.int64)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all that is known between two episodes."""
        trees = {"incumbent": self.incumbent}
        if self.challenger is not None:
            trees["challenger"] = self.challenger
        arrays: dict[str, NDArray[Any]] = {
            f"{name}_{field}": getattr(tree, field)
            for name, tree in trees.items()
            for field in ActionTree._fields
        }
        arrays["gains"] = np.array(self.gains)
        arrays["returns"] = np.array([self._first, self._lowest, self._highest])
        arrays["counts"] = np.array([self._turn, self._pairs, self.adopted])
        return arrays

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]]) -> "Trial":
        """Return the trial whose ``state()`` this was."""
        trial = cls.__new__(cls)
        trial.incumbent = _tree_of(state, "incumbent")
        known = "challenger_feature" in state
        trial.challenger = _tree_of(state, "challenger") if known else None
        trial.gains = state["gains"].tolist()
        trial._first, trial._lowest, trial._highest = state["returns"].tolist()
        trial._turn, trial._pairs, trial.adopted = state["counts"].tolist()
        return trial

    def _judge(self) -> None:
        gains: Floats = np.array(self.gains)
        worst = self._lowest - self._highest
        if worst < 0.0 and lower_bound(gains, worst, ERROR) > 0.0 and self.challenger is not None:
            self.incumbent, self.challenger = self.challenger, None
            self.adopted += 1
        elif len(gains) >= MOST or (len(gains) >= FEWEST and gains.mean() <= 0.0):
            self.challenger = None


def _same(one: ActionTree, other: ActionTree) -> bool:
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))


def _tree_of(state: Mapping[str, NDArray[Any]], name: str) -> ActionTree:
    return ActionTree._make(np.array(state[f"{name}_{field}"]) for field in ActionTree._fields)
