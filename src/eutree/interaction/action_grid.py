"""Actions that are quantities, such as the opening of a valve, by a grid of levels.

A tree chooses one of finitely many actions; an environment such as Pendulum takes any torque. A
person who knows the task names a few levels of each quantity, and every combination of them is an
action. The levels go with the schema into demonstrations and policies, so that rules name them
with their units and exports return them. ``gymnasium.make`` knows no such argument, so ``make``
adds one: ``action_grid``.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from eutree.errors import InvalidArgumentError, UnsupportedSpaceError, shown
from eutree.schema import MAX_ACTIONS, Control, n_combinations
from eutree.validation import check_vector

ACTION_GRID = "action_grid"  # the argument of ``make``, as it stands in files

# Levels by name, the unit in brackets: {"valve [%]": [0, 50, 100]}; or pairs, as in files.
Grid = Mapping[str, Sequence[float]] | Sequence[tuple[str, Sequence[float]]]


class GriddedAction(gymnasium.ActionWrapper[Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """An environment whose actions are numbers of combinations of levels.

    Action 0 is the first level of every quantity; the levels of the last quantity change fastest.

    Args:
        env: An environment that takes a ``Box`` of numbers.
        grid: The levels of each of these numbers, in their order, by name:
            ``{"valve [%]": [0, 50, 100]}``.

    Attributes:
        controls: The quantities, with names, units and levels.

    Raises:
        InvalidArgumentError: The grid is not as described, or not of the environment.
        UnsupportedSpaceError: The environment's actions are no ``Box``.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], grid: Grid) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, grid=grid)
        super().__init__(env)
        space = env.action_space
        if not isinstance(space, spaces.Box) or not np.issubdtype(space.dtype, np.number):
            raise UnsupportedSpaceError(
                f"{ACTION_GRID} needs an action space that is a Box, got {space}"
            )
        self.controls = controls_of(grid)
        size = int(np.prod(space.shape))
        if len(self.controls) != size:
            raise InvalidArgumentError(
                f"{ACTION_GRID} must have levels for each of the {size} numbers of the action "
                f"space {space}, got {', '.join(control.name for control in self.controls)}"
            )
        for control, low, high in zip(self.controls, space.low.flat, space.high.flat, strict=True):
            own = np.array(control.levels, space.dtype)  # as rounded as the bounds are
            if not ((low <= own) & (own <= high)).all():
                raise InvalidArgumentError(
                    f"{ACTION_GRID} must have levels of {control.name} in [{low:g}, {high:g}], "
                    f"got {list(control.levels)}"
                )
        self._box = space
        self.action_space = spaces.Discrete(n_combinations(self.controls))
        levels = np.meshgrid(*(control.levels for control in self.controls), indexing="ij")
        self._values = np.stack([level.ravel() for level in levels], axis=1)  # [A, K]

    def action(self, action: Any) -> NDArray[Any]:
        """Return the levels of an action, in the shape and type of the environment's own."""
        own: NDArray[Any] = self._values[int(action)].astype(self._box.dtype)
        return own.reshape(self._box.shape)


def controls_of(grid: Any) -> tuple[Control, ...]:
    """Return the quantities of a grid.

    Raises:
        InvalidArgumentError: It is no mapping from names to levels.
    """
    pairs = list(grid.items()) if isinstance(grid, Mapping) else grid
    if not isinstance(pairs, list | tuple) or not all(
        isinstance(pair, list | tuple) and len(pair) == 2 and isinstance(pair[0], str)
        for pair in pairs
    ):
        raise InvalidArgumentError(
            f'{ACTION_GRID} must be like {{"valve [%]": [0, 50, 100]}}, got {shown(grid)}'
        )
    controls = tuple(
        Control.from_label(label, tuple(check_vector(f"{ACTION_GRID}[{label!r}]", levels).tolist()))
        for label, levels in pairs
    )
    if not controls or n_combinations(controls) > MAX_ACTIONS:
        raise InvalidArgumentError(
            f"{ACTION_GRID} must have from 1 to {MAX_ACTIONS:,} combinations, "
            f"got {n_combinations(controls) if controls else 0:,}"
        )
    return controls


def grid_of(env: gymnasium.Env[Any, Any]) -> tuple[Control, ...]:
    """Return the quantities that the actions of ``env`` set; none where it has no grid."""
    actions = env.action_space
    while isinstance(env, gymnasium.Wrapper):
        if isinstance(env, GriddedAction):
            return env.controls if env.action_space == actions else ()
        env = env.env
    return ()


def plain_grid(controls: Sequence[Control]) -> list[list[Any]]:
    """Return the grid as it stands in files: a list, because an object has no order."""
    return [[control.label, list(control.levels)] for control in controls]
