"""A tank whose outlet valve takes any opening: five openings named, a tree, its C function.

Run: python examples/tank.py [--max-leaves 16] [--out valve.c]

Water runs into a tank at a rate that changes now and then; the valve at its foot is to keep the
level at a set point. The action space is a ``Box``: the opening from 0 to 100 %. A rule of thumb
wants an opening and takes the nearest of the five; a small tree is distilled from that.

What is printed: the return of the rule with any opening, with the five, and of the tree, on 200
episodes that it has not seen; then the tree.
"""

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.distillation import DistillationSettings
from eutree.interaction import GriddedAction

GRID = {"valve [%]": [0.0, 25.0, 50.0, 75.0, 100.0]}
STEP = 10.0  # seconds
AREA = 2.0  # square metres
VALVE = 0.02  # cubic metres a second through the open valve, per root of a metre
INFLOW = (2.0, 14.0)  # litres a second
HEIGHT = 2.0  # metres; what is above runs over
EPISODE_STEPS = 100


class Tank(gymnasium.Env[Any, Any]):
    """A tank with an inlet that nobody controls and an outlet valve.

    Observation: how far the level is above the set point (m), the level (m), the inflow (l/s).
    Action: opening of the valve, 0 to 100 %. Reward: minus ten times the distance from the set
    point, in metres. After 100 steps of 10 s an episode is truncated; it is a success if the level
    was never more than 10 cm off in its second half.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("above set point", "level", "inflow")
    feature_units = ("m", "m", "l/s")

    def __init__(self) -> None:
        low, high = np.array([-HEIGHT, 0.0, 0.0]), np.array([HEIGHT, HEIGHT, 20.0])
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Box(0.0, 100.0, (1,))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode with a level, a set point and an inflow of its own."""
        super().reset(seed=seed)
        self._level = self.np_random.uniform(0.4, 1.6)
        self._target = self.np_random.uniform(0.8, 1.2)
        self._inflow = self.np_random.uniform(*INFLOW)
        self._step, self._worst = 0, 0.0
        return self._observation(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Let water run for ten seconds."""
        opening = float(np.clip(np.asarray(action).reshape(-1)[0], 0.0, 100.0)) / 100.0
        net = self._inflow / 1000.0 - VALVE * opening * np.sqrt(self._level)
        self._level = float(np.clip(self._level + net * STEP / AREA, 0.0, HEIGHT))
        if self.np_random.random() < 0.04:
            self._inflow = self.np_random.uniform(*INFLOW)
        self._step += 1
        off = abs(self._level - self._target)
        if self._step > EPISODE_STEPS // 2:
            self._worst = max(self._worst, off)
        truncated = self._step >= EPISODE_STEPS
        info = {"is_success": self._worst <= 0.1} if truncated else {}
        return self._observation(), -10.0 * off, False, truncated, info

    def _observation(self) -> Any:
        return np.array([self._level - self._target, self._level, self._inflow])


def opening_for(observation: Any) -> Any:
    """Return the opening that a rule of thumb wants [%]: what runs in, and a little more above."""
    above, level, inflow = np.moveaxis(np.asarray(observation), -1, 0)
    balance = inflow / 1000.0 / (VALVE * np.sqrt(np.maximum(level, 0.05)))
    return np.clip(100.0 * (balance + 3.0 * above), 0.0, 100.0)


class RuleOfThumb:
    """Chooses the nearest opening of a grid."""

    reads_features = True

    def __init__(self, env: Any) -> None:
        (control,) = env.get_wrapper_attr("controls")
        self._levels = np.array(control.levels)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:  # fmt: skip
        """Return the number of the opening, or those of a batch."""
        wanted = opening_for(observation)[..., np.newaxis]
        return np.abs(self._levels - wanted).argmin(axis=-1), state


gymnasium.register("ValveTank-v0", Tank, max_episode_steps=EPISODE_STEPS)


def with_any_opening(episodes: int, seed: int) -> float:
    """Return the mean return of the rule where it may open the valve as it likes."""
    env, returns = Tank(), []
    for number in range(episodes):
        observation, _ = env.reset(seed=eutree.interaction.episode_seed(seed, number))
        total, truncated = 0.0, False
        while not truncated:
            observation, reward, _, truncated, _ = env.step(opening_for(observation))
            total += reward
        returns.append(total)
    return float(np.mean(returns))


def main() -> None:
    """Distil, compare, export."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--max-leaves", type=int, default=16)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    env = GriddedAction(gymnasium.make("ValveTank-v0"), GRID)
    rule = RuleOfThumb(env)
    settings = DistillationSettings(max_leaves=arguments.max_leaves)
    small, _ = eutree.distill(rule, env, settings, seed=0)
    print(f"rule, any opening: mean return {with_any_opening(200, 1):.2f}")
    print(f"rule, five openings: {eutree.evaluate(rule, env, episodes=200, seed=1)}")
    print(f"tree: {eutree.evaluate(small, env, episodes=200, seed=1)}")
    print(small)
    if arguments.out is not None:
        arguments.out.write_text(eutree.export.to_c(small, name="decide"))


if __name__ == "__main__":
    main()
