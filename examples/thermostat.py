"""A room with a thermostat, and its plant: it stays warm for ever, whatever the weather.

Run: python examples/thermostat.py [--out FILE]
     eutree prove FILE --import examples.thermostat

The heater is on or off; outside it is between -5 and 12 degrees, anew at every step. The plant
below is the same step on intervals, thirty lines in all, and what ``check_plant`` tests.
"""

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.proof import Intervals, Plant, check_plant, prove, register_plant
from eutree.schema import EnvironmentSpec

OUTSIDE = (-5.0, 12.0)  # degrees Celsius
LOSS, HEAT = 0.02, 0.9  # share of the difference lost in a step; degrees gained


class Room(gymnasium.Env[Any, Any]):
    """One room. Observation: its temperature. Actions: heater off, on."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("temperature",)
    feature_units = ("°C",)
    action_names = ("off", "on")

    def __init__(self) -> None:
        self.observation_space = gymnasium.spaces.Box(-50.0, 80.0, (1,), np.float64)
        self.action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin between 19 and 21 degrees."""
        super().reset(seed=seed)
        self.state = self.np_random.uniform(19.0, 21.0, 1)
        return self.state.copy(), {}

    def step(self, action: int) -> Any:
        """Lose heat to the weather, and gain some from the heater."""
        outside = self.np_random.uniform(*OUTSIDE)
        self.state = self.state + (LOSS * (outside - self.state) + HEAT * action)
        reward = -float(abs(self.state[0] - 20.0))
        return self.state.copy(), reward, False, False, {}


class RoomPlant(Plant):
    """The same room on intervals."""

    state = ("temperature",)
    start = ((19.0, 21.0),)
    grid = ((15.0, 25.0, 1000),)  # only for what is to hold for ever
    question = "stays in 18.5 <= temperature <= 21.5 for ever"

    def __init__(self, spec: EnvironmentSpec) -> None:
        self.environment = spec

    def step(self, state: Any, action: Any) -> Any:
        """Lose heat to any weather there is, and gain some from the heater."""
        (temperature,) = state
        outside = Intervals.between(*(np.full(action.shape, end) for end in OUTSIDE))
        return [temperature + (LOSS * (outside - temperature) + HEAT * action)]


gymnasium.register("Room-v0", Room, max_episode_steps=200)
register_plant("Room-v0", RoomPlant)


def main() -> None:
    """Show how a thermostat is set, check the plant, prove the tree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="policy file to write")
    options = parser.parse_args()
    env = gymnasium.make("Room-v0")

    class Thermostat:
        reads_features = True

        def predict(self, observation: Any, state: Any = None, *_: Any, **__: Any) -> Any:
            return (np.asarray(observation)[..., 0] < 20.0).astype(np.int64), state

    demos = eutree.record(env, Thermostat(), episodes=5, seed=0)
    policy = eutree.fit_expert_tree(demos)
    print(policy)
    plant = RoomPlant(EnvironmentSpec("Room-v0"))
    check_plant(plant, episodes=20, generator=np.random.default_rng(0))
    print(prove(policy, plant))
    print(prove(policy, plant, "stays in 18.9 <= temperature <= 21.1 for ever"))
    if options.out is not None:
        policy.save(options.out)


if __name__ == "__main__":
    main()
