"""Which policy of a run is its *final* one, which the paper does not say.

"As a result of the shorter learning time, the EU-Tree algorithm has the added effect of producing
discretizations with fewer states": so learning ended when a policy was good enough, and the final
policy is the one it ended with. How good that was is open. Rules choose from the frozen evaluations
along the run; the chosen policy is measured on fresh episodes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol


class SuccessPoint(Protocol):
    """One frozen evaluation."""

    @property
    def episode(self) -> int:
        """Episodes learned from."""

    @property
    def success(self) -> float:
        """Share of successes."""


@dataclass(frozen=True, kw_only=True)
class Correct:
    """The policy at which learning was seen to be correct: at so many evaluations in a row.

    The last policy where that never was. The start itself does not count: nothing was learned.

    Attributes:
        success: Least share of successes of a correct policy.
        evaluations: How many in a row.
    """

    success: float
    evaluations: int

    def __call__(self, curve: Sequence[SuccessPoint]) -> int:
        """Return the index of the chosen evaluation."""
        streak = 0
        for index, point in enumerate(curve):
            is_correct = index > 0 and point.success >= self.success
            streak = streak + 1 if is_correct else 0
            if streak == self.evaluations:
                return index
        return len(curve) - 1


@dataclass(frozen=True)
class BestEvaluated:
    """The policy of the best evaluation after learning began, the earliest if several are."""

    def __call__(self, curve: Sequence[SuccessPoint]) -> int:
        """Return the index of the chosen evaluation."""
        after = range(min(1, len(curve) - 1), len(curve))
        return max(after, key=lambda i: (curve[i].success, -curve[i].episode))


@dataclass(frozen=True)
class Last:
    """The policy at the end of the run."""

    def __call__(self, curve: Sequence[SuccessPoint]) -> int:
        """Return the index of the chosen evaluation."""
        return len(curve) - 1


FINALS: Mapping[str, Correct | BestEvaluated | Last] = {
    "best": BestEvaluated(),
    "last": Last(),
    "95 % once": Correct(success=0.95, evaluations=1),
    "95 % twice": Correct(success=0.95, evaluations=2),
    "95 % three times": Correct(success=0.95, evaluations=3),
    "95 % four times": Correct(success=0.95, evaluations=4),
    "all once": Correct(success=1.0, evaluations=1),
    "all twice": Correct(success=1.0, evaluations=2),
    "all three times": Correct(success=1.0, evaluations=3),
}

FINAL = "95 % twice"  # as decided: docs/decisions/paper-preset.md
