"""Best actions where observations are a few codes: the MDP of what was counted, solved exactly.

Its policy has an action for each cell. As a tree it is large; cut to size it is where a search
begins that single changes of one action would never reach.
"""

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.mdp import TERMINAL, TransitionCounts, solve
from eutree.world_model import ActionTree, Transitions
from eutree.world_model.action_trees import from_decision_tree
from eutree.world_model.counted import CountedSteps

PRECISION = 1e-5  # below which two actions are worth the same, in parts of the largest reward
ENOUGH = 5  # trials
LATER = 0.1  # of a return is lost at most within an episode, so that of equal ways the shorter wins
CURIOUS = 0.99  # discount of explorers: what is not known and near is tried first
_WHOLE = C45Settings(use_penalty=False, prune=False, min_objects=1)


def best_by_counts(data: Transitions, discount: float) -> ActionTree:
    """Return the tree of the actions that are worth most by what was counted, one a cell.

    Undiscounted, to put off for ever what will be is worth as much as to do it; episodes end.
    """
    longest = max(data.horizon(), data.longest())
    return _solved(data, 1.0 - LATER / longest if discount == 1.0 else discount, None)


def curious_by_counts(data: Transitions) -> ActionTree:
    """Return the tree of the actions that lead to what was never tried, or else are worth most.

    What was never tried counts as more than the best reward for ever (R-max; Brafman and
    Tennenholtz 2002). So does what was tried only a few times: once is none where chance rules.
    """
    for_ever = max(0.0, float(data.rewards.max())) / (1.0 - CURIOUS)
    return _solved(data, CURIOUS, 2.0 * for_ever + _unit(data))


def _unit(data: Transitions) -> float:
    """Return the size of the largest reward; 1 where there was none."""
    return float(np.abs(data.rewards).max()) or 1.0


def _solved(data: Transitions, discount: float, untried: float | None) -> ActionTree:
    cells, counts = _counted(data, 1 if untried is None else ENOUGH)
    solution = solve(counts.model(), discount, untried=untried, horizon=float(data.horizon()))
    known = np.flatnonzero(np.isfinite(solution.action_values).any(axis=1))
    values = np.nan_to_num(solution.action_values[known], nan=-np.inf)
    best = values >= values.max(axis=1, keepdims=True) - PRECISION * _unit(data)
    shown = grow(cells[known], _commonest(best), n_classes=data.n_actions, settings=_WHOLE)
    return from_decision_tree(*shown.to_decision_tree())


def _commonest(best: Booleans) -> Integers:
    """Return one of the best actions of each cell [C, A]: that of most cells, then of the others.

    Which of them is free, so the tree may be small.
    """
    chosen = np.full(len(best), -1)
    while (free := chosen < 0).any():
        action = int(best[free].sum(axis=0).argmax())
        chosen[free & best[:, action]] = action
    return chosen


def _counted(data: Transitions, enough: int) -> tuple[Floats, TransitionCounts]:
    """Return the cells [S, d], and the transitions between them of what was tried often enough."""
    steps = CountedSteps.of(data)
    places = np.concatenate([steps.observations, steps.next_observations])
    cells, state = np.unique(places, axis=0, return_inverse=True)
    before, after = state.reshape(2, -1)
    pair = before * data.n_actions + steps.actions
    n_tried = np.bincount(pair)[pair]
    kept = (n_tried >= enough) | (np.arange(pair.size) >= data.rewards.size)
    after = np.where(steps.terminated, TERMINAL, after)
    columns = (column[kept] for column in (before, steps.actions, steps.rewards, after))
    return cells, TransitionCounts.of(*columns, n_states=len(cells), n_actions=data.n_actions)
