"""A house with a roof of solar cells, a battery, and a price of electricity that changes hourly.

Each step is a quarter of an hour of one day, whose prices are known in advance, as at an exchange.
"""

from typing import Any

import gymnasium
import numpy as np

STEPS, HOURS = 96, 0.25
CAPACITY, POWER = 10.0, 3.0  # kWh, kW
EFFICIENCY = 0.92  # of charging
FEED_IN, WEAR = 0.06, 0.01  # euros for a kWh: sold to the grid, and moved through the battery
ACTIONS = ("discharge", "rest", "charge")


class HouseBattery(gymnasium.Env[Any, Any]):
    """One day of a house.

    Observation: hour of the day, charge of the battery, power of the roof and of the house, price
    now, in three hours, and on the day's average, and the energy still expected from the roof.
    Reward: minus what the quarter of an hour cost (euros); in the end the charge is worth the
    average price.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("hour", "charge", "sun", "load", "price", "price in 3 h", "mean price",
                     "expected sun")  # fmt: skip
    feature_units = ("h", "kWh", "kW", "kW", "EUR/kWh", "EUR/kWh", "EUR/kWh", "kWh")
    action_names = ACTIONS

    def __init__(self) -> None:
        high = np.array([24.0, CAPACITY, 10.0, 10.0, 2.0, 2.0, 2.0, 100.0])
        low = np.array([0.0, 0.0, 0.0, 0.0, -1.0, -1.0, -1.0, 0.0])
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin at midnight of a day with a sky, prices and habits of its own."""
        super().reset(seed=seed)
        hour, chance = np.arange(STEPS) * HOURS, self.np_random
        peaks = np.exp(-((hour - 8.0) ** 2) / 4.0) + 1.3 * np.exp(-((hour - 19.0) ** 2) / 5.0)
        level, swing = chance.uniform(0.15, 0.3), chance.uniform(0.1, 0.3)
        self._price = level + swing * (peaks - 0.45) + 0.01 * chance.standard_normal(STEPS)
        self._clear = chance.uniform(0.1, 1.0) * 5.0  # kW at noon, without clouds
        self._arc = np.maximum(np.sin(np.pi * (hour - 6.0) / 12.0), 0.0)
        clouds = np.repeat(chance.uniform(0.5, 1.0, STEPS // 4), 4)
        self._sun = self._clear * self._arc * clouds
        self._load = 0.3 + 1.2 * peaks * chance.uniform(0.5, 1.5, STEPS)
        self._charge, self._step = chance.uniform(0.0, 0.5 * CAPACITY), 0
        return self._observation(), {}

    def step(self, action: int) -> Any:
        """Move energy through the battery, and buy or sell what is missing or left."""
        wanted = (action - 1) * POWER * HOURS  # kWh into the battery, before losses
        moved = np.clip(wanted, -self._charge, (CAPACITY - self._charge) / EFFICIENCY)
        self._charge = min(self._charge + (EFFICIENCY if moved > 0 else 1.0) * moved, CAPACITY)
        bought = (self._load[self._step] - self._sun[self._step]) * HOURS + moved
        price = self._price[self._step] if bought > 0 else FEED_IN
        self._step += 1
        over = self._step >= STEPS
        reward = -bought * price - WEAR * abs(moved) + over * self._charge * self._price.mean()
        return self._observation(), float(reward), False, over, {}

    def _observation(self) -> Any:
        now, ahead = min(self._step, STEPS - 1), min(self._step + 12, STEPS - 1)
        power = (self._sun[now], self._load[now])
        prices = (self._price[now], self._price[ahead], self._price.mean())
        expected = 0.75 * self._clear * HOURS * self._arc[now:].sum()
        return np.array([self._step * HOURS, self._charge, *power, *prices, expected])


def own_use(observation: Any) -> int:
    """Store what the roof leaves over, and use it when the sun is gone: the rule of thumb."""
    _, _, sun, load, *_ = observation
    return 2 if sun > load else 0 if load > sun + 0.5 else 1


gymnasium.register("HouseBattery-v0", HouseBattery)
