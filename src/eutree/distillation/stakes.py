"""How much is at stake at an observation: what the worst action there costs (VIPER's weights).

Bastani et al. (2018): a wrong decision costs V(o) - Q(o, a) under the teacher's values, at most
V(o) - min_a Q(o, a). Observations at which every action is as good as another do not matter.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats
from eutree.compression.costs import Costs
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy

ActionValues = Callable[[Floats], ArrayLike]  # observations [N, d] -> Q [N, A]
Stakes = Callable[[Floats], Floats]  # observations [N, d] -> [N]


def stakes_of(teacher: Any, action_values: ActionValues | None, n_actions: int) -> Stakes | None:
    """Return what is at stake by the teacher's values; None if it has none.

    Looked for, in this order: ``action_values``, a method ``action_values`` of the teacher, the
    values of the leaves of a ``TreePolicy``.
    """
    values = action_values or getattr(teacher, "action_values", None)
    if values is not None:
        return lambda observations: _gap(values(observations), (len(observations), n_actions))
    if _has_gaps(teacher):
        return lambda observations: Costs.of(teacher, observations, "q-gap").of_action.max(axis=1)
    return None


def weights(stakes: Floats) -> Floats:
    """Return the stakes as weights of mean 1; all 1 if nothing is at stake anywhere."""
    total = float(stakes.sum())
    return stakes * (stakes.size / total) if total > 0.0 else np.ones_like(stakes)


def _gap(values: ArrayLike, shape: tuple[int, int]) -> Floats:
    """Return max_a Q - min_a Q of each row."""
    table = np.asarray(values, dtype=np.float64)
    if table.shape != shape or not np.isfinite(table).all():
        raise InvalidArgumentError(
            f"action_values must return finite numbers of shape {shape}, got shape {table.shape}"
        )
    gap: Floats = table.max(axis=1) - table.min(axis=1)
    return gap


def _has_gaps(teacher: Any) -> bool:
    """Return whether a teacher is a tree whose leaves compare actions by what decides."""
    if not isinstance(teacher, TreePolicy) or teacher.history:
        return False
    return teacher.leaves is not None and teacher.leaves.compares_actions
