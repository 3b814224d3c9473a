"""What was known of each leaf when a policy was frozen."""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers, frozen


@dataclass(frozen=True, eq=False)
class LeafStatistics:
    """What was known of each leaf when the policy was frozen.

    Attributes:
        visits: Transitions that left each leaf, per action.
        values: Q(s, a); NaN where the action was never tried.
        deviations: Standard error of Q(s, a); NaN where unknown.
    """

    visits: Integers  # [L, A]
    values: Floats  # [L, A]
    deviations: Floats  # [L, A]

    def __post_init__(self) -> None:
        object.__setattr__(self, "visits", frozen(np.asarray(self.visits, dtype=np.int64)))
        object.__setattr__(self, "values", frozen(np.asarray(self.values, dtype=np.float64)))
        errors = frozen(np.asarray(self.deviations, dtype=np.float64))
        object.__setattr__(self, "deviations", errors)
