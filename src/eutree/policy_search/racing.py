"""Races between trees: which tree to run on which episodes, decided by what came of it.

No race runs anything. Each is a generator: it yields a :class:`Heat` (this runner, these episodes)
and is sent the undiscounted returns of these episodes, or None where the budget does not allow
them; when it ends it returns its result. Whoever drives it owns the environment, the seeds and
the budget, and can be written for one process, for many, or for a test that makes returns up.
Episode k of a block starts the same for every runner (common random numbers), so differences
between two runners are paired.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import TypeVar

import numpy as np

from eutree.arrays import Floats
from eutree.contests.betting import TUNED, log_wealth, lower_bound, tuned_stake

FIRST_BLOCK = 4  # episodes
MOST_EPISODES_OF_A_ROUND = 32
FEWEST = 8  # episodes without which nothing is known
ENOUGH = 32  # episodes that show which of two trees earns more
MANY = 64  # episodes that show that a smaller tree does as well
# Standard errors at which so few episodes are enough: Student's t that is exceeded once in 1,000.
OBVIOUS = {8: 4.79, 16: 3.73}
OF_MANY_ERRORS = 2.0  # standard errors that are clear where many challengers are tried

_FIRST_SELECTION = 32
_BLOCKS = 64  # of a selection or a confirmation: more than doubling ever takes
_ATTEMPTS = (1 / 2, 1 / 4, 1 / 4)  # of the error allowed
_HOPELESS = NormalDist().inv_cdf(0.99)  # standard errors below the margin

Result = TypeVar("Result")


@dataclass(frozen=True)
class Heat:
    """What to run next.

    Attributes:
        runner: Number of the tree.
        block: Number of the block; the episodes of two blocks have nothing in common.
        episodes: Numbers of the episodes in the block.
    """

    runner: int
    block: int
    episodes: range


Race = Generator[Heat, Floats | None, Result]


def drive(race: Race[Result], run: Callable[[Heat], Floats | None]) -> Result:
    """Return the result of a race whose heats ``run`` runs at once."""
    returns = None
    try:
        heat = next(race)
        while True:
            returns = run(heat)
            heat = race.send(returns)
    except StopIteration as end:
        result: Result = end.value
        return result


def halving(n_leaves: Sequence[int], *, leaf_price: float, first: int, block: int) -> Race[int]:
    """Run all, drop the worse half, run twice as many episodes; return the number of the winner.

    Successive halving (Karnin, Koren, Somekh 2013). Where the budget ends, the best of those that
    ran in the present round wins.

    Args:
        n_leaves: Leaves of each runner.
        leaf_price: Return that a leaf must earn.
        first: Episodes of the first round.
        block: Block that the episodes are of.
    """
    alive = list(range(len(n_leaves)))
    returns: dict[int, Floats] = {}
    size = n = first
    while len(alive) > 1:
        scores: dict[int, float] = {}
        for runner in alive:
            seen = returns.get(runner, np.empty(0))
            new = yield Heat(runner, block, range(seen.size, n))
            if new is None:
                return max(alive, key=lambda one: scores.get(one, -np.inf))
            returns[runner] = np.concatenate([seen, new])
            scores[runner] = float(returns[runner].mean()) - leaf_price * n_leaves[runner]
        alive.sort(key=lambda one: -scores[one])
        alive = alive[: (len(alive) + 1) // 2]
        size = min(2 * size, MOST_EPISODES_OF_A_ROUND)
        n += size
    return alive[0]


def paired(saved: float, *, of_many: bool, block: int) -> Race[bool | None]:
    """Return whether a challenger (1) earns clearly more than the incumbent (0), leaves paid for.

    The number of episodes doubles as long as the challenger is ahead.

    Args:
        saved: What the challenger's fewer leaves are worth; negative where it has more.
        of_many: Whether the challenger is one of many that are tried one after another. Then two
            standard errors are clear, not one, and ties are not looked into.
        block: Block that the episodes are of.

    Returns:
        None if the challenger is ahead and the budget is too small to be sure.
    """
    errors = OF_MANY_ERRORS if of_many else 1.0
    gains = np.empty(0)
    n = FIRST_BLOCK
    while True:
        numbers = range(gains.size, n)
        challenger = yield Heat(1, block, numbers)
        incumbent = None if challenger is None else (yield Heat(0, block, numbers))
        if challenger is None or incumbent is None:
            return None if n > FEWEST else False
        gains = np.concatenate([gains, challenger - incumbent])
        ahead = float(gains.mean()) + saved
        if ahead < 0.0 or (of_many and ahead == 0.0):
            return False
        error = float(gains.std(ddof=1)) / math.sqrt(n)
        sure = float(gains.mean()) + min(saved, 0.0)
        if n in OBVIOUS and sure > OBVIOUS[n] * error:
            return True
        if n >= ENOUGH and sure > errors * error:
            return True
        if n >= MANY:
            return ahead > errors * error
        n *= 2


@dataclass(frozen=True, kw_only=True)
class Demand:
    """How sure one wants to be of what.

    Attributes:
        margin: How much lower than the input's the mean return may be.
        error: Chance that it is lower than that nevertheless.
        episodes: Most episodes of a runner in the selection, and in a confirmation.
        known_range: Lowest and highest return of an episode there can be; None takes the range of
            all returns seen, or ``blind_width`` if that is more, and then what is promised holds
            for losses within it.
    """

    margin: float
    error: float
    episodes: int
    known_range: tuple[float, float] | None = None

    @property
    def blind_width(self) -> float:
        """Half of the widest range of returns in which the margin could be confirmed at all.

        Losses that were not seen may be as large as this: the rule of three, read backwards.
        """
        return self.margin * self.episodes / (2 * -math.log(first_error(self.error) * TUNED))


@dataclass(frozen=True)
class Meeting:
    """Two trees on the same fresh episodes.

    Attributes:
        before: Return of the input in each episode.
        after: Return of the other tree.
        confirmed: Whether the mean of after is not lower than that of before by the margin.
        low: Lower bound of the mean of after minus before.
        high: Upper bound of it. Each is wrong with the probability asked for at most, whenever
            the meeting ended.
        range: Lowest and highest return of an episode, as known or as seen.
    """

    before: Floats  # [E]
    after: Floats  # [E]
    confirmed: bool
    low: float
    high: float
    range: tuple[float, float]


@dataclass
class Returns:
    """All returns that a race has seen, and the range that they or the environment set.

    Attributes:
        known: Lowest and highest return there can be; None if that is not known.
        least_width: Width of the range at least, where it is not known.
        low: Lowest return seen.
        high: Highest return seen.
    """

    known: tuple[float, float] | None
    least_width: float = 0.0
    low: float = math.inf
    high: float = -math.inf

    def see(self, returns: Floats) -> None:
        """Take note of returns."""
        if returns.size:
            self.low = min(self.low, float(returns.min()))
            self.high = max(self.high, float(returns.max()))

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest return there can be, as known or as seen; wider if seen wider."""
        if self.known is None:
            return min(self.low, self.high - self.least_width), self.high
        return min(self.known[0], self.low), max(self.known[1], self.high)

    @property
    def worst(self) -> float:
        """The lowest difference of two returns."""
        low, high = self.range
        return low - high


def meeting(
    error: float,
    episodes: int,
    *,
    block: int,
    returns: Returns,
    margin: float | None = None,
    stake: float | None = None,
) -> Race[Meeting]:
    """Run the input (0) and another tree (1) on the same fresh episodes.

    With a margin it ends as soon as that is confirmed: the bounds are true however often one looks.

    Args:
        error: Chance that a bound is wrong.
        episodes: Most episodes.
        block: First block of the meeting; it takes one for each look.
        returns: What was seen before; it also sees what comes.
        margin: How much lower than the input's the mean return may be.
        stake: Tuned on episodes that are not of this meeting.
    """
    before, after, confirmed = np.empty(0), np.empty(0), False
    while before.size < episodes and not confirmed:
        size = min(max(before.size, _FIRST_SELECTION), episodes - before.size)
        before = np.append(before, (yield from _seen(Heat(0, block, range(size)), returns)))
        after = np.append(after, (yield from _seen(Heat(1, block, range(size)), returns)))
        block += 1
        if margin is not None:
            confirmed = _confirmed(after - before, margin, error, returns.worst, stake)
    low = lower_bound(after - before, returns.worst, error, stake)
    high = -lower_bound(before - after, returns.worst, error)
    if margin is not None:  # the bisection stops within a rounding of where the margin stands
        low = max(low, -margin) if confirmed else min(low, -margin)
    return Meeting(before, after, confirmed, low, high, returns.range)


def _seen(heat: Heat, returns: Returns) -> Race[Floats]:
    """Have a heat run that has to be, and take note of its returns."""
    new = yield heat
    if new is None:
        raise ValueError(f"{heat} must be run: this race has no budget")
    returns.see(new)
    return new


@dataclass(eq=False)
class _Runner:
    number: int
    gains: Floats = field(default_factory=lambda: np.empty(0))  # [E] over the input

    def hopeless(self, margin: float) -> bool:
        """Return whether the runner is clearly worse than the margin allows."""
        if self.gains.size < _FIRST_SELECTION:
            return False
        error = _HOPELESS * float(self.gains.std(ddof=1)) / math.sqrt(self.gains.size)
        return float(self.gains.mean()) + error < -margin

    def promising(self, demand: Demand, worst: float) -> bool:
        """Return whether as many more episodes as are allowed would confirm the runner."""
        if worst >= -demand.margin:
            return True
        growth = tuned_stake(self.gains, -demand.margin, worst)[1]
        return growth * demand.episodes >= -math.log(first_error(demand.error) * TUNED)


def smallest_within(n_candidates: int, demand: Demand) -> Race[tuple[int, Meeting] | None]:
    """Return the number of the smallest candidate that is confirmed, and how it did.

    Selection: all candidates and the input run the same episodes, in blocks that double. A
    candidate that is clearly worse than the margin allows leaves; when the smallest that is left
    would be confirmed on as many episodes again, the race is decided. Confirmation: the winner
    meets the input on fresh episodes, which took no part in choosing it; if it fails, the next
    larger one does, up to three, at a half, a quarter and a quarter of the error allowed. So a tree
    that is worse than the margin is returned with probability ``demand.error`` at most, for any
    distribution of returns within the range (Bonferroni over the attempts, Ville over the looks).

    Args:
        n_candidates: Runners 1 to n, the smallest first; runner 0 is the input.
        demand: What the winner has to keep.
    """
    returns = Returns(demand.known_range, demand.blind_width)
    passed = yield from _selected(n_candidates, demand, returns)
    for attempt, (runner, share) in enumerate(zip(passed, _ATTEMPTS, strict=False), 1):
        if returns.worst == 0:  # where all returns are equal nothing is known of losses
            return None
        met = yield from _as_runner(
            runner.number,
            meeting(
                share * demand.error,
                demand.episodes,
                block=attempt * _BLOCKS,
                returns=returns,
                margin=demand.margin,
                stake=_stake(runner.gains, demand.margin, returns.worst),
            ),
        )
        if met.confirmed:
            return runner.number, met
    return None


def _selected(n_candidates: int, demand: Demand, returns: Returns) -> Race[list[_Runner]]:
    """Return the candidates that may pass, the smallest first."""
    runners = [_Runner(number) for number in range(1, n_candidates + 1)]
    passed: list[_Runner] = []  # larger than those that run
    seen, block, size = 0, 0, min(_FIRST_SELECTION, demand.episodes)
    while runners and seen < demand.episodes:
        own = yield from _seen(Heat(0, block, range(size)), returns)
        for runner in runners:
            new = yield from _seen(Heat(runner.number, block, range(size)), returns)
            runner.gains = np.concatenate([runner.gains, new - own])
        seen, block = seen + size, block + 1
        size = min(seen, demand.episodes - seen)
        runners = [runner for runner in runners if not runner.hopeless(demand.margin)]
        good = [k for k, one in enumerate(runners) if one.promising(demand, returns.worst)]
        if good:  # what is larger than a good one runs no more, but may step in for it
            passed = runners[good[0] :] + passed
            runners = runners[: good[0]]
    return passed


def first_error(error: float) -> float:
    """Return the chance of being wrong that the first confirmation may use."""
    return error * _ATTEMPTS[0]


def _confirmed(
    gains: Floats, margin: float, error: float, worst: float, stake: float | None
) -> bool:
    if worst >= -margin:
        return True
    return log_wealth(gains, -margin, worst, stake) >= -math.log(error)


def _stake(gains: Floats, margin: float, worst: float) -> float | None:
    """Return the stake tuned in the selection; None where none is needed."""
    return None if worst >= -margin else tuned_stake(gains, -margin, worst)[0]


def _as_runner(number: int, race: Race[Result]) -> Race[Result]:
    """Let runner 1 of a race be another number."""
    heat = next(race)
    while True:
        returns = yield Heat(number if heat.runner else 0, heat.block, heat.episodes)
        try:
            heat = race.send(returns)
        except StopIteration as end:
            result: Result = end.value
            return result
