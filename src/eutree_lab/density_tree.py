"""A kd-tree by density: a leaf that holds enough transitions is cut at its median.

The control for every method that looks at returns before it cuts: the same leaf MDP, the same
exploration, and cells of about equally many transitions whatever happened in them (Friedman,
Bentley & Finkel 1977 cut a kd-tree in this way). What it reaches is what resolution alone is worth.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from eutree.learners import Needs, OneStep, Problem, Start, Target, UTree
from eutree.learners.declared import Declared
from eutree.learners.learner import Arrays
from eutree.learners.u_tree import u_tree_parts
from eutree.splitting import LeafSample, Split
from eutree.thresholds import threshold_between
from eutree.validation import check_integer, check_number


@dataclass(frozen=True, kw_only=True)
class DensityTreeMethod:
    """The choices of the kd-tree by density.

    Attributes:
        discount: gamma of Eqs. 2 and 5.
        exploration: epsilon, the probability of a random action while gathering.
        gathering_episodes: Episodes between two updates.
        max_density: A leaf with more transitions than this is cut.
        backups: Prioritized-sweeping backups after each step.
    """

    name: ClassVar[str] = "density-tree"
    needs: ClassVar[Needs] = Needs()
    target: ClassVar[Target] = OneStep()
    solve_each_split: ClassVar[bool] = False
    solve_growth: ClassVar[float] = 1.0
    retest_growth: ClassVar[float] = 1.0
    untried_value: ClassVar[float | None] = None
    max_transitions: ClassVar[int | None] = None

    discount: float = 0.99
    exploration: float = 0.1
    gathering_episodes: int = 20
    max_density: int = 100
    backups: int = 5

    def __post_init__(self) -> None:
        check_number("discount", self.discount, low=0.0, high=1.0)
        check_number("exploration", self.exploration, low=0.0, high=1.0)
        check_integer("gathering_episodes", self.gathering_episodes, low=1)
        check_integer("max_density", self.max_density, low=2)
        check_integer("backups", self.backups, low=0)

    def cut(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the cut at the median of one feature, if the leaf is too full.

        It is the feature of most distinct values, the first of several: so units do not matter,
        and what has few values is cut last.
        """
        rows = sample.observations
        if len(rows) <= self.max_density:
            return None
        distinct = [np.unique(rows[:, feature]) for feature in range(rows.shape[1])]
        sizes = np.array([values.size for values in distinct])
        feature = int(sizes.argmax())
        if sizes[feature] < 2:
            return None
        ordered = np.sort(rows[:, feature])
        above = int(np.searchsorted(distinct[feature], ordered[len(ordered) // 2]))
        above = max(above, 1)
        left, right = distinct[feature][above - 1 : above + 1].tolist()
        threshold = threshold_between(left, right)
        n_left = int((rows[:, feature] <= threshold).sum())
        return Split(
            feature=feature,
            threshold=threshold,
            statistic=0.0,
            scaled_statistic=0.0,
            n_left=n_left,
            n_right=len(rows) - n_left,
        )

    def start(self, problem: Problem, start: Start) -> UTree:
        """Return the learner at its start."""
        return UTree.begun(problem, start, self)

    def restore(self, problem: Problem, start: Start, state: Arrays) -> UTree:
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        return UTree.from_state(state, problem.n_actions, self)

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return what the arrays of a ``state()`` are."""
        return problem.declare(*u_tree_parts(bounded=False, solves_at=False))
