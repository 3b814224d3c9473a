"""A room with a heavy wall, a heater of two stages, and electricity that is cheap at night.

A step is a quarter of an hour, an episode two days. The wall stores heat, so it may pay to heat
before the price rises, and to stop before anybody goes to bed.
"""

from typing import Any

import gymnasium
import numpy as np

STEPS, HOURS = 192, 0.25
HEAT = (0.0, 1.5, 3.0)  # kW
CAPACITY = (0.5, 4.0)  # kWh for a kelvin: air and furniture, the wall
THROUGH, OUT, VENT = 0.35, 0.06, 0.04  # kW for a kelvin: air to wall, wall out, air out
PRICES = (0.15, 0.35)  # euros for a kWh: from 22 to 6 o'clock, and by day
COLD = 0.25  # euros for each kelvin and hour outside of the band
BANDS = ((16.0, 24.0), (20.0, 23.0))  # degrees Celsius: nobody up (22 to 6 o'clock), and by day


class HeatedRoom(gymnasium.Env[Any, Any]):
    """A room and its wall.

    Observation: temperature of the air, of the wall and outside, hour of the day. Action: stage of
    the heater. Reward: minus the price of the heat and minus what being too cold or too warm is
    worth, in euros.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("air", "wall", "outside", "hour")
    feature_units = ("°C", "°C", "°C", "h")
    action_names = ("off", "half", "full")

    def __init__(self) -> None:
        low, high = np.array([-50.0, -50.0, -50.0, 0.0]), np.array([80.0, 80.0, 50.0, 24.0])
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Discrete(len(HEAT))

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin at midnight, in any week from autumn to spring."""
        super().reset(seed=seed)
        self._air, self._wall = self.np_random.uniform([17.0, 16.0], [22.0, 20.0])
        self._season, self._weather, self._step = self.np_random.uniform(-3.0, 12.0), 0.0, 0
        return self._observation(), {}

    def step(self, action: int) -> Any:
        """Heat for a quarter of an hour."""
        night = not 6.0 <= self._hour() < 22.0
        inward = THROUGH * (self._air - self._wall)
        lost = VENT * (self._air - self._outside())
        self._air += HOURS * (HEAT[action] - inward - lost) / CAPACITY[0]
        self._wall += HOURS * (inward - OUT * (self._wall - self._outside())) / CAPACITY[1]
        self._weather += 0.2 * self.np_random.standard_normal() - 0.02 * self._weather
        self._step += 1
        low, high = BANDS[0 if night else 1]
        off = max(low - self._air, self._air - high, 0.0)
        cost = HOURS * (PRICES[0 if night else 1] * HEAT[action] + COLD * off)
        return self._observation(), -float(cost), False, self._step >= STEPS, {}

    def _hour(self) -> float:
        return self._step * HOURS % 24.0

    def _outside(self) -> float:
        day = 4.0 * np.sin(2.0 * np.pi * (self._hour() - 9.0) / 24.0)
        return float(np.clip(self._season + self._weather + day, -30.0, 40.0))

    def _observation(self) -> Any:
        return np.array([self._air, self._wall, self._outside(), self._hour()])


def thermostat(observation: Any) -> int:
    """Heat below 21 degrees, fully below 20, whatever the hour: the rule of thumb."""
    air = observation[0]
    return 2 if air < 20.0 else 1 if air < 21.0 else 0


gymnasium.register("HeatedRoom-v0", HeatedRoom)
