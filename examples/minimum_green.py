"""A light with a minimum green: what it may not do yet is masked, as ``info["action_mask"]``.

Three arms; a phase lasts at least three steps, and from the first arm there is no way to the third.
"""

from typing import Any

import gymnasium
import numpy as np

STEPS, GREEN = 40, 3
ARRIVALS = (0.5, 0.3, 0.1)  # chance of a car in a step
SPACES = gymnasium.spaces


class MinimumGreen(gymnasium.Env[Any, Any]):
    """A light with masks.

    Observation: whose green it is, for how many steps, and the queues. Action: whose green is next.
    Reward: minus the cars that stand. What the mask forbids changes nothing; with ``masked=False``
    nobody is told.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("for", "phase", "north", "east", "south")
    feature_kinds = {"phase": ("north", "east", "south")}  # noqa: RUF012 - as above
    action_names = ("north", "east", "south")

    def __init__(self, masked: bool = True) -> None:
        self._masked = masked
        self.action_space = SPACES.Discrete(3)
        self.observation_space = SPACES.Dict(
            {
                "for": SPACES.Box(0, 9, (1,), np.int64),
                "phase": SPACES.Discrete(3),
                "queues": SPACES.Box(0, 20, (3,), np.int64),
            }
        )

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin with few cars and a green for the north that has just begun."""
        super().reset(seed=seed)
        self._phase = self._green = self._step = 0
        self._queues = self.np_random.integers(0, 6, 3)
        return self._seen()

    def step(self, action: int) -> Any:
        """Let two cars of the green arm go."""
        action = int(action) if self._mask()[action] else self._phase
        self._green = min(self._green + 1, 9) if action == self._phase else 0
        self._phase = action
        self._queues = self._queues + (self.np_random.random(3) < ARRIVALS)
        self._queues[self._phase] -= min(self._queues[self._phase], 2)
        self._queues = np.minimum(self._queues, 20)
        self._step += 1
        observation, info = self._seen()
        return observation, -float(self._queues.sum()), False, self._step >= STEPS, info

    def _mask(self) -> Any:
        is_own = np.arange(3) == self._phase
        if self._green < GREEN:
            return is_own.astype(np.int8)
        return np.array([1, 1, self._phase != 0], dtype=np.int8)

    def _seen(self) -> Any:
        phase, green = np.int64(self._phase), np.array([self._green])
        seen = {"for": green, "phase": phase, "queues": self._queues.copy()}
        return seen, {"action_mask": self._mask()} if self._masked else {}


def longest_queue(observation: Any) -> int:
    """Serve the longest queue: the rule of thumb, which knows of no mask."""
    return int(np.argmax(observation["queues"]))


gymnasium.register("MinimumGreen-v0", MinimumGreen)
