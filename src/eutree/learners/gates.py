"""Whether a significant cut is worth a leaf: what stands between a split and the tree.

A cut can be significant and useless: returns differ across it, and the same action is best on both
sides. Conservative Q-Improvement (A. Roth, N. Topin, P. Jamshidi and M. Veloso, *Conservative
Q-Improvement: Reinforcement Learning for an Interpretable Decision-Tree Policy*, 2019) splits only
where the policy is expected to gain. With n visits of a leaf out of N, n_side of them on a side
of the cut, and a* the leaf's own best action,

    gain = n / N * sum over both sides of n_side / n * [max_a Q_side(a) - Q_side(a*)]

must exceed a threshold that decays with every step and is put back by a split. Q of a side is the
mean q (Eq. 2) of the action's transitions there; of an action that was never tried on it, that of
the whole leaf for a*, nothing for the others: as in the paper, whose halves begin with the leaf's
Q.

It looks one cut ahead. The first cut of an exclusive or gains nothing and is refused, and so is one
that only makes the values better that lie before it. A refused leaf is looked at again in the next
expansion, when the threshold is lower.
"""

from collections.abc import Callable
from typing import TypeAlias

import msgspec
import numpy as np

from eutree.arrays import Booleans
from eutree.splitting import LeafSample, Split
from eutree.validation import check_number


class AnyGain(msgspec.Struct, frozen=True, tag=True):
    """Every significant cut is made, as in Table 1 of the paper."""

    def admits(self, gain: Callable[[], float], steps: int) -> bool:
        """Return that a cut is made.

        Args:
            gain: What the policy is expected to gain by it, in return for each step.
            steps: Steps since the last split, or since the start.
        """
        return True


class ConservativeImprovement(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """A cut is made if it gains more than a threshold that decays (Roth et al. 2019).

    Attributes:
        threshold: Gain, in return for each step, that is asked for just after a split.
        decay: What the threshold is multiplied by in every step without a split.
    """

    threshold: float = 1.0
    decay: float = 0.9999

    def __post_init__(self) -> None:
        check_number("threshold", self.threshold, low=0.0)
        check_number("decay", self.decay, low=0.0, high=1.0, low_open=True)

    def admits(self, gain: Callable[[], float], steps: int) -> bool:
        """Return whether the gain exceeds the threshold after so many steps."""
        return gain() > self.threshold * self.decay**steps


SplitGate: TypeAlias = AnyGain | ConservativeImprovement


def expected_gain(split: Split, sample: LeafSample, greedy: int, share: float) -> float:
    """Return what the policy is expected to gain by a cut, in return for each step.

    Args:
        split: The cut.
        sample: What left the leaf.
        greedy: The leaf's own best action a*.
        share: Share of all visits that are the leaf's.
    """
    left = sample.observations[:, split.feature] <= split.threshold
    whole = _mean(sample, greedy, np.ones(len(left), dtype=np.bool_))
    if np.isnan(whole):
        return 0.0  # nothing is known of what it would be better than
    gain = 0.0
    for side in (left, ~left):
        kept = _mean(sample, greedy, side)
        kept = whole if np.isnan(kept) else kept
        tried = np.unique(sample.actions[side]).tolist()
        best = max([kept, *(_mean(sample, action, side) for action in tried)])
        gain += float(side.mean()) * (best - kept)
    return share * gain


def _mean(sample: LeafSample, action: int, rows: Booleans) -> float:
    """Return the mean q of an action's transitions among ``rows``; NaN where there is none."""
    returns = sample.returns[rows & (sample.actions == action)]
    return float(returns.mean()) if returns.size else float("nan")
