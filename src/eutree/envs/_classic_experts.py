"""Simple scripted controllers of some Gymnasium tasks, to demonstrate with.

Each task has a plain one, well below what can be earned, and a better one. Mean returns are those
of 200 episodes with the seeds 0 to 199 (``python benchmarks/experts.py``).
"""

from typing import Any

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.envs._scripted import Rule, RulePolicy
from eutree.errors import InvalidArgumentError


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
        backward = np.where(o[..., 0] > LEFT_SLOPE, 0, 1)
        return np.where(o[..., 1] >= 0.0, 2, backward)

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


# MountainCar: what counts as rolling right; how far left pushing left still helps.
ROLLING, LEFT_SLOPE = 0.005, -0.8
# LunarLander's actions, and how far it tilts at most [rad].
NOTHING, LEFT_ENGINE, MAIN_ENGINE, RIGHT_ENGINE = 0, 1, 2, 3
MAX_TILT = 0.4


def _land(o: Floats, *, tilt: float, fall: float, glide: float) -> Integers:
    """Return the lander's actions.

    Args:
        o: Position x, y, velocity x, y, angle, its velocity, contact of each leg; [..., 8].
        tilt: How much to tilt against the distance from the pad; twice that against drift.
        fall: Velocity of the fall that is allowed at the ground.
        glide: How much more is allowed with height.
    """
    x, y, x_velocity, y_velocity, angle, turning = np.moveaxis(o[..., :6], -1, 0)
    wanted = np.clip(tilt * x + 2.0 * tilt * x_velocity, -MAX_TILT, MAX_TILT)
    lean = angle - wanted + turning
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
