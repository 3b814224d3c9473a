"""The result of a fit.

Both sides are samples, the demonstrator's a small one: 13 of 15 may be 63 or 96 %. So a word is
said only where the 95 % interval of the difference allows it. Of success rates that is Newcombe's,
made of the Wilson intervals of both sides (*Interval estimation for the difference between
independent proportions*, Statistics in Medicine 17, 1998, method 10); of mean returns, Welch's.
Successes are compared with successes and returns with returns, never one with the other.
"""

import math
import shlex
from dataclasses import dataclass

import numpy as np

from eutree.data import Demonstrations, Episode
from eutree.display import Displayed, counted
from eutree.evaluation import Evaluation, Interval, wilson_interval
from eutree.evaluation.evaluation import student_quantile
from eutree.policies import TreePolicy

MARGIN = 0.03  # of the success rate, or of the size of the mean return: no repair for less
BETTER, AS_GOOD, WORSE, OPEN = "better", "as good", "worse", "too close to tell"
INCOMPARABLE = "not comparable"
SUCCESS, RETURN = "success", "return"
UNKNOWN = Interval(math.nan, math.nan)
SAME = 0.05  # of the success rate, or of the size of the mean return: as good
CLEARLY_SHORTER = 2 / 3  # of the leaves
CLEARLY_BETTER = 0.05  # of the decisions left out


@dataclass(frozen=True, eq=False)
class Person:
    """The demonstrator's own result.

    Attributes:
        whole: The kept episodes that the task or its time limit ended; None if there is none. One
            that a person or a crash has ended says nothing of how it would have ended; one that a
            tree drove, or that began where a tree had failed, nothing of the person.
    """

    whole: Evaluation | None

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> "Person":
        """Return the result of the demonstrations."""
        ended = [episode for episode in demonstrations if episode.is_evidence]
        return cls(Evaluation.of(ended) if ended else None)

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

        A repair begins with that impression; ``eutree.fitting.report`` says whether it is so.
        """
        if self.success_rate is not None and tree.success_rate is not None:
            return tree.success_rate < self.success_rate - MARGIN
        return tree.mean_return < self.mean_return - MARGIN * abs(self.mean_return)


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

    The measure is by default successes where they are known, else returns.
    """
    if result is None:
        return "no episode played alone to its end"
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
    else:
        word = AS_GOOD if low >= -same else OPEN
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


@dataclass(frozen=True)
class Proposal:
    """A derived feature that is worth declaring (``eutree.fitting.combining``)."""

    declaration: str  # ``"left minus right = left - right"``
    leaves: tuple[int, int]  # of C4.5's tree without it and with it
    # Share of the decisions in episodes left out that trees without it and with it make as shown
    agreement: tuple[float, float]
    # Mean return without it and with it; None if neither was played
    played: tuple[float, float] | None = None
    taken: bool = False  # whether the tree was fitted with it

    @property
    def hint(self) -> str:
        """The gain that it would bring, and how to ask for it; empty where that is not much."""
        (before, after), (agreed, agrees) = self.leaves, self.agreement
        worth = after <= CLEARLY_SHORTER * before or agrees >= agreed + CLEARLY_BETTER
        if self.taken or self.played or not worth:
            return ""
        return (
            f"a feature `{self.declaration}` would make {after} leaves of {before}, with "
            f"{agrees:.1%} of the decisions left out in place of {agreed:.1%}: "
            f"--derive {shlex.quote(self.declaration)}"
        )

    def __str__(self) -> str:
        """Return whether it was taken and why, in one line."""
        (leaves, fewer), (agreed, agrees) = self.leaves, self.agreement
        what = "derived" if self.taken else "not derived" if self.played else "proposed"
        line = (
            f"{what} `{self.declaration}`: {fewer} leaves in "
            f"place of {leaves}, {agrees:.1%} of the decisions left out in place of {agreed:.1%}"
        )
        if self.played is None:
            return line
        return f"{line}, a mean return of {self.played[1]:.4g} in place of {self.played[0]:.4g}"


@dataclass(frozen=True, eq=False)
class FitReport(Displayed):
    """A tree made of demonstrations, and how good it is beside them.

    Attributes:
        policy: The fitted tree.
        person: The result of the demonstrator.
        played: The tree's fresh episodes; None if it was not played.
        choice: How the tree was made, in words.
        warnings: The faults to know before relying on it, in sentences; empty if all is well.
        n_transitions: Steps that were shown.
        training_accuracy: Share of them that the tree decides as shown.
        n_candidates: Trees that were compared.
        episodes_played: Episodes played in all: to choose, to repair, to judge, to practise.
        before_practice: The report of the tree that practice began with; None without practice.
        plays: The tree's episodes so far: ``eutree.fitting.playing`` goes on from them.
        proposals: Derived features that were tried, or that are worth declaring.
    """

    policy: TreePolicy
    person: Person
    played: Evaluation | None
    choice: str
    warnings: tuple[str, ...]
    n_transitions: int
    training_accuracy: float
    n_candidates: int
    episodes_played: int
    before_practice: "FitReport | None" = None
    plays: tuple[Episode, ...] = ()
    proposals: tuple[Proposal, ...] = ()

    @property
    def verdict(self) -> Standing | None:
        """How the tree compares with its demonstrator; None if it was not played."""
        return None if self.played is None else verdict(self.person.whole, self.played)

    def __str__(self) -> str:
        """Return the report in a few lines, without the tree."""
        lines = [
            f"{counted(self.policy.n_leaves, 'leaf')} from {self.n_transitions} steps; "
            f"{self.training_accuracy:.1%} of the actions shown"
        ]
        if self.played is not None and self.verdict is not None:
            measure = self.verdict.measure
            shown, tree = (result_in_words(s, measure) for s in (self.person.whole, self.played))
            lines.append(f"shown: {shown}; this tree: {tree}: {self.verdict.word}")
        made = f"made by {self.choice}"
        if self.n_candidates > 1:
            made += f", the best of {self.n_candidates} trees"
        if self.episodes_played:
            made += f"; {self.episodes_played} episodes played in all"
        tried = [str(one) for one in self.proposals if one.taken or one.played]
        hints = [one.hint for one in self.proposals[:1] if one.hint]
        warned = (f"WARNING: {text}" for text in self.warnings)
        return "\n".join([*lines, made, *tried, *warned, *hints])
