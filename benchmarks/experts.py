"""Measure the scripted experts: mean return and success of each, over seeded episodes.

Run: python benchmarks/experts.py [--episodes 200] [--env eutree/Evasion2-v0]
"""

import argparse
from typing import Any

import gymnasium
import numpy as np

import eutree  # noqa: F401 - registers the environments
from eutree.envs.experts import Expert, all_experts, careless, late


def episode(env: Any, policy: Any, seed: int) -> tuple[float, float, int]:
    """Return the return, the success (nan where unknown) and the length of one episode."""
    observation, _ = env.reset(seed=seed)
    total, steps, state, is_first = 0.0, 0, None, True
    while True:
        action, state = policy.predict(observation, state, np.array(is_first))
        observation, reward, terminated, truncated, info = env.step(int(action))
        total, steps, is_first = total + float(reward), steps + 1, False
        if terminated or truncated:
            return total, float(info.get("is_success", np.nan)), steps


def measure(name: str, expert: Expert, episodes: int) -> np.ndarray:
    """Return one row of (return, success, length) for each episode."""
    env = gymnasium.make(name)
    policy = expert(env)
    rows = np.array([episode(env, policy, seed) for seed in range(episodes)])
    env.close()
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--env", choices=[*all_experts()], help="only this environment")
    options = parser.parse_args()
    print("| environment | expert | mean return | standard deviation | success | mean length |")
    print("|---|---|---|---|---|---|")
    for name, experts in all_experts().items():
        if options.env not in (None, name) or (options.env is None and name.endswith("Evasion-v0")):
            continue
        if "Evasion" in name:
            gate = experts["gate"]
            experts = {
                **experts,
                "gate, careless 0.1": careless(gate, 0.1),
                "gate, 1 late": late(gate, 1),
            }
        for title, expert in experts.items():
            rows = measure(name, expert, options.episodes)
            success = "" if np.isnan(rows[0, 1]) else f"{rows[:, 1].mean():.1%}"
            mean, spread, length = rows[:, 0].mean(), rows[:, 0].std(), rows[:, 2].mean()
            print(f"| {name} | {title} | {mean:.1f} | {spread:.1f} | {success} | {length:.1f} |")


if __name__ == "__main__":
    main()
