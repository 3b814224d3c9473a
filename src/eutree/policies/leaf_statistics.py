"""What was known of each leaf when a policy was frozen."""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers, frozen


@dataclass(frozen=True, eq=False)
class LeafStatistics:
    """What was known of each leaf when the policy was frozen.

    Attributes:
        visits: Transitions that left each leaf, per action.
        values: Q(s, a) of the rule that decides, or the mean return to go of the policy's own
            episodes after the action; NaN where the action was never tried.
        deviations: Standard error of each value; NaN where unknown.
    """

    visits: Integers  # [L, A]
    values: Floats  # [L, A]
    deviations: Floats  # [L, A]

    @property
    def compares_actions(self) -> bool:
        """Whether there is a leaf in which the values of two actions are known."""
        return bool((np.isfinite(self.values).sum(axis=1) > 1).any())

    @property
    def meaning(self) -> str:
        """What a value is, in words; where each leaf has tried one action it is no Q."""
        if self.compares_actions:
            return "a value is the return expected after an action: Q, or the mean of what followed"
        return "a value is the mean return that followed; each leaf tried one action: no Q"

    def __post_init__(self) -> None:
        object.__setattr__(self, "visits", frozen(np.asarray(self.visits, dtype=np.int64)))
        object.__setattr__(self, "values", frozen(np.asarray(self.values, dtype=np.float64)))
        errors = frozen(np.asarray(self.deviations, dtype=np.float64))
        object.__setattr__(self, "deviations", errors)
