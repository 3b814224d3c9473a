"""What the demonstrator has reached, and whether a tree reaches as much."""

import math
from dataclasses import dataclass

import numpy as np

from eutree.data import Demonstrations
from eutree.evaluation import Evaluation

MARGIN = 0.03  # of the success rate, or of the size of the mean return, that counts as the same


@dataclass(frozen=True)
class Person:
    """The demonstrator's own result.

    Attributes:
        success_rate: Share of successes; None if nothing says so.
        mean_return: Mean return; NaN if no episode is finished.
        episodes: How many finished.
    """

    success_rate: float | None
    mean_return: float
    episodes: int

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> "Person":
        """Return the result of the kept episodes that the task or its time limit ended."""
        ended = [episode for episode in demonstrations if episode.terminated or episode.truncated]
        if not ended:
            return cls(None, math.nan, 0)
        successes = [episode.is_success for episode in ended]
        rate = None if None in successes else float(np.mean(np.array(successes)))
        return cls(rate, float(np.mean([e.undiscounted_return for e in ended])), len(ended))

    def is_above(self, tree: Evaluation) -> bool:
        """Return whether a tree falls short of the person by more than ``MARGIN``."""
        if self.success_rate is not None and tree.success_rate is not None:
            return tree.success_rate < self.success_rate - MARGIN
        return tree.mean_return < self.mean_return - MARGIN * abs(self.mean_return)
