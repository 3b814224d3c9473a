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
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from eutree.arrays import Floats

FIRST_BLOCK = 4  # episodes
MOST_EPISODES_OF_A_ROUND = 32
FEWEST = 8  # episodes without which nothing is known
ENOUGH = 32  # episodes that show which of two trees earns more
MANY = 64  # episodes that show that a smaller tree does as well
# Standard errors at which so few episodes are enough: Student's t that is exceeded once in 1,000.
OBVIOUS = {8: 4.79, 16: 3.73}
OF_MANY_ERRORS = 2.0  # standard errors that are clear where many challengers are tried

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
