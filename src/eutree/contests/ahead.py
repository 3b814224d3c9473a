"""Ahead and AheadApart: the quick rules, by which a run adopts a tree while it gathers.

What acts is how a run explores, so it may change soon, on a lead of some standard errors. These
rules look again and again and promise nothing. What a run hands over has to stand a contest by
``Better`` or ``NotWorse`` on fresh episodes.
"""

import math
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats
from eutree.contests.table import Heat, Table, Verdict, pairs, seen_range

ENOUGH = 32  # pairs that show which of two trees earns more
# Standard errors at which so few pairs are enough: Student's t that is exceeded once in 1,000.
OBVIOUS = {8: 4.79, 16: 3.73}
BEHIND = 1.0  # standard errors behind that end a patient contest


@dataclass(frozen=True)
class Lead:
    """By how much a challenger is ahead of the incumbent.

    Attributes:
        mean: Mean of challenger minus incumbent.
        error: Its standard error; infinite for fewer than two pairs.
        pairs: Starts that both have run.
    """

    mean: float
    error: float
    pairs: int

    @classmethod
    def of(cls, gains: Floats) -> "Lead":
        """Return the lead that paired gains show, shape [n]."""
        if gains.size < 2:
            return cls(float(gains.sum()), math.inf, gains.size)
        error = float(gains.std(ddof=1)) / math.sqrt(gains.size)
        return cls(float(gains.mean()), error, gains.size)


@dataclass(frozen=True, kw_only=True)
class Ahead:
    """Challengers to one, which wins if it is ahead of the incumbent by some standard errors.

    All run from the same starts; at each look the half of the challengers that earns least leaves.
    The last one wins as soon as it is ahead enough on 32 pairs, or by far on 8 or 16; whoever has
    more leaves has to earn them before, and fewer leaves count at the last look. It has to be ahead
    with one more pair, too, in which it loses all of the range of returns: what gains a little in
    each episode and loses much in one of thirty looks sure before that one comes.

    Attributes:
        looks: Numbers of starts after which the trees are compared, ascending.
        errors: Standard errors ahead that win.
        final: Those that win at the last look, and where no more episodes can be run.
        patient: Whether nobody wins or loses on fewer than 32 pairs, or loses before it is a
            standard error behind; else the last challenger leaves as soon as it is not ahead. The
            pair in which it loses is not asked of a patient contest.
        prices: Return that each tree has to earn for its leaves; empty for none.
        known: Lowest and highest return of an episode, as far as they are known.
    """

    looks: tuple[int, ...] = (4, 8, 16, 32, 64)
    errors: float = 1.0
    final: float = 1.0
    patient: bool = False
    prices: tuple[float, ...] = ()
    known: tuple[float, float] | None = None

    @property
    def most(self) -> int:
        """Most starts of the contest."""
        return self.looks[-1]

    def next(self, table: Table) -> Heat | Verdict:
        """Return what is to run until the next look, or who has won."""
        alive, n = self.standing(table)
        if np.isnan(table[list(alive), :n]).any():
            return Heat(tuple(sorted(alive)), range(n))
        wins = self._decided(table[:, :n], alive[1])
        return Verdict(alive[1] if wins else 0, bool(wins), range(n))

    def stopped(self, table: Table) -> Verdict:
        """Return the challenger that is furthest ahead of those left, if any is far enough.

        On fewer than 32 pairs one has to be a standard error ahead at least.
        """
        best, most, n = 0, 0.0, 0
        for rival in self.standing(table)[0][1:]:
            lead = Lead.of(pairs(table[[0, rival]]))
            errors = max(self.final, float(lead.pairs < ENOUGH))
            mean = lead.mean + self._saved(rival)
            if lead.pairs > 1 and mean > most and mean > errors * lead.error:
                best, most, n = rival, mean, lead.pairs
        return Verdict(best, False, range(n))

    def standing(self, table: Table) -> tuple[tuple[int, ...], int]:
        """Return who is left, the incumbent first and then the best, and the starts they run."""
        alive, n = tuple(range(len(table))), 0
        for n in self.looks:
            now = table[:, :n]
            if np.isnan(now[list(alive)]).any():
                break
            leads = {one: Lead.of(now[one] - now[0]).mean + self._saved(one) for one in alive[1:]}
            ranked = sorted(leads, key=lambda one: (-leads[one], one))
            alive = (0, *ranked[: max(len(ranked) // 2, 1)])
            if len(alive) == 2 and self._decided(now, alive[1]) is not None:
                break
        return alive, n

    def _saved(self, rival: int) -> float:
        """Return what a challenger's fewer leaves are worth; negative where it has more."""
        return self.prices[0] - self.prices[rival] if self.prices else 0.0

    def _decided(self, now: Table, rival: int) -> bool | None:
        """Return whether the last challenger wins; None if that is still open."""
        lead, saved = Lead.of(now[rival] - now[0]), self._saved(rival)
        mean, n = lead.mean + saved, lead.pairs
        sure = lead.mean + min(saved, 0.0)
        low, high = seen_range(now[[0, rival]], self.known)
        stands = self.patient or n * mean > high - low
        if stands and n >= ENOUGH and sure > self.errors * lead.error:
            return True
        if stands and not self.patient and n in OBVIOUS and sure > OBVIOUS[n] * lead.error:
            return True
        if n >= self.most:
            return stands and mean > self.final * lead.error
        behind = n >= ENOUGH and mean < -BEHIND * lead.error if self.patient else mean <= 0.0
        return False if behind else None


@dataclass(frozen=True, kw_only=True)
class AheadApart:
    """Two trees that ran from starts of their own; the rows of the table have ends of their own.

    Attributes:
        few: Episodes of the challenger below which nothing is said.
        enough: Its episodes after which it wins if it has earned more.
        clearly: Standard errors ahead that win on fewer.
    """

    few: int = 5
    enough: int = 30
    clearly: float = 3.0

    def next(self, table: Table) -> Heat | Verdict:
        """Return more episodes of the challenger to run; or that it has won."""
        own, other = (row[~np.isnan(row)] for row in table)
        ahead = lead_apart(own, other)
        if own.size and other.size >= self.few:
            errors = self.clearly if other.size < self.enough else 0.0
            if ahead.mean > errors * ahead.error:
                return Verdict(1, True, range(other.size))
        return Heat((1,), range(other.size, other.size + 1))


def lead_apart(own: Floats, other: Floats) -> Lead:
    """Return by how much one tree's returns [m] are ahead of another's [n], not paired."""
    if not own.size or not other.size:
        return Lead(0.0, math.inf, 0)
    error = math.sqrt(own.var() / own.size + other.var() / other.size)
    return Lead(float(other.mean() - own.mean()), error, other.size)
