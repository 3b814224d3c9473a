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
from eutree.contests.table import NextEpisodes, Table, Verdict, pairs, seen_range

FIRST = 32  # pairs before a challenger is called hopeless
HOPELESS = 2.33  # standard errors: 99 %, one-sided
CLEARLY = 3.0  # standard errors ahead that are worth more pairs
WON = 3  # pairs, and none lost, that are worth more: equal trees do so once in eight times
GROWTH = 1.5  # of the pairs each time that more are asked for
BLIND = 300  # pairs
GUESS = 64  # episodes that a guess counts for


@dataclass(frozen=True, kw_only=True)
class Halving:
    """Many trees to few: all run, the worse half leaves, those left run twice as many starts.

    It promises nothing: the winner of many is flattered by being the winner.
    """

    first: int = 8  # starts of the first round
    most: int = 512  # most starts of a tree
    keep: int = 1  # trees that are left at the end; the verdict names the best of them
    # Return that each tree has to earn for its leaves; empty for none
    prices: tuple[float, ...] = ()
    # Return that each tree is guessed to earn; empty for none. A guess counts for as much as
    # ``GUESS`` episodes: luck is less then, of which the first rounds are full.
    guesses: tuple[float, ...] = ()

    @classmethod
    def within(cls, budget: int, n_trees: int) -> "Halving":
        """Return the contest of so many trees down to two that takes about ``budget`` episodes."""
        left, cost, rounds = n_trees, n_trees, 1
        while left > 2:  # a round doubles what each of those left has played
            left = (left + 1) // 2
            cost += left * 2 ** (rounds - 1)
            rounds += 1
        first = max(1, budget // cost)
        return cls(first=first, most=first * 2 ** (rounds - 1))

    def next(self, table: Table) -> NextEpisodes | Verdict:
        """Return the next round, or the best of those left."""
        alive, n, _ = self.standing(table)
        if np.isnan(table[list(alive), :n]).any():
            return NextEpisodes(tuple(sorted(alive)), range(n))
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
    """A challenger wins if it is shown to earn no less than the incumbent by more than a margin."""

    margin: float  # how much less it may earn on average
    error: float = 0.05  # chance that a challenger that earns less than that wins nevertheless
    most: int = 1000  # most pairs; after them the incumbent stays
    # Lowest and highest return of an episode; None where they are not known
    known: tuple[float, float] | None = None
    # Those of other episodes of the two, which count where nothing is known
    seen: tuple[float, float] | None = None
    blind: int = BLIND  # pairs below which nothing is shown where they are not known
    stake: float | None = None  # tuned on starts that are none of this contest; None for none
    # Pairs after which it goes on only while the challenger is clearly ahead; None for ``most``
    patience: int | None = None

    def next(self, table: Table) -> NextEpisodes | Verdict:
        """Return more pairs to run; or who has won, once that is shown or hopeless."""
        gains = pairs(table[:, : self.most])
        n = gains.size
        if (at := self.shown_after(gains, seen_range(table, self.known, self.seen))) is not None:
            return Verdict(1, True, range(at))
        patient = n < self._patience
        if n >= self.most or self._hopeless(gains) or not (patient or self._clearly_ahead(gains)):
            return Verdict(0, False, range(n))
        more = math.ceil(GROWTH * n)
        more = min(max(FIRST, more), self._patience) if patient else min(more + 1, self.most)
        return NextEpisodes((0, 1), range(more))

    def stopped(self, table: Table) -> Verdict:
        """Return the incumbent: nothing was shown."""
        return Verdict(0, False, range(pairs(table).size))

    def shown_after(self, gains: Floats, bounds: tuple[float, float]) -> int | None:
        """Return after how many pairs it was shown; None if it is not."""
        worst = bounds[0] - bounds[1]
        blind = 0 if self.known is not None else min(self.blind, self._patience)
        if gains.size < max(blind, 1) or (worst == 0.0 and self.margin == 0.0):
            return None
        if worst >= -self.margin and self.known is not None:
            return 1
        worst = min(worst, -2 * self.margin)  # a narrow range that was seen proves nothing
        enough = log_wealth_path(gains, -self.margin, worst, self.stake) >= -math.log(self.error)
        enough[: blind - 1 if blind else 0] = False
        return int(enough.argmax()) + 1 if enough.any() else None

    @property
    def _patience(self) -> int:
        """Pairs that are played whatever they show."""
        return self.most if self.patience is None else min(self.patience, self.most)

    def _clearly_ahead(self, gains: Floats) -> bool:
        """Return whether it looks as if a few pairs more would show what these do not.

        It does, too, of a challenger that has won some pairs and lost none, as one that never fails
        beside one that fails at times: by standard errors that is seen late.
        """
        lead = Lead.of(gains)
        won = bool((gains >= 0.0).all()) and int(np.count_nonzero(gains)) >= WON
        return lead.pairs > 1 and (won or lead.mean + self.margin > CLEARLY * lead.error)

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


# What acts is how a run explores, so it may change soon, on a lead of some standard errors. These
# rules look again and again and promise nothing. What a run hands over has to stand a contest by
# ``Better`` or ``NotWorse`` on fresh episodes.


ENOUGH = 32  # pairs that show which of two trees earns more
# Standard errors at which so few pairs are enough: Student's t that is exceeded once in 1,000.
OBVIOUS = {8: 4.79, 16: 3.73}
BEHIND = 1.0  # standard errors behind that end a patient contest


@dataclass(frozen=True)
class Lead:
    """By how much a challenger is ahead of the incumbent."""

    mean: float  # mean of challenger minus incumbent
    error: float  # its standard error; infinite for fewer than two pairs
    pairs: int  # starts that both have run

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
    """

    # Numbers of starts after which the trees are compared, ascending
    looks: tuple[int, ...] = (4, 8, 16, 32, 64)
    errors: float = 1.0  # standard errors ahead that win
    final: float = 1.0  # those that win at the last look, and where no more episodes can be run
    # Whether nobody wins or loses on fewer than 32 pairs, or loses before it is a standard error
    # behind; else the last challenger leaves as soon as it is not ahead
    patient: bool = False
    rare_losses: bool = True  # whether it has to be ahead with that one more pair, too
    # Return that each tree has to earn for its leaves; empty for none
    prices: tuple[float, ...] = ()
    # Lowest and highest return of an episode, as far as they are known
    known: tuple[float, float] | None = None

    @property
    def most(self) -> int:
        """Most starts of the contest."""
        return self.looks[-1]

    def next(self, table: Table) -> NextEpisodes | Verdict:
        """Return the episodes to run until the next look, or who has won."""
        alive, n = self.standing(table)
        if np.isnan(table[list(alive), :n]).any():
            return NextEpisodes(tuple(sorted(alive)), range(n))
        wins = self._decided(table[:, :n], alive[1])
        return Verdict(alive[1] if wins else 0, bool(wins), range(n))

    def stopped(self, table: Table) -> Verdict:
        """Return the challenger that is furthest ahead of those left, if any is far enough.

        On fewer than 32 pairs one has to be a standard error ahead at least.
        """
        best, most, n = 0, 0.0, 0
        for challenger in self.standing(table)[0][1:]:
            lead = Lead.of(pairs(table[[0, challenger]]))
            errors = max(self.final, float(lead.pairs < ENOUGH))
            mean = lead.mean + self._saved(challenger)
            if lead.pairs > 1 and mean > most and mean > errors * lead.error:
                best, most, n = challenger, mean, lead.pairs
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

    def _saved(self, challenger: int) -> float:
        """Return the worth of a challenger's fewer leaves; negative where it has more."""
        return self.prices[0] - self.prices[challenger] if self.prices else 0.0

    def _decided(self, now: Table, challenger: int) -> bool | None:
        """Return whether the last challenger wins; None if that is still open."""
        lead, saved = Lead.of(now[challenger] - now[0]), self._saved(challenger)
        mean, n = lead.mean + saved, lead.pairs
        sure = lead.mean + min(saved, 0.0)
        low, high = seen_range(now[[0, challenger]], self.known)
        stands = not self.rare_losses or n * mean > high - low
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
    """Two trees that ran from starts of their own; the rows of the table have ends of their own."""

    few: int = 5  # episodes of the challenger below which nothing is said
    enough: int = 30  # its episodes after which it wins if it has earned more
    clearly: float = 3.0  # standard errors ahead that win on fewer

    def next(self, table: Table) -> NextEpisodes | Verdict:
        """Return more episodes of the challenger to run; or that it has won."""
        own, other = (row[~np.isnan(row)] for row in table)
        ahead = lead_apart(own, other)
        if own.size and other.size >= self.few:
            errors = self.clearly if other.size < self.enough else 0.0
            if ahead.mean > errors * ahead.error:
                return Verdict(1, True, range(other.size))
        return NextEpisodes((1,), range(other.size, other.size + 1))


def lead_apart(own: Floats, other: Floats) -> Lead:
    """Return by how much one tree's returns [m] are ahead of another's [n], not paired."""
    if not own.size or not other.size:
        return Lead(0.0, math.inf, 0)
    error = math.sqrt(own.var() / own.size + other.var() / other.size)
    return Lead(float(other.mean() - own.mean()), error, other.size)
