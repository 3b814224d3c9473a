"""What the demonstrator has reached, and whether a tree is to be repaired because of it."""

import math
from dataclasses import dataclass

import numpy as np

from eutree.data import Demonstrations
from eutree.evaluation import Evaluation, Interval

MARGIN = 0.03  # of the success rate, or of the size of the mean return: no repair for less


@dataclass(frozen=True, eq=False)
class Person:
    """The demonstrator's own result.

    Attributes:
        whole: The kept episodes that the task or its time limit ended; None if there is none. One
            that a person or a crash has ended says nothing of how it would have ended.
    """

    whole: Evaluation | None

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> "Person":
        """Return the result of the demonstrations."""
        ended = [episode for episode in demonstrations if episode.terminated or episode.truncated]
        if not ended:
            return cls(None)
        successes = [episode.is_success for episode in ended]
        known = None if None in successes else np.array(successes, dtype=bool)
        return cls(
            Evaluation(
                returns=np.array([episode.undiscounted_return for episode in ended]),
                lengths=np.array([len(episode) for episode in ended]),
                endings=np.array([episode.ending or "" for episode in ended]),
                successes=known,
            )
        )

    @property
    def episodes(self) -> int:
        """How many episodes were played to their end."""
        return 0 if self.whole is None else self.whole.episodes

    @property
    def success_rate(self) -> float | None:
        """Share of successes; None if nothing says so."""
        return None if self.whole is None else self.whole.success_rate

    @property
    def mean_return(self) -> float:
        """Mean return; NaN if no episode is whole."""
        return math.nan if self.whole is None else self.whole.mean_return

    @property
    def success_interval(self) -> Interval | None:
        """95 % interval of the success rate; None if it is unknown."""
        return None if self.whole is None else self.whole.success_interval

    @property
    def return_interval(self) -> Interval | None:
        """95 % interval of the mean return; None for fewer than two returns, or unknown ones."""
        known = self.whole is not None and np.isfinite(self.whole.returns).all()
        return self.whole.return_interval if self.whole and known and self.episodes > 1 else None

    def is_above(self, tree: Evaluation) -> bool:
        """Return whether a tree falls short of the person by more than ``MARGIN``, as it seems.

        That is what a repair begins with; whether it is so is said by ``eutree.fitting.verdict``.
        """
        if self.success_rate is not None and tree.success_rate is not None:
            return tree.success_rate < self.success_rate - MARGIN
        return tree.mean_return < self.mean_return - MARGIN * abs(self.mean_return)
