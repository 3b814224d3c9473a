"""Hold a contest: run the heats that its rule asks for, and tell the table what came of them."""

from collections.abc import Callable, Sequence

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


def hold(rule: Rule, table: Table, run: Run) -> Verdict:
    """Return the verdict of a contest; the table is filled on the way.

    Args:
        rule: Decides.
        table: The returns known so far, shape [trees, starts], with as many starts as the rule
            may ask for.
        run: Runs a tree, by its row, from some starts, and returns the returns; None where the
            budget does not allow it. It may be a run's own episodes, those of a simulator beside
            it, of a world model or of a log.
    """
    while isinstance(heat := rule.next(table), Heat):
        for tree, starts in missing(table, heat):
            returns = run(tree, starts)
            if returns is None:
                return rule.stopped(table)
            table[tree, starts] = returns
    return heat
