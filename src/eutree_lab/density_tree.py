"""A kd-tree by density: a leaf that holds enough transitions is cut at its median.

The control for every method that looks at returns before it cuts: the same leaf MDP, the same
exploration, and cells of about equally many transitions, whichever their rewards (Friedman, Bentley
& Finkel 1977 cut a kd-tree in this way). Its return is the worth of resolution alone.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from eutree.features import threshold_between
from eutree.learners.u_tree import Discretizer
from eutree.splitting import LeafSample, Split
from eutree.validation import check_integer


@dataclass(frozen=True, kw_only=True)
class DensityTreeMethod(Discretizer):
    """The choices of the kd-tree by density.

    Attributes:
        max_density: A leaf with more transitions than this is cut.
    """

    name: ClassVar[str] = "density-tree"

    solve_each_split: bool = False
    untried_value: float | None = None
    max_density: int = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("max_density", self.max_density, low=2)

    def cut(self, sample: LeafSample, generator: np.random.Generator) -> Split | None:
        """Return the cut at the median of one feature, if the leaf is too full.

        It is the feature of most distinct values, the first of several: so units do not matter,
        and features of few values are cut last.
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
