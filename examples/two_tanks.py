"""Two tanks in series: a float switch demonstrates, a small tree learns to do better.

Run: python examples/two_tanks.py [--steps 100000] [--max-leaves 20] [--seed 0] [--out FILE]

A pump fills the upper tank; a valve lets water run from there into the lower one, from which an
unknown, changing demand is drawn. The lower tank's level is to follow a set point. Both actuators
lag. Plants of this kind are run by float switches: they know two levels, not what is coming.

What is printed: the switch's return, that of C4.5's tree of fifteen of its episodes, and that of
the tree learned in so many steps, on 200 episodes that neither has seen.
"""

import argparse
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.proof import Plant, register_plant
from eutree.schema import EnvironmentSpec
from eutree.world_model.ensemble import EnsembleSettings

EPISODE_STEPS = 200
STEP = 5.0  # seconds
AREA = (1.0, 1.0)  # square metres
HEIGHT = 2.0  # metres; what is above runs over
PUMP = 0.012  # cubic metres a second at full speed
VALVE = 0.010  # cubic metres a second through the open valve, per root of a metre
LAG = 0.35  # share of the way an actuator moves in one step
DEMAND = (0.002, 0.008)  # cubic metres a second
ACTIONS = ("pump off, valve shut", "pump off, valve open", "pump on, valve shut",
           "pump on, valve open")  # fmt: skip


class TwoTanks(gymnasium.Env[Any, Any]):
    """Two tanks in series.

    Observation: level of the upper and of the lower tank (m), speed of the pump and opening of the
    valve (0 to 1), set point of the lower tank (m), and how fast both levels and the lower tank's
    deviation have changed of late (mm/s, and m averaged over ten steps).

    Reward: minus ten times the deviation from the set point, minus 0.2 for the running pump, minus
    5 for each step in which a tank runs over. After 200 steps an episode is truncated.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("upper level", "lower level", "pump", "valve", "set point", "upper change",
                     "lower change", "deviation")  # fmt: skip
    feature_units = ("m", "m", "", "", "m", "mm/s", "mm/s", "m")
    action_names = ACTIONS

    def __init__(self) -> None:
        low = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -20.0, -20.0, -HEIGHT])
        high = np.array([HEIGHT, HEIGHT, 1.0, 1.0, HEIGHT, 20.0, 20.0, HEIGHT])
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))
        self._levels = np.zeros(2)
        self._rates = np.zeros(2)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode with levels, a set point and a demand of its own."""
        super().reset(seed=seed)
        self._levels = self.np_random.uniform([0.6, 0.4], [1.4, 1.2])
        self._rates = np.zeros(2)
        self._pump = self._valve = 0.0
        self._target = self.np_random.uniform(0.6, 1.4)
        self._demand = self.np_random.uniform(*DEMAND)
        self._deviation = 0.0
        self._step = 0
        return self._observation(), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Set pump and valve, and let five seconds pass."""
        on, opened = divmod(int(action), 2)
        self._pump += LAG * (on - self._pump)
        self._valve += LAG * (opened - self._valve)
        self._demand += 0.0006 * self.np_random.standard_normal()
        self._demand = float(np.clip(self._demand, *DEMAND))
        if self.np_random.random() < 0.01:  # the set point changes twice in an episode, about
            self._target = self.np_random.uniform(0.6, 1.4)
        before = self._levels.copy()
        between = VALVE * self._valve * np.sqrt(max(self._levels[0], 0.0))
        taken = min(self._demand, AREA[1] * self._levels[1] / STEP)
        self._levels[0] += STEP * (PUMP * self._pump - between) / AREA[0]
        self._levels[1] += STEP * (between - taken) / AREA[1]
        spilt = self._levels > HEIGHT
        self._levels = np.clip(self._levels, 0.0, HEIGHT)
        self._rates = 1000.0 * (self._levels - before) / STEP
        error = self._levels[1] - self._target
        self._deviation += 0.1 * (error - self._deviation)
        self._step += 1
        reward = -10.0 * abs(error) - 0.2 * on - 5.0 * int(spilt.sum())
        return self._observation(), float(reward), False, self._step >= EPISODE_STEPS, {}

    def _observation(self) -> Any:
        return np.array(
            [*self._levels, self._pump, self._valve, self._target, *self._rates, self._deviation]
        )


class FloatSwitch:
    """Keeps the upper tank between two floats and opens the valve below the set point.

    Attributes:
        reads_features: It gets the vector of the environment's features.
    """

    reads_features = True

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation, or those of a batch."""
        of = np.asarray(observation, dtype=np.float64)
        filling = of[..., 2] > 0.5  # the pump goes on until the upper float is reached
        pump = np.where(filling, of[..., 0] < 0.8, of[..., 0] < 0.2)
        valve = of[..., 1] < of[..., 4]
        return (2 * pump + valve).astype(np.int64), state


def plant(spec: EnvironmentSpec) -> Plant:
    """Return the tanks as ``eutree prove`` follows them; ``two_tanks_plant`` lies beside."""
    own = import_module(f"{__package__}.two_tanks_plant" if __package__ else "two_tanks_plant")
    return own.TwoTanks(spec)


gymnasium.register("TwoTanks-v0", TwoTanks)
register_plant("TwoTanks-v0", plant)


def method_for(max_leaves: int) -> DistilledDQN:
    """Return the choices for this task: the pump's lag shows in what happened before."""
    return DistilledDQN(max_leaves=max_leaves, world_model=EnsembleSettings(memory=True))


def main() -> None:
    """Record, fit, learn and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--max-leaves", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="policy file to write")
    options = parser.parse_args()
    env = gymnasium.make("TwoTanks-v0")
    shown = eutree.record(env, FloatSwitch(), episodes=15, seed=options.seed)
    expert = eutree.fit_expert_tree(shown)
    result = eutree.learn(
        env,
        demonstrations=shown,
        expert=expert,
        method=method_for(options.max_leaves),
        steps=options.steps - shown.n_transitions,
        seed=options.seed,
        evaluate_every=10**6,
        evaluation_episodes=1,
    )
    for name, policy in (
        ("float switch", FloatSwitch()),
        ("its tree", expert),
        ("learned tree", result.policy),
    ):
        found = eutree.evaluate(policy, env, episodes=200, seed=10**6 + options.seed)
        low, high = found.return_interval
        leaves = f", {policy.n_leaves} leaves" if isinstance(policy, eutree.TreePolicy) else ""
        print(f"{name}: {found.mean_return:.1f} [{low:.1f}, {high:.1f}]{leaves}")
    if options.out is not None:
        result.policy.save(options.out)


if __name__ == "__main__":
    main()
