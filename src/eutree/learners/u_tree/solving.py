"""When the leaf MDP is solved exactly, and what an expansion does instead in between."""

from collections.abc import Sequence

import numpy as np

from eutree.arrays import Integers
from eutree.learners.history import History
from eutree.mdp import TabularMDP

BACKUPS_PER_LEAF = 20  # of prioritized sweeping for each leaf that a split has made or shrunk


class Solving:
    """The exact solutions of a learner's MDP.

    Args:
        growth: Solve again when the history has grown to so many times its size.

    Attributes:
        solved_at: Transitions ever seen when the MDP was solved last.
    """

    def __init__(self, growth: float) -> None:
        self._growth = growth
        self.solved_at = 0

    def solve(self, mdp: TabularMDP, history: History) -> None:
        """Solve exactly, whatever the history has grown."""
        mdp.solve()
        self.solved_at = history.n_seen

    def after_splits(self, mdp: TabularMDP, history: History, leaves: Sequence[int]) -> None:
        """Solve exactly if it is time; else sweep from these leaves, the halves of split ones."""
        if self._due(history):
            self.solve(mdp, history)
        elif leaves:
            mdp.queue(leaves)
            mdp.sweep(BACKUPS_PER_LEAF * len(leaves))

    def state(self) -> dict[str, Integers]:
        """Return what a stored learner needs: nothing where every expansion solves."""
        return {"solved_at": np.array([self.solved_at])} if self._growth > 1.0 else {}

    def _due(self, history: History) -> bool:
        """Return whether so many transitions have come that an exact solution pays.

        A history that has not grown at all is being learned from again, as without an environment:
        no step will come that sweeps.
        """
        new = history.n_seen - self.solved_at
        return new == 0 or new >= (self._growth - 1.0) * (history.size - new)
