"""Scripted demonstrators of N-Evasion."""

import math
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats, Integers, frozen
from eutree.envs._dynamics import GO, REFLECT, STOP, EvasionParameters, EvasionState, reflect, turn
from eutree.envs._scripted import ScriptedPolicy
from eutree.envs.evasion import EvasionEnv
from eutree.errors import InvalidArgumentError
from eutree.validation import check_number

# The demonstrator waits until the opponent is in the outer 2.5 m of its path: from there it cannot
# be back before the agent is across. A quarter of a metre makes up for noise at the gate.
END_ZONE = 2.5
LAST_STRETCH = 1.5  # the same for who is more careful
GATE_SLACK = 0.25


class GatePolicy(ScriptedPolicy):
    """Waits at the gate of each crossing while its opponent is near.

    The gate of a crossing is the last step before its collision band; where bands are close, a
    gate has no part in the band of another crossing. The rule uses only what a person who watches
    can see and the sensors can express, so a tree can learn it.

    Args:
        parameters: The environment's constants.
        distance: An opponent within this distance of the main path is near [m].
    """

    def __init__(self, parameters: EvasionParameters, distance: float) -> None:
        self.distance = distance
        self._count = parameters.n_opponents
        edge = parameters.crossing - parameters.collision_distance
        self._crossing = parameters.crossing  # [N]
        self._reach = parameters.collision_distance
        self._gate_end = frozen(edge)  # [N]
        self._gate_begin = frozen(edge - GATE_SLACK - parameters.agent_step)  # [N]

    def decide(self, observations: Floats) -> Integers:
        """Return ``STOP`` at the gate of a crossing whose opponent is near, else ``GO``."""
        position = observations[..., :1]
        opponents = observations[..., 1 : 1 + self._count]
        at_gate = (position >= self._gate_begin) & (position < self._gate_end)  # [..., N]
        waits = (at_gate & (np.abs(opponents) < self.distance)).any(axis=-1)
        in_reach = (np.abs(position - self._crossing) < self._reach).any(axis=-1)
        return np.where(waits & ~in_reach, STOP, GO)


class LookAheadPolicy(ScriptedPolicy):
    """Plans with perfect information: directions too, everybody without noise, to the goal.

    At each step the best sequence of actions is found by going backward through all pairs of
    time and number of steps gone; only its first action is taken. Coming nearer to an opponent
    than the collision distance plus ``margin`` costs, in proportion, up to a collision's price.

    Args:
        env: The environment whose full state is read at each step.
        margin: Distance kept from collisions, against noise [m].
    """

    def __init__(self, env: EvasionEnv, margin: float) -> None:
        self._env = env
        self.margin = margin

    def decide(self, observations: Floats) -> Integers:
        """Return the action for the environment's present state; the observation is not used."""
        if observations.ndim != 1:
            raise InvalidArgumentError(
                "the look-ahead expert acts in one environment, whose state it reads; "
                f"got a batch of observations of shape {observations.shape}"
            )
        return np.array(plan(self._env.parameters, self._env.state, self.margin))


def plan(parameters: EvasionParameters, state: EvasionState, margin: float) -> int:
    """Return the first action of the best noise-free plan from ``state``."""
    danger = _danger(parameters, state, margin)  # [H, G + 1]
    value = np.full(danger.shape[1], parameters.collision_reward)  # [G + 1] out of time
    value[-1] = parameters.goal_reward
    stay, leave = value[:-1], value[1:]
    for costs in danger[::-1]:
        stay = value[:-1] - costs[:-1] + parameters.stop_reward
        leave = value[1:] - costs[1:]
        value = np.append(np.maximum(stay, leave), parameters.goal_reward)
    return GO if leave[0] >= stay[0] else STOP


def _danger(parameters: EvasionParameters, state: EvasionState, margin: float) -> Floats:
    """Return the price of being at each place [G + 1] after each number of steps [H]."""
    remaining = parameters.main_path_length - float(state.position)
    n_moves = max(1, math.ceil(remaining / parameters.agent_step))
    horizon = min(parameters.max_steps, n_moves + _two_rounds(parameters))
    opponents = _forecast(parameters, state, horizon)  # [H, N]
    place = float(state.position) + parameters.agent_step * np.arange(n_moves + 1)  # [G + 1]
    along = np.minimum(place, parameters.main_path_length)[:, None] - parameters.crossing
    distance = np.hypot(along[None], opponents[:, None]).min(axis=-1)  # [H, G + 1]
    share = (parameters.collision_distance + margin - distance) / margin
    price = abs(parameters.goal_reward) + abs(parameters.collision_reward)
    return np.asarray(price * np.clip(share, 0.0, 1.0))


def _forecast(parameters: EvasionParameters, state: EvasionState, horizon: int) -> Floats:
    """Return where the opponents are after 1 to ``horizon`` steps without noise, shape [H, N]."""
    if parameters.bounce == REFLECT:
        time = np.arange(1, horizon + 1)[:, None]  # [H, 1]
        target = state.opponents + state.directions * (parameters.opponent_step * time)
        return reflect(target, parameters.half_path)[0]
    places, directions = [state.opponents], state.directions
    for _ in range(horizon):
        target = places[-1] + directions * parameters.opponent_step
        place, turns = turn(target, parameters.half_path)
        places.append(place)
        directions = directions * turns
    return np.array(places[1:])


def _two_rounds(parameters: EvasionParameters) -> int:
    """Return the steps an opponent takes to go there and back twice, at most the trial limit."""
    distance = 4.0 * parameters.path_length
    if parameters.opponent_step * parameters.max_steps <= distance:
        return parameters.max_steps
    return math.ceil(distance / parameters.opponent_step)


def wait_at_crossing(env: Any, *, distance: float | None = None) -> GatePolicy:
    """Return the gate rule for an Evasion environment, single or vector.

    Args:
        env: The environment.
        distance: Wait while the opponent is this near to the main path [m]; by default 2.5 m
            less than half its path (8.5 m of 11 m).
    """
    parameters = _parameters(env)
    if distance is None:
        distance = max(parameters.half_path - END_ZONE, 0.0)
    return GatePolicy(parameters, check_number("distance", distance, low=0.0))


def wait_for_the_end(env: Any) -> GatePolicy:
    """Return the gate rule that waits until the opponent is all but at an end of its path.

    The demonstrator of ``eutree/PaperEvasion2-v0`` and ``eutree/PaperEvasion3-v0``.
    """
    parameters = _parameters(env)
    return GatePolicy(parameters, max(parameters.half_path - LAST_STRETCH, 0.0))


def look_ahead(env: Any, *, margin: float = 0.75) -> LookAheadPolicy:
    """Return the planner with perfect information for an Evasion environment.

    Args:
        env: The environment; it must be a single one.
        margin: Distance kept from collisions, against noise [m].
    """
    _parameters(env)
    if not isinstance(env, gymnasium.Env):
        raise InvalidArgumentError(
            f"env must be a single environment for the look-ahead expert, got {env!r}"
        )
    inner: Any = env.unwrapped
    return LookAheadPolicy(inner, check_number("margin", margin, low=0.0, low_open=True))


def _parameters(env: Any) -> EvasionParameters:
    parameters = getattr(getattr(env, "unwrapped", None), "parameters", None)
    if not isinstance(parameters, EvasionParameters):
        raise InvalidArgumentError(f"env must be an Evasion environment, got {env!r}")
    return parameters
