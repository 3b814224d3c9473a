"""Numbers that settle where the action says: an environment for tests, and its plant."""

from typing import Any, ClassVar

import gymnasium
import numpy as np

from eutree.proof import Plant
from eutree.schema import EnvironmentSpec


class Settling(gymnasium.Env[Any, Any]):
    """Numbers with these names, each nine tenths of what it was, and a push times the action."""

    metadata: ClassVar = {"render_modes": []}

    def __init__(self, names: tuple[str, ...], push: float, n_actions: int) -> None:
        self.feature_names, self.push = names, push
        self.action_space = gymnasium.spaces.Discrete(n_actions)
        self.observation_space = gymnasium.spaces.Box(-100.0, 100.0, (len(names),), np.float64)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = self.np_random.uniform(-1.0, 1.0, len(self.feature_names))
        return self.state.copy(), {}

    def step(self, action: int) -> Any:
        self.state = 0.9 * self.state + self.push * action
        return self.state.copy(), 0.0, False, False, {}


class SettlingPlant(Plant):
    """The same on intervals, of an environment that is registered with this name."""

    push: float

    def __init__(self, name: str) -> None:
        self.environment = EnvironmentSpec(name)

    def step(self, state: Any, action: Any) -> Any:
        return [0.9 * one + self.push * action for one in state]
