"""What an evaluation measured."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Integers, frozen
from eutree.display import Displayed
from eutree.errors import InvalidArgumentError
from eutree.evaluation.intervals import Interval, mean_interval, wilson_interval
from eutree.frames import data_frame
from eutree.wording import counted

COCHRAN = 25


@dataclass(frozen=True, eq=False)
class Evaluation(Displayed):
    """What an evaluation measured, episode by episode.

    Attributes:
        returns: Undiscounted return of each episode.
        lengths: Steps of each episode.
        endings: Why each episode ended, in the environment's words.
        successes: Whether each episode was a success; None where the environment reports none.
        n_leaves: Leaves of the policy; None if it has none.
    """

    returns: Floats  # [E]
    lengths: Integers  # [E]
    endings: NDArray[np.str_]  # [E]
    successes: Booleans | None = None  # [E]
    n_leaves: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "returns", frozen(np.asarray(self.returns, dtype=np.float64)))
        object.__setattr__(self, "lengths", frozen(np.asarray(self.lengths, dtype=np.int64)))
        object.__setattr__(self, "endings", frozen(np.asarray(self.endings, dtype=np.str_)))
        sizes = {self.returns.shape, self.lengths.shape, self.endings.shape}
        if self.successes is not None:
            object.__setattr__(self, "successes", frozen(np.asarray(self.successes, dtype=bool)))
            sizes.add(self.successes.shape)
        if len(sizes) != 1 or self.returns.ndim != 1 or not self.returns.size:
            raise InvalidArgumentError(
                f"an evaluation must have vectors of one size >= 1, got shapes {sorted(sizes)}"
            )

    def __repr__(self) -> str:
        """Return the evaluation in one line; the numbers themselves would be a page."""
        return f"<Evaluation: {self}>"

    def __str__(self) -> str:
        """Return the evaluation in one line, with 95 % intervals in brackets."""
        low, high = self.return_interval
        success = ""
        if self.success_rate is not None and self.success_interval is not None:
            least, most = self.success_interval
            success = f"success {self.success_rate:.1%} [{least:.1%}, {most:.1%}], "
        leaves = "" if self.n_leaves is None else f", {counted(self.n_leaves, 'leaf')}"
        return (
            f"{counted(self.episodes, 'episode')}: {success}mean return {self.mean_return:.2f} "
            f"[{low:.2f}, {high:.2f}], {self.mean_length:.1f} steps{leaves}"
        )

    def to_pandas(self) -> Any:
        """Return a data frame with a row for each episode: return, length, ending, success."""
        columns = {"return": self.returns, "length": self.lengths, "ending": self.endings}
        if self.successes is not None:
            columns["success"] = self.successes
        return data_frame(columns, index={"episode": np.arange(self.episodes)})

    @property
    def episodes(self) -> int:
        """Number of episodes E."""
        return int(self.returns.size)

    @property
    def steps(self) -> int:
        """Number of steps in all episodes."""
        return int(self.lengths.sum())

    @property
    def mean_return(self) -> float:
        """Mean undiscounted return."""
        return float(self.returns.mean())

    @property
    def worst_return(self) -> float:
        """The lowest return of an episode."""
        return float(self.returns.min())

    @property
    def return_quantile_05(self) -> float:
        """The 5 % quantile of the returns: one episode in twenty returned no more."""
        return float(np.quantile(self.returns, 0.05, method="inverted_cdf"))

    @property
    def mean_length(self) -> float:
        """Mean number of steps."""
        return float(self.lengths.mean())

    @property
    def success_rate(self) -> float | None:
        """Share of successful episodes; None where the environment reports none."""
        return None if self.successes is None else float(self.successes.mean())

    @property
    def return_interval(self) -> Interval:
        """95 % interval of the mean return, by Student's t; one episode shows no spread."""
        return mean_interval(self.returns)

    @property
    def warning(self) -> str:
        """What is to be said where episodes are too few for such skewed returns; else "".

        The interval of a mean of n values is about right from n = 25 times their squared skewness
        on (W. G. Cochran, *Sampling Techniques*, 3rd ed., 1977, section 2.15).
        """
        spread = float(self.returns.std())
        if spread <= 1e-12 * max(float(np.abs(self.returns).max()), 1e-300):
            return ""
        skewness = float((((self.returns - self.mean_return) / spread) ** 3).mean())
        needed = math.ceil(COCHRAN * skewness**2)
        if self.episodes >= needed:
            return ""
        side = "bad" if skewness < 0 else "good"
        return (
            f"a few {side} episodes make much of the mean: its interval may be too narrow, ask for "
            f"{needed:,} episodes or more"
        )

    @property
    def extremes(self) -> str:
        """The worst episode and the 5 % quantile of the returns, in words."""
        return (
            f"worst episode {self.worst_return:.4g}, one in twenty at most "
            f"{self.return_quantile_05:.4g}"
        )

    @property
    def success_interval(self) -> Interval | None:
        """95 % interval of the success rate, by Wilson's formula; None without successes."""
        if self.successes is None:
            return None
        return wilson_interval(int(self.successes.sum()), self.episodes)

    def of_episodes(self, numbers: Sequence[int]) -> "Evaluation":
        """Return the evaluation of some of the episodes, by their numbers."""
        rows = np.asarray(numbers, dtype=np.int64)
        return Evaluation(
            self.returns[rows],
            self.lengths[rows],
            self.endings[rows],
            None if self.successes is None else self.successes[rows],
            self.n_leaves,
        )

    @classmethod
    def join(cls, parts: Sequence["Evaluation"]) -> "Evaluation":
        """Return the evaluation of all episodes of some evaluations of one policy, in order."""
        outcomes = [part.successes for part in parts]
        known = [outcome for outcome in outcomes if outcome is not None]
        return cls(
            returns=np.concatenate([part.returns for part in parts]),
            lengths=np.concatenate([part.lengths for part in parts]),
            endings=np.concatenate([part.endings for part in parts]),
            successes=np.concatenate(known) if len(known) == len(parts) else None,
            n_leaves=parts[0].n_leaves,
        )
