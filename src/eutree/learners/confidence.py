"""When a learner is unsure: its experience in a leaf does not decide between the actions.

Confident Execution asks for a demonstration where the policy has little to go by (Chernova &
Veloso, *Confidence-based policy learning from demonstration using Gaussian mixture models*, AAMAS
2007). Here that is a matter of the leaf: in it, the best action or some other has been tried fewer
than ``min_tried`` times, or the intervals of their mean q (Eq. 2) overlap.
``docs/decisions/confident-execution.md`` says what else was tried.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.validation import check_integer, check_number

FEW = "The tree has seen few situations like this."
UNDECIDED = "What the tree has tried in situations like this does not decide."


@dataclass(frozen=True, kw_only=True)
class Confidence:
    """How sure a learner must be not to ask.

    Attributes:
        min_tried: An action that was tried less often than this in a leaf is not known.
        width: Half the width of the interval of a mean q, in standard errors.
    """

    min_tried: int = 10
    width: float = 1.96

    def __post_init__(self) -> None:
        check_integer("min_tried", self.min_tried, low=2)
        check_number("width", self.width, low=0.0)


def doubt(
    returns: Floats, actions: Integers, best: int, n_actions: int, confidence: Confidence
) -> str:
    """Return why the experience in a leaf does not decide for the action ``best``, or "".

    Args:
        returns: q of each transition that left the leaf, shape [n].
        actions: Its action, shape [n].
        best: The action that the leaf chooses.
        n_actions: Number of actions A.
        confidence: How much is asked for.
    """
    means, errors = np.empty(n_actions), np.empty(n_actions)
    for action in range(n_actions):
        mine = returns[actions == action]
        if mine.size < confidence.min_tried:
            return FEW
        means[action] = mine.mean()
        errors[action] = mine.std(ddof=1) / np.sqrt(mine.size)
    low = means[best] - confidence.width * errors[best]
    high = np.delete(means + confidence.width * errors, best)
    return UNDECIDED if high.size and low <= high.max() else ""
