"""Which actions an environment allows: ``info["action_mask"]``, or its method ``action_masks``."""

from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans
from eutree.errors import InvalidArgumentError, shown
from eutree.interaction.action_grid import grid_around, numbered


class ActionMasks:
    """Reads the masks of one environment.

    Args:
        env: The environment.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        self._env = env
        own = env.has_wrapper_attr("action_masks")
        self._ask = env.get_wrapper_attr("action_masks") if own else None

    def now(self, info: dict[str, Any]) -> Booleans | None:
        """Return which actions are allowed, shape [A]; None where nothing is said of it.

        Of actions in parts the mask may be that of all parts, one after the other, as for
        sb3-contrib's MaskablePPO: an action is allowed if all its levels are.

        Args:
            info: What the environment said with the present observation.

        Raises:
            InvalidArgumentError: It is no mask of the actions, or allows none.
        """
        mask = info.get("action_mask")
        if mask is None and self._ask is not None:
            mask = self._ask()
        return None if mask is None else self._of_actions(mask)

    def _of_actions(self, mask: Any) -> Booleans:
        env = numbered(self._env)
        grid, n_actions = grid_around(env), int(env.action_space.n)  # type: ignore[attr-defined]  # a Discrete
        try:
            if isinstance(mask, tuple | list):  # one for each part
                mask = np.concatenate([np.atleast_1d(part) for part in mask])
            allowed = np.asarray(mask).reshape(-1).astype(np.float64)
        except (TypeError, ValueError):
            allowed = np.empty(0)
        sizes = [] if grid is None else [len(control.levels) for control in grid.controls]
        if allowed.size == sum(sizes) != n_actions:
            parts = np.split(allowed, np.cumsum(sizes)[:-1])
            allowed = np.min(np.meshgrid(*parts, indexing="ij"), axis=0).reshape(-1)
        if allowed.size != n_actions or not np.isin(allowed, (0.0, 1.0)).all():
            raise InvalidArgumentError(
                f"an action mask must say of each of the {n_actions} actions whether it is "
                f"allowed, got {shown(mask)}"
            )
        if not allowed.any():
            raise InvalidArgumentError("an action mask must allow at least one action, got none")
        return allowed.astype(np.bool_)
