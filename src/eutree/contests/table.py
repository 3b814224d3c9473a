"""The words of a contest: its table of returns, the next episodes, the verdict, and the bounds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from eutree.arrays import Floats
from eutree.contests.betting import lower_bound

Table = Floats  # [trees, starts] NaN where a tree has not run; row 0 is the incumbent


@dataclass(frozen=True)
class NextEpisodes:
    """Episodes to run next: those of each of these trees from each of these starts."""

    trees: tuple[int, ...]  # rows of the table
    starts: range  # columns of the table; an episode that the table holds already is not run again


@dataclass(frozen=True)
class Verdict:
    """The end of a contest."""

    winner: int  # row of the tree that has won
    # Whether the challenger's claim was shown, with the error that the rule allows; False where a
    # rule promises nothing, and where the incumbent stays
    shown: bool
    starts: range  # columns whose returns decided


class Rule(Protocol):
    """The rule of a contest: a function of the returns told so far, and of nothing else."""

    @property
    def most(self) -> int:
        """Most starts of the contest."""

    def next(self, table: Table) -> NextEpisodes | Verdict:
        """Return the episodes to run next, or who has won."""

    def stopped(self, table: Table) -> Verdict:
        """Return who has won where no more episodes can be run."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of the mean of challenger minus incumbent."""

    mean: float  # the mean of the pairs
    low: float  # lower bound
    high: float  # upper bound; each is wrong with the error asked for at most, whenever one looks
    # Lowest and highest return of an episode that this holds for, known or seen
    range: tuple[float, float]
    known: bool  # whether that range is known; else the bounds hold if no episode is outside of it

    def condition(self) -> str:
        """Return the condition of the bounds, as the end of a sentence; "" where there is none.

        >>> Bounds(1.0, 0.5, 1.5, (-12.4, 3.0), known=False).condition()
        'if no episode returns less than -12.4 or more than 3, the worst and the best seen'
        """
        if self.known:
            return ""
        low, high = self.range
        return (
            f"if no episode returns less than {low:g} or more than {high:g}, the worst and the "
            "best seen"
        )


def new_table(n_trees: int, n_starts: int) -> Table:
    """Return the table of a contest that has not begun."""
    return np.full((n_trees, n_starts), np.nan)


def pairs(table: Table) -> Floats:
    """Return the first challenger minus the incumbent at each start, up to the first not run."""
    gains: Floats = table[1] - table[0]
    unknown = np.isnan(gains)
    return gains[: int(unknown.argmax()) if unknown.any() else gains.size]


def seen_range(
    table: Table, known: tuple[float, float] | None, seen: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Return the lowest and highest return of an episode: as known, and wider if seen wider.

    ``seen`` are those of other episodes of the same trees. Where nothing is known and nothing
    was seen both are 0.
    """
    told = table[~np.isnan(table)]
    ends = [*(known or ()), *(seen or ())]
    if told.size:
        ends += [float(told.min()), float(told.max())]
    return (min(ends), max(ends)) if ends else (0.0, 0.0)


def bounds_of_change(
    table: Table,
    *,
    error: float = 0.05,
    known: tuple[float, float] | None = None,
    seen: tuple[float, float] | None = None,
) -> Bounds:
    """Return bounds of row 1's gain over row 0, true at any time and however rare losses.

    The table has the returns of both from common starts, shape [2, starts]. ``error`` is the chance
    that one of the two bounds is wrong, half of it for each; ``known`` the lowest and the highest
    return of an episode, where they are known, ``seen`` those of other episodes of the two.
    """
    gains = pairs(table)
    low, high = seen_range(table, known, seen)
    worst = low - high
    mean = float(gains.mean()) if gains.size else 0.0
    return Bounds(
        mean,
        lower_bound(gains, worst, error / 2),
        0.0 - lower_bound(-gains, worst, error / 2),  # no -0.0
        (low, high),
        known is not None and np.allclose((low, high), known),  # what was seen may refute it
    )


Run = Callable[[int, Sequence[int]], Floats | None]


def missing(table: Table, due: NextEpisodes) -> list[tuple[int, list[int]]]:
    """Return those of the due episodes that the table lacks: each tree with its starts."""
    return [
        (tree, starts.tolist())
        for tree in due.trees
        if (starts := np.flatnonzero(np.isnan(table[tree, : due.starts.stop]))).size
        and (starts := starts[starts >= due.starts.start]).size
    ]


def hold(rule: Rule, table: Table, run: Run) -> Verdict:
    """Return the verdict of a contest.

    The table has the returns known so far, shape [trees, starts], with as many starts as the rule
    may ask for; it is filled on the way. ``run`` runs a tree, by its row, from some starts, and
    returns the returns; None where the budget does not allow it, which ends the contest. It may be
    a run's own episodes, those of a simulator beside it, of a world model or of a log.
    """
    while isinstance(due := rule.next(table), NextEpisodes):
        for tree, starts in missing(table, due):
            returns = run(tree, starts)
            if returns is None:
                return rule.stopped(table)
            table[tree, starts] = returns
    return due


def next_episode(rule: Rule, table: Table) -> tuple[int, int] | None:
    """Return the next tree and start to run, start by start; None where the contest is over."""
    due = rule.next(table)
    if not isinstance(due, NextEpisodes):
        return None
    trees, starts = np.array(due.trees), table[list(due.trees), : due.starts.stop]
    unknown = np.isnan(starts[:, due.starts.start :])
    start = int(unknown.any(axis=0).argmax())
    return int(trees[unknown[:, start].argmax()]), due.starts.start + start
