"""What the learner of Table 1 asks of its method: when to cut a leaf, and how to treat the MDP.

The Continuous U-Tree cuts by a test of returns, a kd-tree by density; both are the same learner.
"""

from typing import Protocol

import numpy as np

from eutree.learners.u_tree.targets import Target
from eutree.splitting import LeafSample, Split


class Discretizer(Protocol):
    """What the learner asks of its method: when to cut a leaf, and how to treat the MDP over them.

    The attributes are those of ``UTreeMethod``.
    """

    @property
    def discount(self) -> float:
        """Discount gamma of Eqs. 2 and 5."""
        ...

    @property
    def exploration(self) -> float:
        """Probability of a random action."""
        ...

    @property
    def target(self) -> Target:
        """What q of a transition is."""
        ...

    @property
    def solve_each_split(self) -> bool:
        """Whether every split is followed by a solution."""
        ...

    @property
    def solve_growth(self) -> float:
        """Growth of the history between two exact solutions."""
        ...

    @property
    def retest_growth(self) -> float:
        """Growth of a leaf between two tests."""
        ...

    @property
    def untried_value(self) -> float | None:
        """Q of an untried action, or None."""
        ...

    @property
    def backups(self) -> int:
        """Prioritized-sweeping backups after each step."""
        ...

    @property
    def max_transitions(self) -> int | None:
        """Most transitions remembered, or None."""
        ...

    def cut(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the cut that a leaf deserves, or None."""
        ...
