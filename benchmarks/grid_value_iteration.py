"""What a fine grid over the observed state reaches in 2-Evasion, at each opponent speed.

``--environment`` chooses another 2-Evasion, such as that of the `paper` preset.

The grid knows nothing of demonstrations: a million steps are played at random, the model that they
give is solved exactly, and the policy decides by the cell that the observation falls in. Like the
learners it does not see the opponents' directions. It is a bar for them and not a bound: within a
cell, and over the hidden directions of random play, it averages.

Run: python benchmarks/grid_value_iteration.py [--csv docs/results/grid-value-iteration.csv]
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from eutree import evaluate
from eutree.envs import _dynamics as dynamics
from eutree.envs._dynamics import EvasionParameters
from eutree.envs.vector import EvasionVectorEnv
from eutree.evaluation import Evaluation
from eutree.mdp import TabularMDP, TransitionCounts
from eutree.mdp.solver import NO_ACTION, TERMINAL
from eutree_lab.paper.experiment import FULL

ENVIRONMENT = "eutree/Evasion2-v0"
CELLS = (30, 22, 22)  # 1 m of the main path and of each opponent's path
TRANSITIONS = 1_000_000
COPIES = 1000  # of the environment, side by side
EPISODES = 1000
COLUMNS = ("speed", "success", "return", "standard_error", "episodes", "transitions", "seed")


@dataclass(frozen=True)
class Grid:
    """Cells of equal size over the observations."""

    low: NDArray[np.float64]  # [d]
    high: NDArray[np.float64]  # [d]
    cells: Sequence[int]  # [d]

    def __call__(self, observations: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cell of each observation, [..., d] to [...]."""
        share = (observations - self.low) / (self.high - self.low)
        places = np.clip((share * self.cells).astype(np.int64), 0, np.array(self.cells) - 1)
        return np.ravel_multi_index(tuple(np.moveaxis(places, -1, 0)), tuple(self.cells))


@dataclass(frozen=True)
class GridPolicy:
    """The action of each cell."""

    grid: Grid
    actions: NDArray[np.int64]  # [S]

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[Any, Any]:  # fmt: skip
        """Return the actions of the cells that the observations fall in."""
        return self.actions[self.grid(np.asarray(observation))], state


def arguments(environment: str, speed: float) -> dict[str, Any]:
    """Return the arguments of an environment's id, at an opponent speed."""
    return {**gymnasium.spec(environment).kwargs, "opponent_speed": speed}


def sample(
    speed: float, grid: Grid, count: int, seed: int, environment: str = ENVIRONMENT
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return cells, actions, rewards and next cells of ``count`` steps of play at random."""
    env = EvasionVectorEnv(COPIES, **arguments(environment, speed))
    generator = np.random.default_rng(seed)
    before, _ = env.reset(seed=[int(s) for s in generator.integers(0, 2**31, COPIES)])
    began = np.zeros(COPIES, dtype=np.bool_)  # whose last episode is over: this step only resets
    parts: list[tuple[NDArray[Any], ...]] = []
    gathered = 0
    while gathered < count:
        actions = generator.integers(0, 2, COPIES)
        after, rewards, terminated, truncated, _ = env.step(actions)
        reached = np.where(terminated, TERMINAL, grid(after))
        played = ~began
        parts.append((grid(before)[played], actions[played], rewards[played], reached[played]))
        gathered += int(played.sum())
        before, began = after, terminated | truncated
    cells, actions, rewards, reached = (np.concatenate(p)[:count] for p in zip(*parts, strict=True))
    return cells, actions, rewards, reached


def plan(
    speed: float,
    transitions: int = TRANSITIONS,
    seed: int = 0,
    environment: str = ENVIRONMENT,
) -> GridPolicy:
    """Return the best policy of the grid's estimated model at an opponent speed."""
    parameters = EvasionParameters(**arguments(environment, speed))
    grid = Grid(*dynamics.bounds(parameters), cells=CELLS)
    rows = sample(speed, grid, transitions, seed, environment)
    model = TabularMDP(TransitionCounts.of(*rows, n_states=int(np.prod(CELLS)), n_actions=2), 1.0)
    best = model.solve().policy
    return GridPolicy(grid, np.where(best == NO_ACTION, dynamics.STOP, best).astype(np.int64))


def measure(
    speed: float,
    *,
    transitions: int = TRANSITIONS,
    episodes: int = EPISODES,
    seed: int = 0,
    environment: str = ENVIRONMENT,
) -> Evaluation:
    """Return how the grid's policy does at an opponent speed, over fresh episodes."""
    policy = plan(speed, transitions, seed, environment)
    return evaluate(
        policy,
        environment,
        episodes=episodes,
        seed=seed,
        environment_arguments={"opponent_speed": speed},
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", default=ENVIRONMENT)
    parser.add_argument("--speeds", type=float, nargs="+", default=FULL.speeds, metavar="M/S")
    parser.add_argument("--transitions", type=int, default=TRANSITIONS, help="for each speed")
    parser.add_argument("--episodes", type=int, default=EPISODES, help="of each evaluation")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--csv", type=Path, help="file to write the rows to")
    options = parser.parse_args()
    lines = [",".join(COLUMNS)]
    print("| m/s | success | mean return | standard error |")
    print("|---|---|---|---|")
    for speed in options.speeds:
        found = measure(
            speed,
            transitions=options.transitions,
            episodes=options.episodes,
            seed=options.seed,
            environment=options.environment,
        )
        success, error = found.success_rate, found.returns.std(ddof=1) / options.episodes**0.5
        print(f"| {speed:g} | {success:.1%} | {found.mean_return:.1f} | {error:.1f} |", flush=True)
        lines.append(
            f"{speed:g},{success:.4f},{found.mean_return:.3f},{error:.3f},"
            f"{options.episodes},{options.transitions},{options.seed}"
        )
    if options.csv:
        options.csv.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
