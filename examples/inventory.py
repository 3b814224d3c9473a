"""A shop's stock: what is ordered tonight arrives the morning after next.

Who wants an item that is not there buys elsewhere. Money is made where an item is *sold*, and each
order has a fee, so that neither hoarding nor dumping pays as the last day comes.
"""

from typing import Any

import gymnasium
import numpy as np

DAYS = 56
ORDERS = tuple(range(0, 70, 10))  # items
MARGIN, HOLDING, FEE = 1.0, 0.05, 4.0  # an item sold, an item kept for a night, an order
SHELF = 200  # items; what does not fit is sent back
WANTED = (14, 14, 14, 18, 24, 40, 10)  # items a day in an average season, from Monday on
UP_TO = 60  # items in stock and under way: the rule of thumb


class Inventory(gymnasium.Env[Any, Any]):
    """A shop with one article, each step a night.

    Observation: items in stock, items that arrive tomorrow, items wanted today, and tomorrow's day
    of the week (Monday is 0). Action: items to order. An episode is truncated after eight weeks.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("stock", "arriving", "wanted", "tomorrow")
    feature_units = ("items", "items", "items", "")
    action_names = tuple(f"order {items}" for items in ORDERS)
    return_range = (-DAYS * (HOLDING * SHELF + FEE), DAYS * MARGIN * SHELF)

    def __init__(self) -> None:
        high = np.array([SHELF, ORDERS[-1], 500.0, 6.0])
        self.observation_space = gymnasium.spaces.Box(np.zeros(4), high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Discrete(len(ORDERS))

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin on any day of the week and in any season, with nothing under way."""
        super().reset(seed=seed)
        self._season = self.np_random.uniform(0.7, 1.3)
        self._day = int(self.np_random.integers(7))
        self._end = self._day + DAYS
        self._stock, self._arriving = int(self.np_random.integers(60)), 0
        self._wanted = self._demand()
        return self._observation(), {}

    def step(self, action: int) -> Any:
        """Place the order, wait for the morning, and sell for a day."""
        self._stock = min(self._stock + self._arriving, SHELF)
        self._arriving = ORDERS[action]
        self._wanted = self._demand()
        sold = min(self._wanted, self._stock)
        self._stock -= sold
        self._day += 1
        reward = MARGIN * sold - HOLDING * self._stock - FEE * (action > 0)
        return self._observation(), reward, False, self._day >= self._end, {}

    def _demand(self) -> int:
        return min(int(self.np_random.poisson(self._season * WANTED[self._day % 7])), 500)

    def _observation(self) -> Any:
        return np.array([self._stock, self._arriving, self._wanted, self._day % 7], dtype=float)


def order_up_to(observation: Any) -> int:
    """Return the order that fills up to the same level every night: the rule of thumb."""
    missing = UP_TO - observation[0] - observation[1]
    return int(np.clip(round(missing / 10.0), 0, len(ORDERS) - 1))


gymnasium.register("Inventory-v0", Inventory)
