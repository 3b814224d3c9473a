"""Which tree? Every place that asks it holds a contest, and one of a few rules decides.

A contest knows a *table* of returns alone, a row for each tree and a column for each start, NaN
where a tree has not run yet. A rule is a frozen value; ``rule.next(table)`` says which trees are to
run from which starts (:class:`NextEpisodes`), or who has won (:class:`Verdict`). So a
checkpoint of a contest is one array, and the same rule judges episodes of a run, of a simulator
beside it, of a world model or of a log: they differ in the function that runs an episode, which
:func:`hold` is given. In all of them row 0 is the *incumbent*; the others are *challengers*.
"""

from eutree.contests.rules import Ahead, AheadApart, Better, Halving, NotWorse, best
from eutree.contests.smallest import SmallestWithin
from eutree.contests.table import (
    Bounds,
    NextEpisodes,
    Rule,
    Table,
    Verdict,
    bounds_of_change,
    hold,
    missing,
    new_table,
    next_episode,
)

__all__ = [
    "Ahead", "AheadApart", "Better", "Bounds", "Halving", "NextEpisodes", "NotWorse", "Rule",
    "SmallestWithin", "Table", "Verdict", "best", "bounds_of_change", "hold", "missing",
    "new_table", "next_episode",
]  # fmt: skip
