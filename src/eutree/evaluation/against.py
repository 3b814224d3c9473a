"""Two policies in the same episodes: what one of them earns more."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eutree.contests import bounds_of_change
from eutree.errors import InvalidArgumentError
from eutree.evaluation.evaluation import Evaluation, Interval
from eutree.wording import counted


@dataclass(frozen=True)
class Against:
    """What a policy earned more than another in the same episodes.

    Attributes:
        episodes: Episodes that both played.
        better: Those in which the policy earned more.
        worse: Those in which it earned less; in the others both earned the same.
        return_change: Mean of the policy minus the other.
        return_interval: Its 95 % interval by betting, true for any share of losses however rare, on
            the ``condition``.
        success_change: Mean of the difference of successes; None where none is reported.
        success_interval: Its 95 % interval, by betting.
        condition: What the interval depends on, where the range of returns is not known; else "".
        other: What the other policy did.
    """

    episodes: int
    better: int
    worse: int
    return_change: float
    return_interval: Interval
    success_change: float | None
    success_interval: Interval | None
    condition: str
    other: Evaluation

    def facts(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        success, other = self.success_interval, self.other
        return {
            "episodes_compared": self.episodes,
            "better": self.better,
            "worse": self.worse,
            "return": self.return_change,
            "return_interval": list(self.return_interval),
            "success": self.success_change,
            "success_interval": None if success is None else list(success),
            "condition": self.condition,
            "mean_return": other.mean_return,
            "worst_return": other.worst_return,
            "return_quantile_05": other.return_quantile_05,
            "success_rate": other.success_rate,
            "n_leaves": other.n_leaves,
        }

    def describe(self, name: str) -> str:
        """Return it in words; ``name`` is the other policy's."""
        low, high = self.return_interval
        words = f"return {self.return_change:+.2f} [{low:.2f}, {high:.2f}]"
        if self.success_change is not None and self.success_interval is not None:
            low, high = (100 * end for end in self.success_interval)
            words += f", success {100 * self.success_change:+.1f} % [{low:.1f}, {high:.1f}]"
        words += (
            f" against {name}: better in {self.better} of {counted(self.episodes, 'episode')}, "
            f"worse in {self.worse}"
        )
        return f"{words}, {self.condition}" if self.condition else words


def against(
    policy: Evaluation, other: Evaluation, *, known: tuple[float, float] | None = None
) -> Against:
    """Compare two evaluations on the same episodes: same environment, seed and count.

    Args:
        policy: What the policy did.
        other: What the one beside it did.
        known: Lowest and highest return that an episode can have; None where nobody knows.

    Raises:
        InvalidArgumentError: They are not of as many episodes.
    """
    if policy.episodes != other.episodes:
        raise InvalidArgumentError(
            f"other must be of the same {policy.episodes} episodes, got {other.episodes}"
        )
    change = interval = None
    if policy.successes is not None and other.successes is not None:
        successes = np.stack([other.successes, policy.successes]).astype(np.float64)
        bounds = bounds_of_change(successes, known=(0.0, 1.0))
        change, interval = bounds.mean, Interval(bounds.low, bounds.high)
    bounds = bounds_of_change(np.stack([other.returns, policy.returns]), known=known)
    return Against(
        episodes=policy.episodes,
        better=int((policy.returns > other.returns).sum()),
        worse=int((policy.returns < other.returns).sum()),
        return_change=bounds.mean,
        return_interval=Interval(bounds.low, bounds.high),
        success_change=change,
        success_interval=interval,
        condition=bounds.condition(),
        other=other,
    )
