"""Policies that decide by the present observation alone, by a written rule."""

import math
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats, Integers, frozen
from eutree.envs._dynamics import GO, REFLECT, STOP, EvasionParameters, EvasionState, reflect, turn
from eutree.envs.evasion import EvasionEnv
from eutree.errors import InvalidArgumentError
from eutree.features import MemorylessPolicy

Rule = Callable[[Floats], Integers]  # [..., d] -> [...]


class RulePolicy(MemorylessPolicy):
    """Acts by a written rule, from observations [..., d] to actions [...]."""

    def __init__(self, rule: Rule) -> None:
        self._rule = rule

    def decide(self, observations: Floats) -> Integers:
        """Return the rule's actions."""
        return self._rule(observations)


# Each task has a plain one, well below the best return, and a better one. Mean returns are those of
# 200 episodes with the seeds 0 to 199 (``python benchmarks/experts.py``).


def follow_the_fall(env: Any) -> RulePolicy:
    """Return a rule for CartPole: push to the side to which the pole is turning.

    Mean return 200.
    """
    return _policy(env, 4, lambda o: np.where(o[..., 3] > 0.0, 1, 0))


def balance(env: Any) -> RulePolicy:
    """Return a rule for CartPole: push to where the pole is about to be.

    Mean return 500.
    """
    return _policy(env, 4, lambda o: np.where(o[..., 2] + 0.2 * o[..., 3] > 0.0, 1, 0))


def push_along(env: Any) -> RulePolicy:
    """Return a rule for MountainCar: right when rolling right, else left.

    Mean return -132.
    """
    return _policy(env, 2, lambda o: np.where(o[..., 1] > ROLLING, 2, 0))


def rock(env: Any) -> RulePolicy:
    """Return a rule for MountainCar: push along, but not far up the left slope.

    Mean return -118.
    """

    def rule(o: Floats) -> Integers:
        return np.where(o[..., 1] >= 0.0, 2, np.where(o[..., 0] > LEFT_SLOPE, 0, 1))

    return _policy(env, 2, rule)


def swing_both(env: Any) -> RulePolicy:
    """Return a rule for Acrobot: torque along a mix of both joints' velocities.

    Mean return -110.
    """
    return _policy(env, 6, lambda o: np.where(o[..., 5] + 0.3 * o[..., 4] > 0.0, 2, 0))


def swing_elbow(env: Any) -> RulePolicy:
    """Return a rule for Acrobot: torque along the elbow's velocity.

    Mean return -86.
    """
    return _policy(env, 6, lambda o: np.where(o[..., 5] > 0.0, 2, 0))


def brake_upright(env: Any) -> RulePolicy:
    """Return a rule for LunarLander: stay upright and brake, drift as it comes.

    Mean return -1, standard deviation 156: it lands where the drift happens to be small.
    """
    return _policy(env, 8, lambda o: _land(o, tilt=0.0, fall=0.15, glide=0.4))


def steer_home(env: Any) -> RulePolicy:
    """Return a rule for LunarLander: tilt against distance and drift, and brake.

    Mean return 255.
    """
    return _policy(env, 8, lambda o: _land(o, tilt=0.5, fall=0.05, glide=0.3))


def swing_upright(env: Any) -> RulePolicy:
    """Return a rule for Pendulum with an action grid: swing up by energy, hold upright.

    It wants a torque and takes the nearest of the grid. With 5 levels from -2 to 2 N m the mean
    return is -148 (60 episodes).
    """
    try:
        (control,) = env.get_wrapper_attr("controls")
    except (AttributeError, ValueError):
        raise InvalidArgumentError(
            "env must have one control to set for this expert: "
            "--action-grid 'torque [N m]=-2:2:5', or eutree.interaction.GriddedAction"
        ) from None
    levels = np.array(control.levels)

    def rule(o: Floats) -> Integers:
        torque = _hold_or_pump(o)
        nearest: Integers = np.abs(levels - torque[..., np.newaxis]).argmin(axis=-1)
        return nearest

    return _policy(env, 3, rule)


# Pendulum: energy of rest upright [m² / s², for mass and length 1]; where it holds [rad].
UPRIGHT_ENERGY, CAUGHT = 5.0, 0.5


def _hold_or_pump(o: Floats) -> Floats:
    """Return the torque that a pendulum needs, [N m]; o: cos and sin of its angle, its rate."""
    angle, rate = np.arctan2(o[..., 1], o[..., 0]), o[..., 2]
    energy = rate**2 / 6.0 + UPRIGHT_ENERGY * o[..., 0]
    pump = np.where(rate >= 0.0, 2.0, -2.0) * np.sign(UPRIGHT_ENERGY - energy)
    hold = -(10.0 * angle + 2.5 * rate)
    caught = np.abs(angle + 0.15 * rate) < CAUGHT
    torque: Floats = np.where(caught, hold, pump)
    return torque


# MountainCar: speed that counts as rolling right; how far left pushing left still helps.
ROLLING, LEFT_SLOPE = 0.005, -0.8
# LunarLander's actions, and how far it tilts at most [rad].
NOTHING, LEFT_ENGINE, MAIN_ENGINE, RIGHT_ENGINE = 0, 1, 2, 3
MAX_TILT = 0.4


def _land(o: Floats, *, tilt: float, fall: float, glide: float) -> Integers:
    """Return the lander's actions.

    It tilts by ``tilt`` against the distance from the pad, and twice that against drift. ``fall``
    is the velocity that is allowed at the ground, ``glide`` how much more with height.
    """
    # o: position x, y, velocity x, y, angle, its velocity, contact of each leg; [..., 8]
    x, y, x_velocity, y_velocity, angle, turning = np.moveaxis(o[..., :6], -1, 0)
    lean = angle - np.clip(tilt * x + 2.0 * tilt * x_velocity, -MAX_TILT, MAX_TILT) + turning
    sideways = np.where(lean > 0.1, RIGHT_ENGINE, np.where(lean < -0.1, LEFT_ENGINE, NOTHING))
    in_air = np.where(y_velocity < -(fall + glide * y), MAIN_ENGINE, sideways)
    on_ground = np.where(y_velocity < -0.1, MAIN_ENGINE, NOTHING)
    return np.where((o[..., 6:] > 0.0).any(axis=-1), on_ground, in_air)


def _policy(env: Any, n_features: int, rule: Rule) -> RulePolicy:
    space = getattr(env, "single_observation_space", None) or env.observation_space
    if space.shape != (n_features,):
        raise InvalidArgumentError(
            f"env must have observations of {n_features} numbers for this expert, got {space}"
        )
    return RulePolicy(rule)


# The demonstrator waits until the opponent is in the outer 2.5 m of its path: from there it cannot
# be back before the agent is across. A quarter of a metre makes up for noise at the gate.
END_ZONE = 2.5
LAST_STRETCH = 1.5  # the same for who is more careful
GATE_SLACK = 0.25
MARGIN = 0.75  # that the planner keeps from collisions, against noise [m]


class GatePolicy(MemorylessPolicy):
    """Waits at the gate of each crossing while its opponent is near.

    The gate of a crossing is the last step before its collision band; where bands are close, a gate
    has no part in the band of another crossing. The rule uses only observations that a person who
    watches can see, so a tree can learn it.

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


class LookAheadPolicy(MemorylessPolicy):
    """Plans with perfect information: directions too, everybody without noise, to the goal.

    At each step the full state of ``env`` is read, and the best sequence of actions is found by
    going backward through all pairs of time and number of steps gone; only its first action is
    taken. Coming nearer to an opponent than the collision distance plus ``MARGIN`` costs, in
    proportion, up to a collision's price.
    """

    def __init__(self, env: EvasionEnv) -> None:
        self._env = env

    def decide(self, observations: Floats) -> Integers:
        """Return the action for the environment's present state; the observation is not used."""
        if observations.ndim != 1:
            raise InvalidArgumentError(
                "the look-ahead expert acts in one environment, whose state it reads; "
                f"got a batch of observations of shape {observations.shape}"
            )
        return np.array(plan(self._env.parameters, self._env.state))


def plan(parameters: EvasionParameters, state: EvasionState) -> int:
    """Return the first action of the best noise-free plan from ``state``."""
    danger = _danger(parameters, state)  # [H, G + 1]
    value = np.full(danger.shape[1], parameters.collision_reward)  # [G + 1] out of time
    value[-1] = parameters.goal_reward
    stay, leave = value[:-1], value[1:]
    for costs in danger[::-1]:
        stay = value[:-1] - costs[:-1] + parameters.stop_reward
        leave = value[1:] - costs[1:]
        value = np.append(np.maximum(stay, leave), parameters.goal_reward)
    return GO if leave[0] >= stay[0] else STOP


def _danger(parameters: EvasionParameters, state: EvasionState) -> Floats:
    """Return the price of being at each place [G + 1] after each number of steps [H]."""
    remaining = parameters.main_path_length - float(state.position)
    n_moves = max(1, math.ceil(remaining / parameters.agent_step))
    horizon = min(parameters.max_steps, n_moves + _two_rounds(parameters))
    opponents = _forecast(parameters, state, horizon)  # [H, N]
    place = float(state.position) + parameters.agent_step * np.arange(n_moves + 1)  # [G + 1]
    along = np.minimum(place, parameters.main_path_length)[:, None] - parameters.crossing
    distance = np.hypot(along[None], opponents[:, None]).min(axis=-1)  # [H, G + 1]
    share = (parameters.collision_distance + MARGIN - distance) / MARGIN
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


def wait_at_crossing(env: Any) -> GatePolicy:
    """Return the gate rule for an Evasion environment, single or vector.

    It waits while the opponent is nearer to the main path than 2.5 m less than half its own path
    (8.5 m of 11 m).
    """
    parameters = _parameters(env)
    return GatePolicy(parameters, max(parameters.half_path - END_ZONE, 0.0))


def wait_for_the_end(env: Any) -> GatePolicy:
    """Return the gate rule that waits until the opponent is all but at an end of its path.

    The demonstrator of ``eutree/PaperEvasion2-v0`` and ``eutree/PaperEvasion3-v0``.
    """
    parameters = _parameters(env)
    return GatePolicy(parameters, max(parameters.half_path - LAST_STRETCH, 0.0))


def look_ahead(env: Any) -> LookAheadPolicy:
    """Return the planner with perfect information for a single Evasion environment."""
    _parameters(env)
    if not isinstance(env, gymnasium.Env):
        raise InvalidArgumentError(
            f"env must be a single environment for the look-ahead expert, got {env!r}"
        )
    inner: Any = env.unwrapped
    return LookAheadPolicy(inner)


def _parameters(env: Any) -> EvasionParameters:
    parameters = getattr(getattr(env, "unwrapped", None), "parameters", None)
    if not isinstance(parameters, EvasionParameters):
        raise InvalidArgumentError(f"env must be an Evasion environment, got {env!r}")
    return parameters
