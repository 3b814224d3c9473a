"""Results of evaluations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Integers, freeze
from eutree.contests import bounds_of_change
from eutree.data import Episode
from eutree.display import Displayed, counted, fixed
from eutree.errors import InvalidArgumentError
from eutree.validation import check_integer, check_number, check_vector, data_frame

# Over learning runs, which are few and far from normal, use SciPy's bootstrap.
#
# References: E. B. Wilson, *Probable inference, the law of succession, and statistical
# inference*, JASA 22 (1927); M. Abramowitz, I. A. Stegun, *Handbook of Mathematical Functions*,
# 26.7.


NORMAL = NormalDist()
_MANY = 200  # degrees of freedom from which an expansion about the normal quantile is as good


class Interval(NamedTuple):
    """Both ends of an interval."""

    low: float
    high: float

    def __format__(self, spec: str) -> str:
        """Return it in brackets, both ends in one format: ``[0.12, 0.56]``."""
        return f"[{self.low:{spec}}, {self.high:{spec}}]"

    def around(self, mean: float, digits: int, sign: str = "") -> str:
        """Return a mean and its interval, in digits that say something: ``0.34 [0.12, 0.56]``."""
        spec = fixed(digits, self)
        return f"{mean:{sign}{spec}} {self:{spec}}"

    @property
    def percent(self) -> "Interval":
        """The interval of a share, in percent."""
        return Interval(100 * self.low, 100 * self.high)


@dataclass(frozen=True)
class Estimate:
    """A statistic with its interval.

    Attributes:
        value: The statistic itself.
        interval: Where it lies with the confidence asked for.
        n: How many runs, or pairs of runs, it is made of.
    """

    value: float
    interval: Interval
    n: int


def check_confidence(confidence: float) -> float:
    """Return the confidence as a number inside (0, 1), or raise."""
    return check_number("confidence", confidence, low=0, high=1, low_open=True, high_open=True)


def mean_interval(values: ArrayLike, *, confidence: float = 0.95) -> Interval:
    """Return Student's interval of a mean; a single value shows no spread and is its own."""
    sample = check_vector("values", values)
    confidence = check_confidence(confidence)
    center = float(sample.mean())
    if sample.size == 1:
        return Interval(center, center)
    quantile = student_quantile(0.5 + confidence / 2, sample.size - 1)
    spread = quantile * float(sample.std(ddof=1)) / math.sqrt(sample.size)
    return Interval(center - spread, center + spread)


def known_successes(reported: Sequence[bool | None]) -> Booleans | None:
    """Return which episodes were successes, shape [E]; None where none of them reports one.

    Where others do, one that does not was no success: it may have ended at a time limit.
    """
    if all(one is None for one in reported):
        return None
    return np.array([bool(one) for one in reported])


def wilson_interval(successes: int, n: int, *, confidence: float = 0.95) -> Interval:
    """Return Wilson's score interval of a share of successes among ``n`` trials.

    It stays inside [0, 1], and is right where all trials, or none, succeeded.
    """
    n = check_integer("n", n, low=1)
    successes = check_integer("successes", successes, high=n)
    z = NORMAL.inv_cdf(0.5 + check_confidence(confidence) / 2)
    share, weight = successes / n, z * z / n
    center = (share + weight / 2) / (1 + weight)
    spread = z * math.sqrt((share * (1 - share) + weight / 4) / n) / (1 + weight)
    low = 0.0 if successes == 0 else center - spread
    return Interval(low, 1.0 if successes == n else center + spread)


def student_quantile(probability: float, freedom: int) -> float:
    """Return a quantile of Student's t with ``freedom`` degrees of freedom."""
    freedom = check_integer("freedom", freedom, low=1)
    check_number("probability", probability, low=0, high=1, low_open=True, high_open=True)
    if freedom > _MANY:
        z = NORMAL.inv_cdf(probability)
        first = (z**3 + z) / 4
        second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
        third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
        return z + first / freedom + second / freedom**2 + third / freedom**3
    low, high = -math.pi / 2, math.pi / 2
    for _ in range(60):
        middle = (low + high) / 2
        if _student_cdf(middle, freedom) < probability:
            low = middle
        else:
            high = middle
    return math.sqrt(freedom) * math.tan((low + high) / 2)


def _student_cdf(angle: float, freedom: int) -> float:
    """Return P(T <= t) for angle = arctan(t / sqrt(freedom)) (Abramowitz & Stegun 26.7.3, 4)."""
    odd = freedom % 2
    powers = np.arange(odd + 2, freedom, 2)  # of the cosine, after the first
    factors = np.cumprod((powers - 1) / powers) * np.cos(angle) ** powers
    if odd:
        series = math.cos(angle) * (freedom > 1) + float(factors.sum())
        inside = 2 / math.pi * (angle + math.sin(angle) * series)
    else:
        inside = math.sin(angle) * (1.0 + float(factors.sum()))
    return 0.5 + inside / 2


COCHRAN = 25


class Earned:
    """Returns and successes of some episodes."""

    returns: Floats  # [E]; undiscounted return of each episode
    # Whether each was a success; None where the environment reports none
    successes: Booleans | None  # [E]

    @property
    def mean_return(self) -> float:
        """Mean undiscounted return."""
        return float(self.returns.mean())

    @property
    def return_interval(self) -> Interval:
        """95 % interval of the mean return, by Student's t; one episode shows no spread."""
        return mean_interval(self.returns)

    @property
    def success_rate(self) -> float | None:
        """Share of successful episodes; None where the environment reports none."""
        return None if self.successes is None else float(self.successes.mean())

    @property
    def counted_successes(self) -> Booleans:
        """Whether each was a success, shape [E]; none was where none is reported."""
        return np.zeros(self.returns.size, bool) if self.successes is None else self.successes

    @property
    def success_interval(self) -> Interval | None:
        """95 % interval of the success rate, by Wilson's formula; None without successes."""
        if self.successes is None:
            return None
        return wilson_interval(int(self.successes.sum()), self.successes.size)


@dataclass(frozen=True, eq=False)
class Evaluation(Earned, Displayed):
    """Results of an evaluation, episode by episode.

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
        freeze(self, "returns", dtype=np.float64)
        freeze(self, "lengths", dtype=np.int64)
        freeze(self, "endings", dtype=np.str_)
        sizes = {self.returns.shape, self.lengths.shape, self.endings.shape}
        if self.successes is not None:
            freeze(self, "successes", dtype=bool)
            sizes.add(self.successes.shape)
        if len(sizes) != 1 or self.returns.ndim != 1 or not self.returns.size:
            raise InvalidArgumentError(
                f"an evaluation must have vectors of one size >= 1, got shapes {sorted(sizes)}"
            )

    @classmethod
    def of(cls, played: Sequence[Episode], n_leaves: int | None = None) -> "Evaluation":
        """Return the evaluation of recorded episodes, at least one; unknown returns are NaN."""
        successes = [episode.is_success for episode in played]
        return cls(
            returns=np.array([e.undiscounted_return if e.has_rewards else np.nan for e in played]),
            lengths=np.array([len(episode) for episode in played]),
            endings=np.array([episode.ending or "" for episode in played]),
            successes=known_successes(successes),
            n_leaves=n_leaves,
        )

    def __repr__(self) -> str:
        """Return the evaluation in one line; the numbers themselves would be a page."""
        return f"<Evaluation: {self}>"

    def __str__(self) -> str:
        """Return the evaluation in one line, 95 % intervals in brackets; one episode has none."""
        success, earned = "", f"{self.mean_return:{fixed(2, [self.mean_return])}}"
        if self.episodes > 1 and np.isfinite(self.mean_return):
            earned = self.return_interval.around(self.mean_return, 2)
        if self.success_rate is not None and self.success_interval is not None:
            success = f"success {self.success_rate:.1%} {self.success_interval:.1%}, "
        leaves = "" if self.n_leaves is None else f", {counted(self.n_leaves, 'leaf')}"
        return (
            f"{counted(self.episodes, 'episode')}: {success}mean return {earned}, "
            f"{self.mean_length:.1f} steps{leaves}"
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
    def warning(self) -> str:
        """A warning where episodes are too few for such skewed returns; else "".

        The interval of a mean of n values is about right from n = 25 times their squared skewness
        on (W. G. Cochran, *Sampling Techniques*, 3rd ed., 1977, section 2.15).
        """
        if not np.isfinite(self.returns).all():  # some are unknown
            return ""
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
        unknown = all(part.successes is None for part in parts)
        return cls(
            returns=np.concatenate([part.returns for part in parts]),
            lengths=np.concatenate([part.lengths for part in parts]),
            endings=np.concatenate([part.endings for part in parts]),
            successes=None if unknown else np.concatenate([one.counted_successes for one in parts]),
            n_leaves=parts[0].n_leaves,
        )


@dataclass(frozen=True)
class Against:
    """The gain of a policy over another in the same episodes.

    Attributes:
        episodes: Episodes that both played.
        better: Those in which the policy earned more.
        worse: Those in which it earned less; in the others both earned the same.
        return_change: Mean of the policy minus the other.
        return_interval: Its 95 % interval by betting, true for any share of losses however rare, on
            the ``condition``.
        success_change: Mean of the difference of successes; None where none is reported.
        success_interval: Its 95 % interval, by betting.
        condition: Assumption of the interval, where the range of returns is not known; else "".
        policy: Evaluation of the policy.
        other: Evaluation of the other policy.
        name: Name of the other; "" where none was given.
    """

    episodes: int
    better: int
    worse: int
    return_change: float
    return_interval: Interval
    success_change: float | None
    success_interval: Interval | None
    condition: str
    policy: Evaluation
    other: Evaluation
    name: str = ""

    def __str__(self) -> str:
        """Return the other's results and the policy's gain over it, a line each."""
        return f"{self.name}: {self.other}\n{self.describe(self.name)}"

    def facts(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        success = self.success_interval
        shown = ("mean_return", "worst_return", "return_quantile_05", "success_rate", "n_leaves")
        return {
            "name": self.name,
            "episodes_compared": self.episodes,
            "better": self.better,
            "worse": self.worse,
            "return": self.return_change,
            "return_interval": list(self.return_interval),
            "success": self.success_change,
            "success_interval": None if success is None else list(success),
            "condition": self.condition,
            **{name: getattr(self.other, name) for name in shown},
        }

    def describe(self, name: str) -> str:
        """Return it in words; ``name`` is the other policy's."""
        words = f"return {self.return_interval.around(self.return_change, 2, '+')}"
        if self.success_change is not None and self.success_interval is not None:
            change = f"{100 * self.success_change:+.1f} % {self.success_interval.percent:.1f}"
            words += f", success {change}"
        words += (
            f" against {name}: better in {self.better} of {counted(self.episodes, 'episode')}, "
            f"worse in {self.worse}"
        )
        return f"{words}, {self.condition}" if self.condition else words


def against(
    policy: Evaluation,
    other: Evaluation,
    *,
    known: tuple[float, float] | None = None,
    seen: tuple[float, float] | None = None,
    name: str = "",
) -> Against:
    """Compare two evaluations on the same episodes: same environment, seed and count.

    Args:
        policy: Evaluation of the policy.
        other: Evaluation of the one beside it.
        known: Lowest and highest return that an episode can have; None if unknown.
        seen: Lowest and highest return of other episodes of the two, if there are any.
        name: Name of the other.

    Raises:
        InvalidArgumentError: They are not of as many episodes.
    """
    if policy.episodes != other.episodes:
        raise InvalidArgumentError(
            f"other must be of the same {policy.episodes} episodes, got {other.episodes}"
        )
    change = interval = None
    if policy.successes is not None or other.successes is not None:
        successes = np.stack([other.counted_successes, policy.counted_successes])
        bounds = bounds_of_change(successes.astype(np.float64), known=(0.0, 1.0))
        change, interval = bounds.mean, Interval(bounds.low, bounds.high)
    bounds = bounds_of_change(np.stack([other.returns, policy.returns]), known=known, seen=seen)
    return Against(
        episodes=policy.episodes,
        better=int((policy.returns > other.returns).sum()),
        worse=int((policy.returns < other.returns).sum()),
        return_change=bounds.mean,
        return_interval=Interval(bounds.low, bounds.high),
        success_change=change,
        success_interval=interval,
        condition=bounds.condition(),
        policy=policy,
        other=other,
        name=name,
    )
