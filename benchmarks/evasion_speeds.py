"""Measure the gate rule, and going without a look, in N-Evasion at several opponent speeds.

Run: python benchmarks/evasion_speeds.py [--copies 250] [--steps 1000]
"""

import argparse
from typing import Any

import gymnasium
import numpy as np

from eutree import experts
from eutree.envs.experts import RulePolicy

SETTINGS = [(n, 3.2) for n in (1, 2, 3, 4, 6)] + [(2, speed) for speed in (2.2, 2.7, 3.7, 4.2)]


def always_go(env: Any) -> RulePolicy:
    return RulePolicy(lambda observations: np.ones(observations.shape[:-1], dtype=np.int64))


def measure(env: Any, policy: Any, steps: int) -> tuple[int, float, float, float]:
    """Return number, success rate, mean return and mean length of the episodes that ended."""
    observations, _ = env.reset(seed=0)
    totals = np.zeros(env.num_envs)
    returns, successes, taken = [], [], 0
    for _ in range(steps):
        actions, _ = policy.predict(observations)
        observations, rewards, terminated, truncated, info = env.step(actions)
        totals += rewards
        taken += int(info["_is_success"].sum())
        ended = terminated | truncated
        returns.extend(totals[ended])
        successes.extend(info["is_success"][ended])
        totals[ended] = 0.0
    return len(returns), float(np.mean(successes)), float(np.mean(returns)), taken / len(returns)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--copies", type=int, default=250)
    parser.add_argument("--steps", type=int, default=1000)
    options = parser.parse_args()
    print("| opponents | speed, m/s | policy | episodes | success | mean return | steps |")
    print("|---|---|---|---|---|---|---|")
    for count, speed in SETTINGS:
        for title, expert in (("gate", experts.wait_at_crossing), ("always go", always_go)):
            env = gymnasium.make_vec(
                "eutree/Evasion-v0",
                num_envs=options.copies,
                vectorization_mode="vector_entry_point",
                n_opponents=count,
                opponent_speed=speed,
            )
            number, success, mean, length = measure(env, expert(env), options.steps)
            print(
                f"| {count} | {speed} | {title} | {number:,} | {success:.1%} | {mean:.1f} "
                f"| {length:.1f} |"
            )


if __name__ == "__main__":
    main()
