"""What a run gained against its start: both policies on the same fresh episodes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.contests.betting import lower_bound
from eutree.evaluation import Evaluation, Interval, mean_interval
from eutree.wording import counted

ERROR = 0.05


@dataclass(frozen=True)
class Judgement:
    """The result of a run minus its start.

    Attributes:
        episodes: Episodes that both ran; 0 where both decide the same.
        return_change: Mean of the difference of returns.
        return_interval: Its 95 % interval (Student's, paired).
        success_change: Mean of the difference of successes; None where none is reported.
        success_interval: Its 95 % interval, true for any share however rare (betting).
        challengers: Trees that were put to the test on the way.
    """

    episodes: int
    return_change: float
    return_interval: Interval
    success_change: float | None = None
    success_interval: Interval | None = None
    challengers: int = 0

    @classmethod
    def same(cls, *, challengers: int) -> "Judgement":
        """Return the judgement of a run that ends with the policy it started from."""
        return cls(0, 0.0, Interval(0.0, 0.0), challengers=challengers)

    @property
    def is_start(self) -> bool:
        """Whether the result decides as the start does."""
        return self.episodes == 0

    def facts(self) -> dict[str, Any]:
        """Return the judgement in JSON's types."""
        success = self.success_interval
        return {
            "episodes_compared": self.episodes,
            "return": self.return_change,
            "return_interval": list(self.return_interval),
            "success": self.success_change,
            "success_interval": None if success is None else list(success),
            "challengers": self.challengers,
        }

    @classmethod
    def from_facts(cls, facts: dict[str, Any]) -> "Judgement":
        """Take back ``facts()``."""
        success = facts["success_interval"]
        return cls(
            int(facts["episodes_compared"]),
            float(facts["return"]),
            Interval(*map(float, facts["return_interval"])),
            None if facts["success"] is None else float(facts["success"]),
            None if success is None else Interval(*map(float, success)),
            int(facts["challengers"]),
        )

    def describe(self, start: str) -> str:
        """Return the judgement in words; ``start`` names the policy that it began with."""
        if self.is_start:
            tried = f": {counted(self.challengers, 'challenger')} tried" if self.challengers else ""
            return f"nothing better than {start} was found{tried}"
        words = f"return {_signed(self.return_change, self.return_interval, 1.0, '')}"
        if self.success_change is not None and self.success_interval is not None:
            words += f", success {_signed(self.success_change, self.success_interval, 100.0, ' %')}"
        return f"{words} against {start}, on {self.episodes} episodes of their own"


def judged(start: Evaluation, result: Evaluation, *, challengers: int) -> Judgement:
    """Return the judgement of two evaluations on the same episodes."""
    gain = result.returns - start.returns
    success = interval = None
    if start.successes is not None and result.successes is not None:
        more = result.successes.astype(np.float64) - start.successes
        success, interval = float(more.mean()), _bounds(more)
    return Judgement(
        gain.size, float(gain.mean()), mean_interval(gain), success, interval, challengers
    )


def _bounds(differences: Floats) -> Interval:
    """Return bounds of the mean of differences of successes, which lie in [-1, 1]."""
    low = lower_bound(differences, -1.0, ERROR / 2)
    return Interval(low, -lower_bound(-differences, -1.0, ERROR / 2))


def _signed(value: float, interval: Interval, scale: float, unit: str) -> str:
    low, high = (scale * end for end in interval)
    return f"{scale * value:+.1f}{unit} [{low:.1f}, {high:.1f}]"
