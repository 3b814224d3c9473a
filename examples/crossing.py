"""A crossing of two roads with a light of four phases, without a simulator of traffic.

A step is five seconds, an episode half an hour. Each of the four arms has a lane that goes on and
one that turns left; a phase serves two of the eight. A change costs a step of amber.
"""

from typing import Any

import gymnasium
import numpy as np

STEPS = 360
ARMS = ("north", "south", "east", "west")
LANES = tuple(f"{arm} {way}" for arm in ARMS for way in ("on", "left"))
PHASES = ((0, 2), (1, 3), (4, 6), (5, 7))  # the lanes that each of them serves
ACTIONS = ("north-south on", "north-south left", "east-west on", "east-west left")
DISCHARGE, PLACES = 2, 40  # vehicles that leave a lane in a step, and that it has room for
BUSY = np.array([0.45, 0.12, 0.45, 0.12, 0.35, 0.15, 0.35, 0.15])  # arrivals in a step
LEAST_GREEN = 2  # steps: the rule of thumb


class TrafficLight(gymnasium.Env[Any, Any]):
    """A light and the vehicles that wait at it.

    Observation: vehicles waiting in each lane, vehicles that will be there in the next step, which
    phase is green, and for how many steps. Action: the phase that is to be green next. Reward:
    minus the vehicles waiting, divided by the steps: a return is minus the mean queue.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = (*(f"waiting {lane}" for lane in LANES), *(f"coming {lane}" for lane in LANES),
                     *(f"green {name}" for name in ACTIONS), "green for")  # fmt: skip
    action_names = ACTIONS
    return_range = (-float(PLACES * len(LANES)), 0.0)

    def __init__(self) -> None:
        high = np.array([PLACES] * 16 + [1.0] * 4 + [STEPS], dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(np.zeros(21), high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Discrete(len(PHASES))

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin with a few vehicles, on a day that is busier in some arms than in others."""
        super().reset(seed=seed)
        self._waiting = self.np_random.integers(0, 4, 8)
        self._day = BUSY * self.np_random.uniform(0.5, 1.3, 8)
        self._phase, self._green, self._step = 0, 0, 0
        self._coming = self._arrivals()
        return self._observation(), {}

    def step(self, action: int) -> Any:
        """Let five seconds of traffic pass."""
        amber = action != self._phase
        self._green = 0 if amber else self._green + 1
        self._phase = int(action)
        self._waiting = np.minimum(self._waiting + self._coming, PLACES)
        if not amber:
            served = list(PHASES[self._phase])
            self._waiting[served] = np.maximum(self._waiting[served] - DISCHARGE, 0)
        self._step += 1
        self._coming = self._arrivals()
        reward = -float(self._waiting.sum()) / STEPS
        return self._observation(), reward, False, self._step >= STEPS, {}

    def _arrivals(self) -> Any:
        rush = 0.7 + 0.6 * np.sin(np.pi * self._step / STEPS)
        return np.minimum(self.np_random.poisson(rush * self._day), PLACES)

    def _observation(self) -> Any:
        phase = np.eye(4)[self._phase]
        return np.array([*self._waiting, *self._coming, *phase, self._green])


def longest_queue(observation: Any) -> int:
    """Serve the two lanes where most wait, and no shorter than a while: the rule of thumb."""
    if observation[20] < LEAST_GREEN:
        return int(np.argmax(observation[16:20]))
    return int(np.argmax([sum(observation[lane] for lane in lanes) for lanes in PHASES]))


gymnasium.register("TrafficLight-v0", TrafficLight)
