"""Actions that are quantities or come in parts, by levels of each number that is set.

A tree chooses one of finitely many actions; an environment such as Pendulum takes any torque. A
person who knows the task names a few levels of each quantity, and every combination of them is an
action. The levels go with the schema into demonstrations and policies, so that rules name them
with their units and exports return them. ``gymnasium.make`` knows no such argument, so ``make``
adds one: ``action_grid``. Where a space has few values of its own (``MultiDiscrete``,
``MultiBinary``, ``Discrete`` with another start than 0) nobody need name them.

``GriddedAction.number_of`` is the one rule for the meaning of an answer: a float is a quantity, an
integer the number of an action.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats
from eutree.controls import Control, n_combinations
from eutree.errors import InvalidArgumentError, UnsupportedSpaceError, shown
from eutree.schema import MAX_ACTIONS, Schema
from eutree.validation import check_vector

ACTION_GRID = "action_grid"  # the argument of ``make``, as it stands in files

# Levels by name, the unit in brackets: {"valve [%]": [0, 50, 100]}; or pairs, as in files.
Grid = Mapping[str, Sequence[float]] | Sequence[tuple[str, Sequence[float]]] | Sequence[Control]


def name_of(env: gymnasium.Env[Any, Any]) -> str:
    """Return the id of an environment, or the name of its class where it has none."""
    return env.spec.id if env.spec is not None else type(env.unwrapped).__name__


def wrappers_of(env: gymnasium.Env[Any, Any]) -> Iterator[gymnasium.Wrapper[Any, Any, Any, Any]]:
    """Yield the wrappers around an environment, the outermost first."""
    while isinstance(env, gymnasium.Wrapper):
        yield env
        env = env.env


class GriddedAction(gymnasium.ActionWrapper[Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """An environment whose actions are numbers of combinations of levels.

    Action 0 is the first level of every quantity; the levels of the last quantity change fastest.
    ``step`` takes the number of an action, an integer, or the quantities themselves as floats,
    which mean the nearest levels; see ``number_of``.

    Args:
        env: An environment that takes a ``Box`` of numbers, a ``MultiDiscrete``, a ``MultiBinary``
            or a ``Discrete`` that does not start at 0.
        grid: The levels of each of these numbers, in their order, by name:
            ``{"valve [%]": [0, 50, 100]}``; or the ``controls`` of a schema. None takes every
            value that the space has, which a ``Box`` has not.

    Attributes:
        controls: The quantities, with names, units and levels.

    Raises:
        InvalidArgumentError: The grid is not as described, or not of the environment.
        UnsupportedSpaceError: The environment's actions are of none of these spaces, or have too
            many values.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], grid: Grid | None = None) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, grid=grid)
        super().__init__(env)
        self._own = space = env.action_space
        self.controls = _all_values(env) if grid is None else controls_of(grid)
        bounds = bounds_of(space)
        of_numbers = np.issubdtype(space.dtype, np.number)  # a Box may be of truth values
        if bounds is None or counts_from_zero(space) or not of_numbers:
            raise UnsupportedSpaceError(
                f"{ACTION_GRID} needs an action space that is a Box, a MultiDiscrete or a "
                f"MultiBinary, got {space}"
            )
        self._low, self._high = bounds
        self._check()
        self._sizes = [len(control.levels) for control in self.controls]
        self.action_space = spaces.Discrete(n_combinations(self.controls))
        levels = np.meshgrid(*(control.levels for control in self.controls), indexing="ij")
        self._values = np.stack([level.ravel() for level in levels], axis=1)  # [A, K]

    def _check(self) -> None:
        """Raise InvalidArgumentError unless the levels are of the environment's own space."""
        space = self._own
        if len(self.controls) != self._low.size:
            raise InvalidArgumentError(
                f"{ACTION_GRID} must have levels for each of the {self._low.size} numbers of the "
                f"action space {space}, got {', '.join(control.name for control in self.controls)}"
            )
        for control, low, high in zip(self.controls, self._low, self._high, strict=True):
            own = np.array(control.levels, space.dtype)  # as rounded as the bounds are
            whole = np.issubdtype(space.dtype, np.floating) or (own == control.levels).all()
            if not (whole and ((low <= own) & (own <= high)).all()):
                kind = "" if whole else "whole "
                raise InvalidArgumentError(
                    f"{ACTION_GRID} must have {kind}levels of {control.name} in "
                    f"[{low:g}, {high:g}], got {list(control.levels)}"
                )

    def action(self, action: Any) -> Any:
        """Return the levels of an action, in the shape and type of the environment's own."""
        own = self._values[self.number_of(action, "an action")].astype(self._own.dtype)
        return own.reshape(self._own.shape)[()]

    def number_of(self, answer: Any, name: str, *, own: bool = False) -> int:
        """Return the number of the action that an answer means.

        Floats are quantities, one for each control, and mean the nearest levels (the first of two
        that are equally near). One integer is the number of an action, from 0. Several integers
        can be no number, and are quantities too.

        Args:
            answer: A number, or numbers in any shape.
            name: The place where it came from, for the messages.
            own: Whether one integer is an action of the environment below, as its space counts.

        Raises:
            InvalidArgumentError: It is none of these, or outside the environment's own range.
        """
        array = np.asarray(answer)
        n_actions = self._values.shape[0]
        whole = array.dtype.kind in "iub"
        if whole and array.size == 1 and not (own and len(self.controls) == 1):
            number = int(array.reshape(-1)[0])
            if 0 <= number < n_actions:
                return number
        elif (whole or array.dtype.kind == "f") and array.size == len(self.controls):
            return self._nearest(array.reshape(-1).astype(np.float64), name)
        labels = " and ".join(control.label for control in self.controls)
        raise InvalidArgumentError(
            f"{name} must be the number of an action, an integer from 0 to {n_actions - 1}, or "
            f"{'floats' if len(self.controls) > 1 else 'a float'} to set {labels} to, "
            f"got {shown(answer)}"
        )

    def _nearest(self, wanted: Floats, name: str) -> int:
        """Return the number of the action whose levels are nearest to quantities, shape [K]."""
        steps = []
        for k, control in enumerate(self.controls):
            low, high = self._low[k], self._high[k]
            with np.errstate(over="ignore"):
                rounded = wanted[k].astype(low.dtype)  # as the bounds are
            if not (np.isfinite(wanted[k]) and low <= rounded <= high):
                unit = f" {control.unit}" if control.unit else ""
                raise InvalidArgumentError(
                    f"{name} must set {control.name} to a number in [{low:g}, {high:g}]{unit}, as "
                    f"the environment takes it, got {wanted[k]:g}"
                )
            steps.append(int(np.abs(np.array(control.levels) - wanted[k]).argmin()))
        return int(np.ravel_multi_index(steps, self._sizes))


def numbered(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """Return ``env`` if its actions are numbers from 0, else with its actions so numbered.

    Raises:
        UnsupportedSpaceError: Its actions cannot be numbered, or a user has to name the levels.
    """
    return env if counts_from_zero(env.action_space) else GriddedAction(env)


def counts_from_zero(space: spaces.Space[Any]) -> bool:
    """Return whether the actions of a space are the numbers of actions themselves."""
    return isinstance(space, spaces.Discrete) and space.start == 0


def with_grid_of(env: gymnasium.Env[Any, Any], schema: Schema) -> gymnasium.Env[Any, Any]:
    """Return ``env`` with the grid of a schema, where it takes quantities and has no grid.

    Raises:
        InvalidArgumentError: The environment has a grid of other levels.
    """
    is_choice = grid_around(env) is None and counts_from_zero(env.action_space)
    return env if is_choice or not schema.controls else with_grid(env, schema.controls)


def with_grid(env: gymnasium.Env[Any, Any], grid: Grid) -> gymnasium.Env[Any, Any]:
    """Return ``env`` with a grid around it, unless it has the same one already.

    Raises:
        InvalidArgumentError: It has a grid of other levels.
    """
    present = grid_around(env)
    if present is None:
        return GriddedAction(env, grid)
    wanted = controls_of(grid)
    if [control.levels for control in present.controls] != [control.levels for control in wanted]:
        raise InvalidArgumentError(
            f"{ACTION_GRID} must be that of the environment, which has one already, "
            f"{plain_grid(present.controls)}, got {plain_grid(wanted)}"
        )
    return env


def controls_of(grid: Any) -> tuple[Control, ...]:
    """Return the quantities of a grid.

    Raises:
        InvalidArgumentError: It is no mapping from names to levels.
    """
    pairs = list(grid.items()) if isinstance(grid, Mapping) else grid
    if isinstance(pairs, tuple) and pairs and all(isinstance(pair, Control) for pair in pairs):
        return pairs
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
    if not 2 <= n_combinations(controls) <= MAX_ACTIONS:
        raise InvalidArgumentError(
            f"{ACTION_GRID} must have from 2 to {MAX_ACTIONS:,} combinations, "
            f"got {n_combinations(controls) if controls else 0:,}"
        )
    return controls


def grid_around(env: gymnasium.Env[Any, Any]) -> GriddedAction | None:
    """Return the grid that the actions of ``env`` go through; None if there is none."""
    grid = next((one for one in wrappers_of(env) if isinstance(one, GriddedAction)), None)
    return grid if grid is not None and grid.action_space == env.action_space else None


def plain_grid(controls: Sequence[Control]) -> list[list[Any]]:
    """Return the grid as it stands in files: a list, because an object has no order."""
    return [[control.label, list(control.levels)] for control in controls]


def bounds_of(space: spaces.Space[Any]) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Return the least and the largest value of each number of a space, shapes [K].

    None of a space of other things, and of one of spaces.
    """
    if isinstance(space, spaces.Box):
        return space.low.reshape(-1), space.high.reshape(-1)
    if isinstance(space, spaces.MultiBinary):
        size = int(np.prod(space.shape))
        return np.zeros(size), np.ones(size)
    if not isinstance(space, spaces.Discrete | spaces.MultiDiscrete):
        return None
    sizes = space.n if isinstance(space, spaces.Discrete) else space.nvec
    low = np.asarray(space.start, dtype=np.float64).reshape(-1)
    return low, low + np.asarray(sizes, dtype=np.float64).reshape(-1) - 1


def _all_values(env: gymnasium.Env[Any, Any]) -> tuple[Control, ...]:
    """Return a control for each number of a space of few whole values, with all of these.

    They have the names that the environment gives as ``action_names``, one for each number.
    """
    space, name = env.action_space, name_of(env)
    if isinstance(space, spaces.Box):
        raise UnsupportedSpaceError(
            f"{name} must have a Discrete action space, or few levels of its {space}. Name the "
            "levels to choose from: --action-grid NAME=LEVEL,LEVEL,... for each number, or "
            "eutree.interaction.GriddedAction(env, {NAME: [LEVEL, LEVEL, ...]})."
        )
    if not isinstance(space, spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary):
        raise UnsupportedSpaceError(
            f"{name} must have a Discrete, MultiDiscrete or MultiBinary action space, or a Box "
            f"with named levels, got {space}. Wrap it with gymnasium.wrappers.TransformAction."
        )
    low, high = cast(tuple[Floats, Floats], bounds_of(space))
    sizes = (high - low + 1).astype(int).tolist()
    total = math.prod(sizes)
    if total > MAX_ACTIONS:
        raise UnsupportedSpaceError(
            f"{name} must have at most {MAX_ACTIONS:,} actions, and {space} has "
            f"{total if total < 10**12 else 'more than 10**12'} combinations. Name fewer levels, "
            "one to keep a number as it is: --action-grid NAME=LEVEL,LEVEL,... for each number, or "
            "eutree.interaction.GriddedAction(env, {NAME: [LEVEL, LEVEL, ...]})."
        )
    labels = ["action"]
    if not isinstance(space, spaces.Discrete):
        labels = [f"control_{i}" for i in range(len(sizes))]
    given = getattr(env.unwrapped, "action_names", None)
    if given is not None and len(given) == len(sizes) != total:
        labels = [str(label) for label in given]
    return tuple(
        Control.from_label(label, tuple(first + k for k in range(size)))
        for label, first, size in zip(labels, low.tolist(), sizes, strict=True)
    )


class ActionMasks:
    """Reads the masks of one environment."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        self._env = env
        own = env.has_wrapper_attr("action_masks")
        self._ask = env.get_wrapper_attr("action_masks") if own else None
        self._sizes: list[int] | None = None  # of the parts, where it says those

    def own(self, allowed: Booleans | None) -> Booleans | None:
        """Return a mask of actions [A]; that of all parts, in a row, where ``env`` says those."""
        if allowed is not None and self._sizes is None:  # the episode was played elsewhere
            self._sizes = []
            self.now(self._env.reset(seed=0)[1])
        if allowed is None or not self._sizes:
            return allowed
        places = zip(self._sizes, allowed.reshape(self._sizes).nonzero(), strict=True)
        return np.concatenate([np.isin(range(size), levels) for size, levels in places])

    def now(self, info: dict[str, Any]) -> Booleans | None:
        """Return which actions are allowed, shape [A]; None where nothing is said of it.

        Of actions in parts the mask may be that of all parts, one after the other, as for
        sb3-contrib's MaskablePPO: an action is allowed if all its levels are.

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
        of_parts = isinstance(mask, tuple | list) and any(np.ndim(part) for part in mask)
        try:
            of_all = np.concatenate([np.ravel(part) for part in mask]) if of_parts else mask
            allowed = np.asarray(of_all).reshape(-1).astype(np.float64)
        except (TypeError, ValueError):
            allowed = np.empty(0)
        sizes = [] if grid is None else [len(control.levels) for control in grid.controls]
        self._sizes = []
        if sum(sizes) == n_actions and len(sizes) > 1 and not of_parts and np.ndim(mask) == 1:
            raise InvalidArgumentError(
                f"an action mask must be a tuple, a mask for each part, or of shape {(*sizes,)} "
                f"for all combinations: {n_actions} numbers may be either, got {shown(mask)}"
            )
        if allowed.size == sum(sizes) and (of_parts or allowed.size != n_actions):
            parts, self._sizes = np.split(allowed, np.cumsum(sizes)[:-1]), sizes
            allowed = np.min(np.meshgrid(*parts, indexing="ij"), axis=0).reshape(-1)
        if allowed.size != n_actions or not np.isin(allowed, (0.0, 1.0)).all():
            raise InvalidArgumentError(
                f"an action mask must say of each of the {n_actions} actions whether it is "
                f"allowed, got {shown(mask)}"
            )
        if not allowed.any():
            raise InvalidArgumentError("an action mask must allow at least one action, got none")
        return allowed.astype(np.bool_)
