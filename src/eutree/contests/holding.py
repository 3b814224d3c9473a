"""Hold a contest: run the heats that its rule asks for, and tell the table what came of them."""

from collections.abc import Callable, Generator, Sequence

import numpy as np

from eutree.arrays import Floats
from eutree.contests.table import Heat, Rule, Table, Verdict

Run = Callable[[int, Sequence[int]], Floats | None]


def missing(table: Table, heat: Heat) -> list[tuple[int, list[int]]]:
    """Return the episodes of a heat that the table does not hold: each tree with its starts."""
    return [
        (tree, starts.tolist())
        for tree in heat.trees
        if (starts := np.flatnonzero(np.isnan(table[tree, : heat.starts.stop]))).size
        and (starts := starts[starts >= heat.starts.start]).size
    ]


def held(rule: Rule, table: Table) -> Generator[tuple[int, list[int]], Floats | None, Verdict]:
    """Hold a contest for whoever runs the episodes; the table is filled on the way.

    Args:
        rule: Decides.
        table: The returns known so far, shape [trees, starts], with as many starts as the rule
            may ask for.

    Yields:
        A tree, by its row, and the starts that it is to run from. Its returns are sent back; None
        where the budget does not allow them, which ends the contest.

    Returns:
        The verdict.
    """
    while isinstance(heat := rule.next(table), Heat):
        for tree, starts in missing(table, heat):
            returns = yield tree, starts
            if returns is None:
                return rule.stopped(table)
            table[tree, starts] = returns
    return heat


def hold(rule: Rule, table: Table, run: Run) -> Verdict:
    """Return the verdict of a contest whose episodes ``run`` runs at once.

    Args:
        rule: Decides.
        table: As for :func:`held`.
        run: Runs a tree, by its row, from some starts, and returns the returns; None where the
            budget does not allow it. It may be a run's own episodes, those of a simulator beside
            it, of a world model or of a log.
    """
    contest = held(rule, table)
    returns = None
    while True:
        try:
            asked = contest.send(returns)  # None begins a generator
        except StopIteration as end:
            verdict: Verdict = end.value
            return verdict
        returns = run(*asked)


def next_episode(rule: Rule, table: Table) -> tuple[int, int] | None:
    """Return the next tree and start to run, start by start; None where the contest is over."""
    heat = rule.next(table)
    if not isinstance(heat, Heat):
        return None
    trees, starts = np.array(heat.trees), table[list(heat.trees), : heat.starts.stop]
    unknown = np.isnan(starts[:, heat.starts.start :])
    start = int(unknown.any(axis=0).argmax())
    return int(trees[unknown[:, start].argmax()]), heat.starts.start + start
