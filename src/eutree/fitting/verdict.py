"""Whether a tree does as well as its demonstrator: one rule, and its words.

Both sides are samples, the demonstrator's a small one: 13 of 15 may be 63 or 96 %. So a word is
said only where the 95 % interval of the difference allows it. Of success rates that is Newcombe's,
made of the Wilson intervals of both sides (*Interval estimation for the difference between
independent proportions*, Statistics in Medicine 17, 1998, method 10); of mean returns, Welch's.
Successes are compared with successes and returns with returns, never one with the other.
"""

import math
from dataclasses import dataclass

import numpy as np

from eutree.evaluation import Evaluation, Interval, wilson_interval
from eutree.evaluation.intervals import student_quantile
from eutree.wording import counted

BETTER, AS_GOOD, WORSE, OPEN = "better", "as good", "worse", "too close to tell"
INCOMPARABLE = "not comparable"
SUCCESS, RETURN = "success", "return"
UNKNOWN = Interval(math.nan, math.nan)
SAME = 0.05  # of the success rate, or of the size of the mean return: as good


@dataclass(frozen=True)
class Standing:
    """How a tree compares with its demonstrator.

    Attributes:
        word: ``"better"``, ``"as good"`` (at most ``SAME`` below), ``"worse"``, ``"too close to
            tell"``, or ``"not comparable"`` where there is no measure of both.
        measure: ``"success"``, ``"return"``, or empty where there is none of both.
        difference: The tree's mean less the demonstrator's; NaN where there is no measure.
        interval: 95 % interval of the difference.
    """

    word: str
    measure: str
    difference: float = math.nan
    interval: Interval = UNKNOWN

    @property
    def is_worse(self) -> bool:
        """Whether the tree is worse, beyond doubt."""
        return self.word == WORSE

    @property
    def is_open(self) -> bool:
        """Whether chance may hide that the tree is worse."""
        return self.word == OPEN


def verdict(shown: Evaluation | None, tree: Evaluation) -> Standing:
    """Return how a tree compares with the whole episodes of its demonstrator, None without any."""
    if shown is None:
        return Standing(INCOMPARABLE, "")
    if shown.successes is not None and tree.successes is not None:
        return _judged(SUCCESS, _of_rates(shown, tree), SAME)
    if not (_has_returns(shown) and _has_returns(tree)):
        return Standing(INCOMPARABLE, "")
    return _judged(RETURN, _of_means(shown, tree), SAME * abs(shown.mean_return))


def result_in_words(result: Evaluation | None, measure: str = "") -> str:
    """Return the result of one side with its range: ``13 of 15 (62 to 97 %)``.

    Args:
        result: The episodes; None if there is none.
        measure: What is compared; by default successes where they are known, else returns.
    """
    if result is None:
        return "no whole episode"
    if measure != RETURN and result.successes is not None and result.success_interval is not None:
        low, high = result.success_interval
        ends = f"{math.floor(100 * low + 1e-9)} to {math.ceil(100 * high - 1e-9)} %"
        return f"{int(result.successes.sum())} of {result.episodes} ({ends})"
    episodes = counted(result.episodes, "episode")
    if not _has_returns(result):
        return f"unknown returns in {episodes}"
    if result.episodes == 1:
        return f"{result.mean_return:.4g} in one episode"
    low, high = result.return_interval
    return f"{result.mean_return:.4g} on average ({low:.4g} to {high:.4g}) in {episodes}"


def _judged(measure: str, found: tuple[float, Interval], same: float) -> Standing:
    difference, (low, high) = found
    if low > 0.0:
        word = BETTER
    elif high < 0.0 and difference < -same:
        word = WORSE
    elif low >= -same:
        word = AS_GOOD
    else:
        word = OPEN
    return Standing(word, measure, difference, Interval(low, high))


def _of_rates(shown: Evaluation, tree: Evaluation) -> tuple[float, Interval]:
    """Return the difference of two success rates and its interval by Newcombe's method 10."""
    (q, below_q, above_q), (p, below_p, above_p) = map(_rate, (shown, tree))
    difference = p - q
    return difference, Interval(
        difference - math.hypot(p - below_p, above_q - q),
        difference + math.hypot(above_p - p, q - below_q),
    )


def _rate(result: Evaluation) -> tuple[float, float, float]:
    """Return a success rate and both ends of its interval."""
    successes = 0 if result.successes is None else int(result.successes.sum())
    return successes / result.episodes, *wilson_interval(successes, result.episodes)


def _of_means(shown: Evaluation, tree: Evaluation) -> tuple[float, Interval]:
    """Return the difference of two mean returns and its interval by Welch's t."""
    difference = tree.mean_return - shown.mean_return
    counts = np.array([shown.episodes, tree.episodes])
    if counts.min() == 1:  # one episode shows no spread
        return difference, Interval(-math.inf, math.inf)
    parts = np.array([result.returns.var(ddof=1) for result in (shown, tree)]) / counts
    if not parts.any():
        return difference, Interval(difference, difference)
    freedom = parts.sum() ** 2 / (parts**2 / (counts - 1)).sum()
    spread = student_quantile(0.975, max(1, int(freedom))) * math.sqrt(parts.sum())
    return difference, Interval(difference - spread, difference + spread)


def _has_returns(result: Evaluation) -> bool:
    return bool(np.isfinite(result.returns).all())
