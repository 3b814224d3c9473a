"""Halving, Better and NotWorse: many trees to few, and two trees against each other.

Better and NotWorse test the mean difference of paired returns by betting
(:mod:`eutree.contests.betting`): where the range of returns is known a challenger that does not
deserve it wins with probability ``error`` at most, whatever the returns are like and although the
rule looks after every pair. Where it is not known the range seen stands for it, and nothing is
shown on fewer than ``blind`` pairs: losses rarer than once in a third of them may not have been
seen.

Reference for Halving: Z. Karnin, T. Koren, O. Somekh, *Almost optimal exploration in multi-armed
bandits*, ICML 2013.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats
from eutree.contests.betting import log_wealth_path
from eutree.contests.table import Heat, Table, Verdict, pairs, seen_range

FIRST = 32  # pairs before a challenger is called hopeless
HOPELESS = 2.33  # standard errors: 99 %, one-sided
GROWTH = 1.5  # of the pairs from one heat to the next
BLIND = 300  # pairs
GUESS = 64  # episodes that a guess counts for


@dataclass(frozen=True, kw_only=True)
class Halving:
    """Many trees to few: all run, the worse half leaves, those left run twice as many starts.

    It promises nothing: the winner of many is flattered by being the winner.

    Attributes:
        first: Starts of the first round.
        most: Most starts of a tree.
        keep: Trees that are left at the end; the verdict names the best of them.
        prices: Return that each tree has to earn for its leaves; empty for none.
        guesses: Return that each tree is guessed to earn; empty for none. A guess counts for as
            much as ``GUESS`` episodes: luck is less then, of which the first rounds are full.
    """

    first: int = 8
    most: int = 512
    keep: int = 1
    prices: tuple[float, ...] = ()
    guesses: tuple[float, ...] = ()

    def next(self, table: Table) -> Heat | Verdict:
        """Return the next round, or the best of those left."""
        alive, n, _ = self.standing(table)
        if np.isnan(table[list(alive), :n]).any():
            return Heat(tuple(sorted(alive)), range(n))
        return Verdict(alive[0], False, range(n))

    def stopped(self, table: Table) -> Verdict:
        """Return the best by the last round that all who were in it have run."""
        alive, _, known = self.standing(table)
        return Verdict(alive[0], False, range(known))

    def standing(self, table: Table) -> tuple[tuple[int, ...], int, int]:
        """Return who is left, the best first, the starts they run, and those all of them ran."""
        alive, n, known = tuple(range(len(table))), min(self.first, self.most), 0
        while not np.isnan(table[list(alive), :n]).any():
            means = table[:, :n].mean(axis=1)
            if self.guesses:
                means = (n * means + GUESS * np.array(self.guesses)) / (n + GUESS)
            means = means - (np.array(self.prices) if self.prices else 0.0)
            alive, known = tuple(sorted(alive, key=lambda one: (-means[one], one))), n
            if len(alive) <= self.keep and (self.keep == 1 or n >= self.most):
                break
            alive = alive[: max((len(alive) + 1) // 2, self.keep)]
            if n >= self.most:
                alive = alive[: self.keep]
                break
            n = min(2 * n, self.most)
        return alive, n, known


@dataclass(frozen=True, kw_only=True)
class NotWorse:
    """A challenger wins if it is shown to earn no less than the incumbent by more than a margin.

    Attributes:
        margin: How much less it may earn on average.
        error: Chance that a challenger that earns less than that wins nevertheless.
        most: Most pairs; after them the incumbent stays.
        known: Lowest and highest return of an episode; None where they are not known.
        blind: Pairs below which nothing is shown where they are not known.
        stake: Tuned on starts that are none of this contest; None for none.
    """

    margin: float
    error: float = 0.05
    most: int = 1000
    known: tuple[float, float] | None = None
    blind: int = BLIND
    stake: float | None = None

    def next(self, table: Table) -> Heat | Verdict:
        """Return more pairs to run; or who has won, once that is shown or hopeless."""
        gains = pairs(table[:, : self.most])
        n = gains.size
        if (at := self.shown_after(gains, seen_range(table, self.known))) is not None:
            return Verdict(1, True, range(at))
        if n >= self.most or self._hopeless(gains):
            return Verdict(0, False, range(n))
        return Heat((0, 1), range(min(max(FIRST, math.ceil(GROWTH * n)), self.most)))

    def stopped(self, table: Table) -> Verdict:
        """Return the incumbent: nothing was shown."""
        return Verdict(0, False, range(pairs(table).size))

    def shown_after(self, gains: Floats, bounds: tuple[float, float]) -> int | None:
        """Return after how many pairs it was shown; None if it is not."""
        worst = bounds[0] - bounds[1]
        blind = 0 if self.known is not None else min(self.blind, self.most)
        if gains.size < max(blind, 1) or (worst == 0.0 and self.margin == 0.0):
            return None
        if worst >= -self.margin and self.known is not None:
            return 1
        worst = min(worst, -2 * self.margin)  # a narrow range that was seen proves nothing
        wealth = log_wealth_path(gains, -self.margin, worst, self.stake)
        enough = wealth >= -math.log(self.error)
        enough[: blind - 1 if blind else 0] = False
        return int(enough.argmax()) + 1 if enough.any() else None

    def _hopeless(self, gains: Floats) -> bool:
        """Return whether the challenger is clearly below the margin."""
        if gains.size < FIRST:
            return False
        reach = HOPELESS * float(gains.std(ddof=1)) / math.sqrt(gains.size)
        mean = float(gains.mean()) + self.margin
        return mean + reach < 0.0 or (gains.size >= self.most // 2 and mean <= 0.0)


@dataclass(frozen=True, kw_only=True)
class Better(NotWorse):
    """A challenger wins if it is shown to earn more than the incumbent; else the incumbent stays.

    It gives up where the challenger is clearly behind, and at half of the pairs where it is not
    ahead.
    """

    margin: float = 0.0


def best(table: Table, sizes: Sequence[int]) -> int:
    """Return the tree that earned most, the smaller of equals, the first of equal ones.

    It is flattered by being the best, and nothing is promised of it.
    """
    means = table.mean(axis=1)
    return min(range(len(table)), key=lambda one: (-means[one], sizes[one], one))
