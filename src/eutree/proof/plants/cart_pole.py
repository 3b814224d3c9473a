"""The plant of Gymnasium's CartPole, in the order of its operations."""

import math
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats, Integers
from eutree.proof.intervals import cos, sin
from eutree.proof.plant import Plant, State, own_arguments
from eutree.schema import EnvironmentSpec

_GRAVITY, _POLE_MASS, _TOTAL_MASS, _LENGTH = 9.8, 0.1, 0.1 + 1.0, 0.5
_POLE_MASS_LENGTH = _POLE_MASS * _LENGTH
_FORCE, _TAU = 10.0, 0.02
_EDGE, _FALL = 2.4, 12 * 2 * math.pi / 360
_LIMIT = 500
_STRUCK = 43691 / 65536  # m up the pole, nearly 2/3: there a push on the cart moves nothing


class CartPole(Plant):
    """A pole on a cart; ``gymnasium/envs/classic_control/cartpole.py``, Euler's method.

    Its axes are those of the upright pole. Along the first it falls, 8 % farther with every step,
    and along the second it comes to rest; the quarter stands for 1 / 3.97 s, for it is exact. The
    other two are the speed and the place of the point of the pole that a push on the cart does not
    move: what the angle has summed up.
    """

    state = ("position", "velocity", "angle", "angular_velocity")
    start = ((-0.05, 0.05),) * 4
    axes = (
        (0.0, 0.0, 1.0, 0.25), (0.0, 0.0, 1.0, -0.25), (0.0, 1.0, 0.0, _STRUCK),
        (1.0, 0.0, _STRUCK, 0.0),
    )  # fmt: skip
    cells = (0.004, 0.004, 0.1, 0.1)
    precision = np.float32
    question = f"stays in -{_EDGE} <= position <= {_EDGE} and -{_FALL!r} <= angle <= {_FALL!r}"

    def __init__(self, spec: EnvironmentSpec) -> None:
        _, self.limit = own_arguments(spec, {"sutton_barto_reward": False}, _LIMIT)
        self.environment = spec

    def step(self, state: State, action: Integers) -> State:
        """Push the cart to either side for a fiftieth of a second."""
        position, velocity, angle, turning = state
        force = _FORCE * (2.0 * action - 1.0)
        cosine, sine = cos(angle), sin(angle)
        push = (force + _POLE_MASS_LENGTH * turning.square() * sine) / _TOTAL_MASS
        bending = (_GRAVITY * sine - cosine * push) / (
            _LENGTH * (4.0 / 3.0 - _POLE_MASS * cosine.square() / _TOTAL_MASS)
        )
        moving = push - _POLE_MASS_LENGTH * bending * cosine / _TOTAL_MASS
        return [
            position + _TAU * velocity,
            velocity + _TAU * moving,
            angle + _TAU * turning,
            turning + _TAU * bending,
        ]

    def put(self, env: gymnasium.Env[Any, Any], point: Floats) -> Any:
        """Begin an episode of the real cart in a state."""
        observation = super().put(env, point)
        real: Any = env.unwrapped
        real.steps_beyond_terminated = None
        return observation
