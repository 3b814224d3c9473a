"""SmallestWithin: the smallest tree that does about as well as the best, or as the incumbent.

Two trees of one family differ by noise where they differ by less than a standard error, and of such
trees the smallest is the best to have: the rule of Breiman, Friedman, Olshen and Stone,
*Classification and Regression Trees* (1984), section 3.4.3. Of many, the chosen one is flattered by
the choice, so it is confirmed from starts that took no part in it; if it fails, the next larger one
has its turn.
"""

import math
from dataclasses import dataclass

import numpy as np

from eutree.contests.betting import TUNED, tuned_stake
from eutree.contests.rules import FIRST, HOPELESS, NotWorse
from eutree.contests.table import NextEpisodes, Table, Verdict, seen_range

ATTEMPTS = (1 / 2, 1 / 4, 1 / 4)  # shares of the error allowed


@dataclass(frozen=True, kw_only=True)
class SmallestWithin:
    """The smallest tree within a margin of the incumbent, or within a standard error of the best.

    Columns 0 to ``episodes`` - 1 of the table are for choosing, as many after them for the first
    confirmation, and so on.
    """

    sizes: tuple[int, ...]  # leaves of each tree, that of the incumbent first
    # How much less than the incumbent a tree may earn on average: a tree that earns less wins with
    # probability ``error`` at most (Bonferroni over the confirmations, Ville over the looks). None
    # for one standard error of the best tree, which promises nothing.
    margin: float | None = None
    error: float = 0.05  # see ``margin``
    episodes: int = 1000  # starts of the choice, and of each confirmation
    # Lowest and highest return of an episode; None where they are not known
    known: tuple[float, float] | None = None
    # A standard error below this share of the range of returns counts as this share: with many
    # starts, or a tree that never fails, it would else be next to nothing
    slack: float = 0.0

    @property
    def most(self) -> int:
        """Most starts of the contest."""
        return (1 + len(ATTEMPTS)) * self.episodes

    def next(self, table: Table) -> NextEpisodes | Verdict:
        """Return the episodes that choose, then those that confirm; or who has won."""
        chosen = self._near_best(table) if self.margin is None else self._promising(table)
        if isinstance(chosen, NextEpisodes):
            return chosen
        mark, trees = chosen
        for attempt, (tree, share) in enumerate(zip(trees, ATTEMPTS, strict=False), 1):
            first = attempt * self.episodes
            fresh = table[[mark, tree], first : first + self.episodes]
            found = self._confirmed(table[:, : self.episodes], mark, tree, share, fresh)
            if isinstance(found, NextEpisodes):
                return NextEpisodes((mark, tree), range(first, first + found.starts.stop))
            if found.winner:
                return Verdict(tree, found.shown, range(first, first + found.starts.stop))
        return Verdict(mark, False, range(self.episodes))

    def choice(self, table: Table) -> int:
        """Return the tree that would be confirmed first, by a table of all starts of the choice.

        It may be the best itself: no other is near it, or a smaller one. The table is of shape
        [trees, episodes].
        """
        chosen = self._near_best(table) if self.margin is None else self._promising(table)
        if isinstance(chosen, NextEpisodes):
            raise ValueError(f"the table must hold {self.episodes} returns of each tree")
        mark, trees = chosen
        return trees[0] if trees else mark

    def stopped(self, table: Table) -> Verdict:
        """Return the incumbent: nothing was confirmed."""
        return Verdict(0, False, range(0))

    def _promising(self, table: Table) -> NextEpisodes | tuple[int, list[int]]:
        """Return the incumbent and the trees that would be confirmed, the smallest first.

        When one would be, larger ones run no more, but may step in for it.
        """
        left = sorted(range(1, len(self.sizes)), key=lambda one: (self.sizes[one], one))
        passed: list[int] = []
        n = min(FIRST, self.episodes)
        while left:
            now = table[:, :n]
            if np.isnan(now[[0, *left]]).any():
                return NextEpisodes((0, *left), range(n))
            left = [one for one in left if not _hopeless(now, 0, one, self.margin or 0.0)]
            good = [k for k, one in enumerate(left) if self._would_be_confirmed(now, one)]
            if good:
                passed, left = left[good[0] :] + passed, left[: good[0]]
            if n >= self.episodes:
                break
            n = min(2 * n, self.episodes)
        return 0, passed

    def _near_best(self, table: Table) -> NextEpisodes | tuple[int, list[int]]:
        """Return the best tree, and the smaller ones within a standard error of it."""
        alive = list(range(len(self.sizes)))
        n = min(FIRST, self.episodes)
        while True:
            now = table[:, :n]
            if np.isnan(now[alive]).any():
                return NextEpisodes(tuple(alive), range(n))
            mark = max(alive, key=lambda one: (float(now[one].mean()), -self.sizes[one]))
            error = self._near(now, mark)
            alive = [one for one in alive if not _hopeless(now, mark, one, error)]
            if n >= self.episodes:
                break
            n = min(2 * n, self.episodes)
        return mark, [
            one
            for one in sorted(alive, key=lambda one: (self.sizes[one], one))
            if self.sizes[one] < self.sizes[mark] and float((now[one] - now[mark]).mean()) >= -error
        ]

    def _near(self, chosen: Table, mark: int) -> float:
        """Return how much less than the best a tree may earn: a standard error, or the slack."""
        low, high = seen_range(chosen, self.known)
        return max(_standard_error(chosen[mark]), self.slack * (high - low))

    def _would_be_confirmed(self, now: Table, tree: int) -> bool:
        """Return whether as many more starts as are allowed would confirm a tree."""
        margin, worst = self.margin or 0.0, self._worst(now)
        if worst >= -margin:
            return True
        needed = -math.log(ATTEMPTS[0] * self.error * TUNED)
        return tuned_stake(now[tree] - now[0], -margin, worst)[1] * self.episodes >= needed

    def _worst(self, chosen: Table) -> float:
        """Return the lowest difference of two returns, as known or as seen.

        Where it was only seen it is at least half of the widest in which the margin could be
        confirmed at all: losses that were not seen may be as large (the rule of three, read
        backwards).
        """
        low, high = seen_range(chosen, self.known)
        if self.known is not None:
            return low - high
        needed = -math.log(ATTEMPTS[0] * self.error * TUNED)
        return min(low - high, -(self.margin or 0.0) * self.episodes / (2 * needed))

    def _confirmed(
        self, chosen: Table, mark: int, tree: int, share: float, fresh: Table
    ) -> NextEpisodes | Verdict:
        """Return the verdict of fresh starts on a tree and the best, or the incumbent."""
        if self.margin is None:
            if np.isnan(fresh).any():
                return NextEpisodes((0, 1), range(self.episodes))
            near = float((fresh[1] - fresh[0]).mean()) >= -self._near(chosen, mark)
            return Verdict(int(near), False, range(self.episodes))
        low, high = seen_range(np.concatenate([chosen.ravel(), fresh.ravel()]), self.known)
        if low == high:  # where all returns are equal nothing is known of losses
            return Verdict(0, False, range(0))
        low = min(low, high + self._worst(chosen))
        gains = (chosen[tree] - chosen[mark])[~np.isnan(chosen[tree])]
        stake = None
        if low - high < -self.margin:
            stake = tuned_stake(gains, -self.margin, low - high)[0]
        error, known = share * self.error, (low, high)
        confirming = NotWorse(
            margin=self.margin, error=error, most=self.episodes, known=known, stake=stake
        )
        return confirming.next(fresh)


def _standard_error(returns: Table) -> float:
    return float(returns.std(ddof=1)) / math.sqrt(returns.size)


def _hopeless(now: Table, mark: int, tree: int, margin: float) -> bool:
    """Return whether a tree is clearly worse than the margin allows."""
    gains = now[tree] - now[mark]
    reach = HOPELESS * _standard_error(gains)
    return gains.size >= FIRST and float(gains.mean()) + reach < -margin
