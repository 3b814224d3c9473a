"""Can this world model be trusted here? What it imagined of trees, and what they really earned."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.policy_search.rank_correlation import RankCorrelation, rank_correlation

FEWEST_TREES = 5  # four are in perfect order by chance once in 24 times


@dataclass(frozen=True, eq=False)
class ModelTrust:
    """How a world model orders the trees that were really run.

    Attributes:
        imagined: Each tree's score in the model.
        real: Its mean return in real episodes.
        episodes: How many of these there were.
    """

    imagined: Floats  # [n]
    real: Floats  # [n]
    episodes: Integers  # [n]

    @cached_property
    def correlation(self) -> RankCorrelation:
        """Spearman's rank correlation of both, with its 95 % interval."""
        return rank_correlation(self.imagined, self.real)

    @property
    def better_than_chance(self) -> bool:
        """Whether the interval lies above 0, and there are at least five trees."""
        return self.correlation.n >= FEWEST_TREES and self.correlation.better_than_chance

    def describe(self) -> str:
        """Return what can be said of the model in one sentence."""
        found = self.correlation
        if found.n < FEWEST_TREES or np.isnan(found.value):
            return (
                f"whether the world model can be trusted is not known: {found.n} of the trees "
                "that it judged were really run"
            )
        measured = (
            f"of {found.n} trees has rank correlation {found.value:.2f} "
            f"[{found.low:.2f}, {found.high:.2f}] with their real returns"
        )
        if found.better_than_chance:
            return f"the world model can be trusted here: its order {measured}"
        verdict = "worse than chance" if found.worse_than_chance else "no better than chance"
        return (
            f"the world model cannot be trusted here: its order {measured}, {verdict}; only "
            "trees that were clearly better in real episodes were adopted"
        )

    def figures(self) -> dict[str, float | int | list[float] | list[int]]:
        """Return all of it in JSON's types; nothing for fewer than three trees."""
        found = self.correlation
        if np.isnan(found.value):
            return {}
        return {
            "rank_correlation": found.value,
            "rank_correlation_low": found.low,
            "rank_correlation_high": found.high,
            "trees_compared": found.n,
            "imagined": self.imagined.tolist(),
            "real": self.real.tolist(),
            "real_episodes": self.episodes.tolist(),
        }
