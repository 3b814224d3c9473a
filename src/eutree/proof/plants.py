"""The plants that are known, by the ids of their environments; each in the order of its task."""

import math
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats, Integers
from eutree.envs import PLANTS
from eutree.proof.intervals import Truth, clip, cos, sin, where
from eutree.proof.plant import Plant, State, own_arguments
from eutree.schema import EnvironmentSpec

Factory = Callable[[EnvironmentSpec], Plant]

_POLE_GRAVITY, _POLE_MASS, _TOTAL_MASS, _LENGTH = 9.8, 0.1, 0.1 + 1.0, 0.5
_POLE_MASS_LENGTH = _POLE_MASS * _LENGTH
_POLE_FORCE, _TAU = 10.0, 0.02
_EDGE, _FALL = 2.4, 12 * 2 * math.pi / 360
_POLE_LIMIT = 500
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
        _, self.limit = own_arguments(spec, {"sutton_barto_reward": False}, _POLE_LIMIT)
        self.environment = spec

    def step(self, state: State, action: Integers) -> State:
        """Push the cart to either side for a fiftieth of a second."""
        position, velocity, angle, turning = state
        force = _POLE_FORCE * (2.0 * action - 1.0)
        cosine, sine = cos(angle), sin(angle)
        push = (force + _POLE_MASS_LENGTH * turning.square() * sine) / _TOTAL_MASS
        bending = (_POLE_GRAVITY * sine - cosine * push) / (
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


_LEFT_END, _RIGHT_END = -1.2, 0.6
_MOST_SPEED = 0.07
_GOAL = 0.5
_CAR_FORCE, _CAR_GRAVITY = 0.001, 0.0025
_CAR_LIMIT = 200


class MountainCar(Plant):
    """A car in a valley; ``gymnasium/envs/classic_control/mountain_car.py``."""

    state = ("position", "velocity")
    start = ((-0.6, -0.4), (0.0, 0.0))
    precision = np.float32
    reward = -1.0

    def __init__(self, spec: EnvironmentSpec) -> None:
        arguments, self.limit = own_arguments(spec, {"goal_velocity": 0}, _CAR_LIMIT)
        self.environment = spec
        self._goal_velocity = float(arguments["goal_velocity"])

    def step(self, state: State, action: Integers) -> State:
        """Push, roll, and stop at the left end."""
        position, velocity = state
        velocity = velocity + (cos(3 * position) * -_CAR_GRAVITY + (action - 1) * _CAR_FORCE)
        velocity = clip(velocity, -_MOST_SPEED, _MOST_SPEED)
        position = clip(position + velocity, _LEFT_END, _RIGHT_END)
        stops = (position <= _LEFT_END) & (velocity < 0.0)
        return position, where(stops, 0.0, velocity)

    def arrives(self, state: State) -> Truth:
        """Return whether the car is at the flag, and fast enough."""
        position, velocity = state
        return (position >= _GOAL) & (velocity >= self._goal_velocity)


_OWN: dict[str, Factory] = {"CartPole-v1": CartPole, "MountainCar-v0": MountainCar}


def register_plant(environment: str, factory: Factory) -> None:
    """Let ``eutree prove`` find the plant of an environment, by the environment's id.

    Args:
        environment: The id, such as ``"MyTank-v0"``; a namespace belongs to it, a module does not.
        factory: Returns the plant for the id and the arguments of ``gymnasium.make``.
    """
    PLANTS[environment] = factory


def plant_of(spec: EnvironmentSpec | None) -> Plant | None:
    """Return the plant of an environment, or None where none is known."""
    factory = None if spec is None else {**_OWN, **PLANTS}.get(spec.id.rpartition(":")[2])
    return None if spec is None or factory is None else factory(spec)
