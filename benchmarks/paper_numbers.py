"""The numbers that the paper states, and the range in which ours agrees with each.

Written down before anything was searched: docs/results/search.md.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Number:
    """A number that the paper states.

    Attributes:
        name: What it is.
        paper: The paper's, as text.
        low: Least of ours that agrees.
        high: Most of ours that agrees.
    """

    name: str
    paper: str
    low: float = -np.inf
    high: float = np.inf

    def missed_by(self, value: float) -> float:
        """Return how far our number is outside of the range; 0 if it agrees."""
        return max(self.low - value, value - self.high, 0.0)


NUMBERS = (
    Number("expert tree: states", "9", low=7, high=11),
    Number("expert tree: reward", "82", low=77, high=87),
    Number("expert tree: success in 2-Evasion", "1", low=0.995),
    Number("expert tree: success in 3-Evasion", "1", low=0.995),
    Number("expert tree: success with slower opponents", "about 1", low=0.95),
    Number("expert tree: success at 4.2 m/s", "about 0.5", low=0.4, high=0.65),
    Number("C. U-Tree: states", "167", low=117, high=217),
    Number("C. U-Tree: reward", "50", low=45, high=55),
    Number("EU-Tree: states", "30", low=20, high=40),
    Number("EU-Tree: reward", "80", low=75, high=85),
    Number("states, C. U-Tree over EU-Tree", "5.6", low=2),
    Number("states at the end, C. U-Tree over EU-Tree", "5.6", low=2),
    Number("reward, EU-Tree minus C. U-Tree", "30", low=0),
    Number("reward, expert tree minus EU-Tree", "2", low=0, high=5),
    Number("states, EU-Tree minus expert tree", "21", low=0),
    Number("share of trials in 2-Evasion", "< 0.5", high=0.5),
    Number("EU-Tree minus EU-Tree - DT in 2-Evasion", "0", low=-0.05, high=0.05),
    Number("smallest lead in 2-Evasion", "> 0", low=0),
    Number("C. U-Tree: success in 2-Evasion", "1", low=0.95),
    Number("EU-Tree: success in 2-Evasion", "1", low=0.95),
    Number("share of trials in 3-Evasion", "< 0.5", high=0.5),
    Number("EU-Tree minus EU-Tree - DT in 3-Evasion", "0", low=-0.05, high=0.05),
    Number("smallest lead in 3-Evasion", "> 0", low=0),
    Number("C. U-Tree: success in 3-Evasion", "1", low=0.95),
    Number("EU-Tree: success in 3-Evasion", "1", low=0.95),
    Number("curve at the worst speed minus C. U-Tree", ">= 0", low=-0.02),
    Number("curve near 3.2 m/s minus further away", "> 0", low=0),
    Number("rank correlation of quality and time", "< 0", high=-0.1),
    Number("compression", "< 0.5", high=0.5),
)
