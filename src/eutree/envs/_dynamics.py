"""The physics of N-Evasion: pure functions of parameters, state, action and pre-drawn noise.

An agent stands at ``position`` on the main path, x from 0 to its length. Opponent i moves on its
own path, which crosses the main path at right angles at ``crossing[i]``; ``opponents[i]`` is its
signed distance from the main path, ``directions[i]`` is +1 or -1. One step moves everybody,
reflects the opponents at the ends of their paths, and only then looks for a collision.

Every function works elementwise on leading axes, so one state or a batch of states is moved by
the same operations in the same order. ``_kernels.advance_all`` repeats that order operation by
operation; only so do the single and the vector environment agree bit for bit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats, Integers, frozen
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.validation import check_choice, check_integer, check_number

STOP, GO = 0, 1

RUNNING, GOAL, COLLISION, TIME_LIMIT = 0, 1, 2, 3
ENDINGS = ("", "goal", "collision", "time limit")

# Where opponents are when an episode begins, and how they turn at an end of their path.
STARTS = ANYWHERE, EITHER_END, SAME_END = "anywhere", "either end", "same end"
BOUNCES = REFLECT, TURN = "reflect", "turn"

# An episode's noise is drawn at once: a limit keeps a mistyped time step from filling the memory.
MAX_NOISE = 10_000_000


@dataclass(frozen=True, kw_only=True)
class EvasionParameters:
    """The arguments of the domain, checked, and the constants that follow from them.

    The card of ``EvasionEnv`` has their meaning and units.
    """

    n_opponents: int = 2
    opponent_speed: float = 3.2
    agent_speed: float = 2.0
    path_length: float = 22.0
    main_path_length: float = 30.0
    crossings: Sequence[float] | None = None
    noise: float = 0.02
    time_step: float = 1.0
    collision_distance: float = 2.0
    trial_limit: float = 60.0
    observe_direction: bool = False
    start: str = ANYWHERE
    bounce: str = REFLECT
    goal_reward: float = 100.0
    collision_reward: float = -50.0
    stop_reward: float = -2.0

    crossing: Floats = field(init=False, repr=False, compare=False)  # [N]
    half_path: float = field(init=False, repr=False, compare=False)
    agent_step: float = field(init=False, repr=False, compare=False)
    opponent_step: float = field(init=False, repr=False, compare=False)
    collision_square: float = field(init=False, repr=False, compare=False)
    max_steps: int = field(init=False, repr=False, compare=False)
    start_number: int = field(init=False, repr=False, compare=False)  # place in STARTS
    bounce_number: int = field(init=False, repr=False, compare=False)  # place in BOUNCES

    def __post_init__(self) -> None:
        self._set("n_opponents", check_integer("n_opponents", self.n_opponents, low=1))
        for name in ("agent_speed", "path_length", "main_path_length", "time_step", "trial_limit"):
            self._set(name, check_number(name, getattr(self, name), low=0.0, low_open=True))
        for name in ("opponent_speed", "noise", "collision_distance"):
            self._set(name, check_number(name, getattr(self, name), low=0.0))
        for name in ("goal_reward", "collision_reward", "stop_reward"):
            self._set(name, check_number(name, getattr(self, name)))
        if not isinstance(self.observe_direction, bool | np.bool_):
            raise InvalidArgumentError(
                f"observe_direction must be True or False, got {self.observe_direction!r}"
            )
        self._set("start_number", STARTS.index(check_choice("start", self.start, STARTS)))
        self._set("bounce_number", BOUNCES.index(check_choice("bounce", self.bounce, BOUNCES)))
        self._set("crossing", frozen(self._crossing_points()))
        self._set("half_path", self.path_length / 2.0)
        self._set("agent_step", self.agent_speed * self.time_step)
        self._set("opponent_step", self.opponent_speed * self.time_step)
        self._set("collision_square", self.collision_distance * self.collision_distance)
        self._set("max_steps", self._step_limit())

    @classmethod
    def from_arguments(cls, arguments: Mapping[str, Any]) -> "EvasionParameters":
        """Return the parameters with the given arguments; an unknown name is an error."""
        for name in arguments:
            if name not in DEFAULTS:
                raise UnknownNameError("argument of the Evasion environment", name, DEFAULTS)
        return cls(**arguments)

    @property
    def n_features(self) -> int:
        """Length of an observation."""
        return 1 + self.n_opponents * (2 if self.observe_direction else 1)

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _crossing_points(self) -> Floats:
        """Return where the paths cross, shape [N]: as given, or equally spaced."""
        count, length = self.n_opponents, self.main_path_length
        if self.crossings is None:
            return length * np.arange(1, count + 1) / (count + 1)
        if isinstance(self.crossings, str) or not isinstance(self.crossings, Sequence | np.ndarray):
            raise InvalidArgumentError(
                f"crossings must be None or a sequence of {count} numbers, got {self.crossings!r}"
            )
        if len(self.crossings) != count:
            raise InvalidArgumentError(
                f"crossings must hold n_opponents = {count} numbers, got {len(self.crossings)}"
            )
        points = [
            check_number(f"crossings[{i}]", point, low=0.0, high=length)
            for i, point in enumerate(self.crossings)
        ]
        self._set("crossings", tuple(points))
        return np.array(points)

    def _step_limit(self) -> int:
        """Return how many steps the trial limit allows; a last, partial step counts."""
        steps = self.trial_limit / self.time_step
        if steps * (self.n_opponents + 1) > MAX_NOISE:
            raise InvalidArgumentError(
                f"trial_limit / time_step must be at most {MAX_NOISE // (self.n_opponents + 1)} "
                f"steps with {self.n_opponents} opponents, got {steps:g}"
            )
        nearest = round(steps)  # 60 / 0.1 must be 600, also where the last bit is off
        is_whole = nearest >= 1 and math.isclose(steps, nearest, rel_tol=1e-9)
        return nearest if is_whole else math.ceil(steps)


DEFAULTS = {parameter.name: parameter.default for parameter in fields(EvasionParameters)
            if parameter.init}  # fmt: skip


@dataclass(frozen=True, slots=True)
class EvasionState:
    """Where everybody is, and where the opponents are heading."""

    position: Floats  # [...]
    opponents: Floats  # [..., N]
    directions: Floats  # [..., N]


def draw(parameters: EvasionParameters, generator: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw all chance of one episode: uniforms of the start [2 N] and noise [T, N + 1]."""
    uniforms = generator.random(2 * parameters.n_opponents)
    return uniforms, generator.standard_normal((parameters.max_steps, parameters.n_opponents + 1))


def start(parameters: EvasionParameters, uniforms: Floats) -> EvasionState:
    """Return the first state: the agent at 0, opponents as ``parameters.start`` says.

    Anywhere: uniform on their paths, directions fair coins. At an end they head inwards.
    """
    count, half = parameters.n_opponents, parameters.half_path
    opponents = (2.0 * uniforms[..., :count] - 1.0) * half
    directions = np.where(uniforms[..., count:] < 0.5, -1.0, 1.0)
    if parameters.start != ANYWHERE:
        directions = directions if parameters.start == EITHER_END else np.full_like(directions, -1)
        opponents = -directions * half
    return EvasionState(
        position=np.zeros(uniforms.shape[:-1]), opponents=opponents, directions=directions
    )


def advance(
    parameters: EvasionParameters,
    state: EvasionState,
    action: int | Integers,  # [...]
    noise: Floats,  # [..., N + 1]
    *,
    part: float = 1.0,
) -> EvasionState:
    """Return the state one step later; a noisy step may be long or short, never backward.

    With ``part`` below 1, only that share of the step is taken, as a moving picture needs it.
    """
    factor = part * np.maximum(1.0 + parameters.noise * noise, 0.0)
    position = state.position + action * (parameters.agent_step * factor[..., 0])
    travelled = state.directions * (parameters.opponent_step * factor[..., 1:])
    bounced = reflect if parameters.bounce == REFLECT else turn
    opponents, turns = bounced(state.opponents + travelled, parameters.half_path)
    return EvasionState(
        position=np.minimum(position, parameters.main_path_length),
        opponents=opponents,
        directions=state.directions * turns,
    )


def reflect(target: Floats, half_path: float) -> tuple[Floats, Floats]:
    """Fold positions beyond the ends of a path back onto it, however far beyond they are.

    Return them, and +1 or -1 by which to multiply the direction: -1 after an odd number of turns.
    """
    path = 2.0 * half_path
    passes = np.floor((target + half_path) / path)  # ends passed; 0 on the path itself
    turns = 1.0 - 2.0 * (passes - 2.0 * np.floor(passes / 2.0))
    folded = turns * (target - path * passes)
    return np.minimum(np.maximum(folded, -half_path), half_path), turns


def turn(target: Floats, half_path: float) -> tuple[Floats, Floats]:
    """Hold positions beyond the ends of a path at its end; return also -1 where they turn, or 1."""
    turns = np.where((target < -half_path) | (target >= half_path), -1.0, 1.0)
    return np.minimum(np.maximum(target, -half_path), half_path), turns


def collides(parameters: EvasionParameters, state: EvasionState) -> Booleans:
    """Return whether any opponent is within the collision distance of the agent."""
    along = state.position[..., None] - parameters.crossing
    square = along * along + state.opponents * state.opponents
    return np.asarray((square <= parameters.collision_square).any(axis=-1))


def ending(parameters: EvasionParameters, state: EvasionState, step: int) -> int:
    """Return how the episode has ended after ``step`` steps, ``RUNNING`` if it has not.

    A collision counts before the goal, and both before the time limit.
    """
    if collides(parameters, state):
        return COLLISION
    if state.position >= parameters.main_path_length:
        return GOAL
    return TIME_LIMIT if step >= parameters.max_steps else RUNNING


def reward(parameters: EvasionParameters, action: int, ended: int) -> float:
    """Return the reward of a step: the price of ``stop`` plus that of the ending."""
    price = parameters.stop_reward if action == STOP else 0.0
    if ended == GOAL:
        return price + parameters.goal_reward
    return price + parameters.collision_reward if ended == COLLISION else price


def observe(parameters: EvasionParameters, state: EvasionState) -> Floats:
    """Return the observations, shape [..., d]: positions, and directions if asked for."""
    columns = [state.position[..., None], state.opponents]
    if parameters.observe_direction:
        columns.append(state.directions)
    return np.concatenate(columns, axis=-1)


def bounds(parameters: EvasionParameters) -> tuple[Floats, Floats]:
    """Return the smallest and largest observation possible, each of shape [d]."""
    count, half = parameters.n_opponents, parameters.half_path
    reach = [half] * count + [1.0] * (count if parameters.observe_direction else 0)
    return np.array([0.0, *(-r for r in reach)]), np.array([parameters.main_path_length, *reach])


def as_action(value: Any) -> int:
    """Return ``value`` as ``STOP`` or ``GO``, or raise InvalidArgumentError."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    is_integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_integer or value not in (STOP, GO):
        raise InvalidArgumentError(f"action must be 0 (stop) or 1 (go), got {value!r}")
    return int(value)


def as_actions(value: Any, count: int) -> NDArray[np.int64]:
    """Return ``value`` as a vector of ``count`` actions, or raise InvalidArgumentError."""
    actions = np.asarray(value)
    if actions.shape != (count,) or actions.dtype.kind not in "iu":
        raise InvalidArgumentError(
            f"actions must be {count} integers, got shape {actions.shape} of {actions.dtype}"
        )
    wrong = (actions != STOP) & (actions != GO)
    if wrong.any():
        place = int(np.argmax(wrong))
        raise InvalidArgumentError(
            f"actions must be 0 (stop) or 1 (go), got {actions[place]} at [{place}]"
        )
    return actions.astype(np.int64, copy=False)
