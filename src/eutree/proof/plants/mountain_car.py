"""The plant of Gymnasium's MountainCar, in the order of its operations."""

import numpy as np

from eutree.arrays import Integers
from eutree.proof.intervals import Truth, clip, cos, where
from eutree.proof.plant import Plant, State, own_arguments
from eutree.schema import EnvironmentSpec

_LEFT_END, _RIGHT_END = -1.2, 0.6
_MOST_SPEED = 0.07
_GOAL = 0.5
_FORCE, _GRAVITY = 0.001, 0.0025
_LIMIT = 200


class MountainCar(Plant):
    """A car in a valley; ``gymnasium/envs/classic_control/mountain_car.py``."""

    state = ("position", "velocity")
    start = ((-0.6, -0.4), (0.0, 0.0))
    precision = np.float32
    reward = -1.0

    def __init__(self, spec: EnvironmentSpec) -> None:
        arguments, self.limit = own_arguments(spec, {"goal_velocity": 0}, _LIMIT)
        self.environment = spec
        self._goal_velocity = float(arguments["goal_velocity"])

    def step(self, state: State, action: Integers) -> State:
        """Push, roll, and stop at the left end."""
        position, velocity = state
        velocity = velocity + (cos(3 * position) * -_GRAVITY + (action - 1) * _FORCE)
        velocity = clip(velocity, -_MOST_SPEED, _MOST_SPEED)
        position = clip(position + velocity, _LEFT_END, _RIGHT_END)
        stops = (position <= _LEFT_END) & (velocity < 0.0)
        return position, where(stops, 0.0, velocity)

    def arrives(self, state: State) -> Truth:
        """Return whether the car is at the flag, and fast enough."""
        position, velocity = state
        return (position >= _GOAL) & (velocity >= self._goal_velocity)
