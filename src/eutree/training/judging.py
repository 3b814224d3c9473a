"""What a run gained against its start: both policies on the same fresh episodes."""

from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import msgspec

from eutree.evaluation import Evaluation, Interval, against
from eutree.wording import counted

LEARNED: Literal["learned"] = "learned"
START: Literal["start"] = "start"


@dataclass(frozen=True)
class JudgedTree:
    """What one of the two trees did.

    Attributes:
        n_leaves: Its leaves.
        mean_return: Mean return.
        return_interval: Its 95 % interval (Student's).
        worst: The worst return of all episodes.
        quantile_05: One episode in twenty returned no more.
        success_rate: Share of successes; None where none is reported.
        success_interval: Its 95 % interval (Wilson's).
    """

    n_leaves: int
    mean_return: float
    return_interval: Interval
    worst: float
    quantile_05: float
    success_rate: float | None = None
    success_interval: Interval | None = None

    @classmethod
    def of(cls, evaluation: Evaluation, n_leaves: int) -> "JudgedTree":
        """Return what an evaluation says."""
        return cls(
            n_leaves,
            evaluation.mean_return,
            evaluation.return_interval,
            evaluation.worst_return,
            evaluation.return_quantile_05,
            evaluation.success_rate,
            evaluation.success_interval,
        )

    def describe(self) -> str:
        """Return it in words, intervals in brackets."""
        success = ""
        if self.success_rate is not None and self.success_interval is not None:
            low, high = self.success_interval
            success = f"{self.success_rate:.1%} [{low:.1%}, {high:.1%}], "
        low, high = self.return_interval
        return (
            f"{counted(self.n_leaves, 'leaf')}, {success}return {self.mean_return:.1f} "
            f"[{low:.1f}, {high:.1f}], worst {self.worst:.1f}"
        )


_SAID = {  # names of facts in events.jsonl
    "episodes": "episodes_compared",
    "return_change": "return",
    "success_change": "success",
    "steps": "steps_of_judging",
}


@dataclass(frozen=True)
class Judgement:
    """The learned tree of a run against its start.

    Attributes:
        episodes: Episodes that both played; 0 where both decide the same.
        return_change: Mean of learned minus start.
        return_interval: Its 95 % interval, true for any share of losses however rare (betting), on
            the ``condition``.
        success_change: Mean of the difference of successes; None where none is reported.
        success_interval: Its 95 % interval, by betting.
        challengers: Trees that were put to the test on the way.
        start: What the start did; None where nothing was played.
        learned: What the learned tree did; None where nothing was played.
        steps: Environment steps of both, where they decide what is handed over; else 0.
        handed_over: "learned" or "start".
        why: Why that one, in words.
        condition: What the interval of the return depends on, where the range of returns is not
            known; else "".
    """

    episodes: int
    return_change: float
    return_interval: Interval
    success_change: float | None = None
    success_interval: Interval | None = None
    challengers: int = 0
    start: JudgedTree | None = None
    learned: JudgedTree | None = None
    steps: int = 0
    handed_over: Literal["learned", "start"] = LEARNED
    why: str = ""
    condition: str = ""

    @classmethod
    def same(cls, *, challengers: int) -> "Judgement":
        """Return the judgement of a run that ends with the policy it started from."""
        return cls(0, 0.0, Interval(0.0, 0.0), challengers=challengers)

    @property
    def is_start(self) -> bool:
        """Whether the result decides as the start does."""
        return self.episodes == 0

    def of_proven(self, start: bool, learned: bool) -> "Judgement":
        """Return the same, but that of the two trees the only one that is proven is handed over."""
        if start == learned:
            return self
        return replace(self, handed_over=LEARNED if learned else START, why="it alone is proven")

    def facts(self) -> dict[str, Any]:
        """Return the judgement in JSON's types."""
        return {_SAID.get(name, name): fact for name, fact in msgspec.to_builtins(self).items()}

    @classmethod
    def from_facts(cls, facts: dict[str, Any]) -> "Judgement":
        """Take back ``facts()``, also those of a run before version 0.3."""
        known = {one.name: _SAID.get(one.name, one.name) for one in fields(cls)}
        given = {name: facts[said] for name, said in known.items() if said in facts}
        return msgspec.convert(given, cls, strict=False)

    def describe(self, start: str) -> str:
        """Return the judgement in words; ``start`` names the policy that it began with."""
        if self.is_start:
            tried = f": {counted(self.challengers, 'challenger')} tried" if self.challengers else ""
            return f"nothing better than {start} was found{tried}"
        words = f"return {_signed(self.return_change, self.return_interval, 1.0, '')}"
        if self.success_change is not None and self.success_interval is not None:
            words += f", success {_signed(self.success_change, self.success_interval, 100.0, ' %')}"
        words += f" against {start}, on {self.episodes} episodes of their own"
        return f"{words}, {self.condition}" if self.condition else words

    def verdict(self) -> str:
        """Return which tree is handed over and how both did, in a sentence; "" if not played."""
        if self.start is None or self.learned is None:
            return ""
        both = (self.learned, self.start)
        taken, other = both if self.handed_over == LEARNED else both[::-1]
        name = "start" if self.handed_over == LEARNED else "learned"
        words = f"handed over: {taken.describe()} of {self.episodes:,}; {name}: {other.describe()}"
        if self.handed_over == START:
            words += f". The start is handed over, because {self.why}"
        return words


def judged(
    start: Evaluation,
    learned: Evaluation,
    *,
    known: tuple[float, float] | None = None,
    challengers: int = 0,
    sizes: tuple[int, int] | None = None,
) -> Judgement:
    """Return the judgement of two evaluations on the same episodes.

    Args:
        start: What the start did.
        learned: What the learned tree did.
        known: Lowest and highest return of an episode; None where they are not known.
        challengers: Trees that were put to the test.
        sizes: Leaves of both; by default as the evaluations say.
    """
    found = against(learned, start, known=known)
    sizes = sizes or (start.n_leaves or 0, learned.n_leaves or 0)
    return Judgement(
        episodes=found.episodes,
        return_change=found.return_change,
        return_interval=found.return_interval,
        success_change=found.success_change,
        success_interval=found.success_interval,
        challengers=challengers,
        start=JudgedTree.of(start, sizes[0]),
        learned=JudgedTree.of(learned, sizes[1]),
        condition=found.condition,
    )


def _signed(value: float, interval: Interval, scale: float, unit: str) -> str:
    low, high = (scale * end for end in interval)
    return f"{scale * value:+.1f}{unit} [{low:.1f}, {high:.1f}]"
