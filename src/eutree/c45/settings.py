"""The choices of C4.5 as one frozen value: release 8 by default, J48 and lossless as variants."""

from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Literal

import numpy as np

from eutree.validation import check_choice, check_number

Dialect = Literal["table", "normal"]

# One-sided deviates as release 8 tabulates them; in between it interpolates linearly.
_LEVELS = (0.0, 0.001, 0.005, 0.01, 0.05, 0.10, 0.20, 0.40, 1.00)
_DEVIATES = (4.0, 3.09, 2.58, 2.33, 1.65, 1.28, 0.84, 0.25, 0.0)


@dataclass(frozen=True, kw_only=True)
class C45Settings:
    """Every choice of the learner; the defaults are those of C4.5 release 8.

    Attributes:
        min_objects: Least weight m of a branch; a node of less than 2 m is a leaf.
        confidence: CF, the confidence of the pessimistic error estimate; smaller prunes more.
        prune: Whether to prune by estimated errors.
        collapse: Whether a subtree that does not lower the training error becomes a leaf.
        subtree_raising: Whether pruning may replace a node by its largest branch.
        z: ``"table"`` for release 8; ``"normal"`` for Weka's J48 (see docs/c45.md).
        grouped: Whether values of a nominal attribute may share a branch (release 8's ``-s``).
        gap: A cut needs neighbours further apart than this; release 8 and J48 have 1e-5.
        use_min_split: Whether each side of a cut needs a tenth of the average class (2 to 25).
        use_penalty: Whether log2(tries) / N is taken off the gain of a continuous attribute.
        use_average_filter: Whether an attribute needs at least the average gain.
        require_gain: Whether a test needs a positive gain and a split information above 0.001.
    """

    min_objects: float = 2
    confidence: float = 0.25
    prune: bool = True
    collapse: bool = True
    subtree_raising: bool = True
    z: Dialect = "table"
    grouped: bool = False
    gap: float = 0.0
    use_min_split: bool = True
    use_penalty: bool = True
    use_average_filter: bool = True
    require_gain: bool = True

    def __post_init__(self) -> None:
        check_number("min_objects", self.min_objects, low=0)
        check_number("confidence", self.confidence, low=0, high=1)
        check_number("gap", self.gap, low=0)
        check_choice("z", self.z, ("table", "normal"))

    @classmethod
    def lossless(cls) -> "C45Settings":
        """Return the settings under which distinct observations keep their actions exactly."""
        return replace(
            cls.unpruned(),
            min_objects=0,
            collapse=False,
            use_min_split=False,
            use_penalty=False,
            require_gain=False,
        )

    @classmethod
    def unpruned(cls) -> "C45Settings":
        """Return release 8 without pruning (``-u`` of J48); collapse is part of growing."""
        return cls(prune=False)

    @property
    def tolerance(self) -> float:
        """How much better a later candidate must be to win; ties go to the first."""
        return 1e-6 if self.z == "normal" else 1e-10

    @property
    def deviate(self) -> float:
        """The normal deviate z that belongs to ``confidence``."""
        if self.z == "normal":
            return NormalDist().inv_cdf(1 - self.confidence) if 0 < self.confidence < 1 else 0.0
        return float(np.interp(self.confidence, _LEVELS, _DEVIATES))
