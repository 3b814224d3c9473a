"""Trees to begin from again: C4.5 grows them from the episodes that earned most.

A search by changes of one tree stays where all changes cost something. Other trees have earned as
much in between, or more in some episodes; a tree that imitates these is somewhere else.
"""

from collections.abc import Iterator

import numpy as np

from eutree.arrays import Integers
from eutree.c45 import C45Settings, grow
from eutree.world_model import ActionTree, Transitions
from eutree.world_model.action_trees import from_decision_tree, n_leaves

MOST_ROWS = 20_000
BEST = 0.75  # quantile of the returns


def restarts(data: Transitions, *, max_leaves: int) -> Iterator[ActionTree]:
    """Yield a tree of all episodes that earned more than average, of the best, of the old, the new.

    Args:
        data: The stored transitions.
        max_leaves: Most leaves of a tree; it is grown from larger leaves until it has no more.
    """
    returns = data.episode_returns
    good = np.flatnonzero(returns > returns.mean())
    best = np.flatnonzero(returns >= np.quantile(returns, BEST))
    half = good.size // 2
    owner = np.cumsum(data.first) - 1
    for episodes in (good, best, good[:half], good[half:]):
        rows = np.flatnonzero(np.isin(owner, episodes))
        if rows.size:
            kept = np.unique(np.linspace(0, rows.size - 1, MOST_ROWS).astype(np.int64))
            yield _grown(data, rows[kept], max_leaves)


def _grown(data: Transitions, rows: Integers, max_leaves: int) -> ActionTree:
    """Return C4.5's tree of some rows with at most so many leaves."""
    fewest = 2
    while True:
        settings = C45Settings(min_objects=fewest)
        shown = grow(
            data.observations[rows], data.actions[rows], n_classes=data.n_actions, settings=settings
        )
        tree = from_decision_tree(*shown.to_decision_tree())
        if n_leaves(tree) <= max_leaves:
            return tree
        fewest *= 2
