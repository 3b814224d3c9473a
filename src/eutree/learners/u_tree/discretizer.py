"""What the learner of Table 1 asks of its method: when to cut a leaf, and how to treat the MDP.

The Continuous U-Tree cuts by a test of returns, a kd-tree by density; both are the same learner.
"""

from collections.abc import Callable
from typing import Protocol, TypeAlias

import msgspec
import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.learners import _kernels
from eutree.learners.history import History
from eutree.splitting import LeafSample, Split
from eutree.validation import check_number

# A rule takes the leaves' values [L], and their greedy actions [L] if it asks for them.


class OneStep(msgspec.Struct, frozen=True, tag=True):
    """q = r + discount * V(L(o')), the paper's Eq. 2 with o' in place of its misprinted o."""

    def of(
        self,
        history: History,
        rows: Integers,
        *,
        values: Floats,
        greedy: Callable[[], Int32s],
        discount: float,
    ) -> Floats:
        """Return q of each of the rows, shape [n]."""
        out = np.empty(rows.size)
        _kernels.one_step_targets(rows, history.rewards, history.entered, values, discount, out)
        return out


class LambdaReturn(msgspec.Struct, frozen=True, tag=True):
    """The lambda-return, cut at the first action that is not greedy (Watkins's Q(lambda)).

    Through leaves that lump unlike observations together, a one-step target loses what an action
    leads to two or three steps later; a return keeps it.

    Attributes:
        decay: lambda, from 0 (one step) to 1 (the whole return up to the cut).
    """

    decay: float = 1.0

    def __post_init__(self) -> None:
        check_number("decay", self.decay, low=0.0, high=1.0)

    def of(
        self,
        history: History,
        rows: Integers,
        *,
        values: Floats,
        greedy: Callable[[], Int32s],
        discount: float,
    ) -> Floats:
        """Return q of each of the rows, shape [n]."""
        out = np.empty(rows.size)
        chain = _kernels.Chain(
            history.continues, history.actions, history.rewards, history.left, history.entered
        )
        _kernels.lambda_targets(rows, chain, values, greedy(), discount, self.decay, out)
        return out


Target: TypeAlias = OneStep | LambdaReturn


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
