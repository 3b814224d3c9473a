"""Compare the steps per second of the vector environment with those of the single one.

Run: python benchmarks/vector_env.py [--copies 256] [--rounds 7]

Both run unwrapped, resets included, with actions that are ``go`` with a given probability. They
take turns, and the median of the ratios of each turn counts, in CPU time of this thread.
Gymnasium's own SyncVectorEnv is there to compare. Short episodes are the hard case: drawing an
episode's noise costs as much in the vector environment as in the single one.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import eutree  # noqa: F401 - registers the environments

SINGLE_STEPS, VECTOR_STEPS, SYNC_STEPS = 4_000, 400, 10


def some_actions(share: float, *shape: int) -> np.ndarray:
    return (np.random.default_rng(0).random(shape) < share).astype(np.int64)


def single_steps(name: str, share: float) -> Callable[[], float]:
    env: Any = gymnasium.make(name).unwrapped
    env.reset(seed=0)
    actions = some_actions(share, SINGLE_STEPS).tolist()

    def steps_per_second() -> float:
        begun = time.thread_time()
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return SINGLE_STEPS / (time.thread_time() - begun)

    return steps_per_second


def vector_steps(
    name: str, share: float, copies: int, mode: str, steps: int
) -> Callable[[], float]:
    env: Any = gymnasium.make_vec(name, num_envs=copies, vectorization_mode=mode).unwrapped
    env.reset(seed=0)
    actions = some_actions(share, steps, copies)
    env.step(actions[0])  # compiles, or loads what was compiled

    def steps_per_second() -> float:
        begun = time.thread_time()
        for row in actions:
            env.step(row)
        return copies * steps / (time.thread_time() - begun)

    return steps_per_second


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--copies", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    print("| environment | go | single, steps/s | SyncVectorEnv / single | native / single |")
    print("|---|---|---|---|---|")
    for name in ("eutree/Evasion2-v0", "eutree/Evasion3-v0"):
        for share in (0.5, 1.0):
            single = single_steps(name, share)
            sync = vector_steps(name, share, options.copies, "sync", SYNC_STEPS)
            native = vector_steps(name, share, options.copies, "vector_entry_point", VECTOR_STEPS)
            rounds = [(single(), sync(), native()) for _ in range(options.rounds)]
            base = statistics.median(one for one, _, _ in rounds)
            slow = statistics.median(other / one for one, other, _ in rounds)
            fast = statistics.median(ours / one for one, _, ours in rounds)
            print(f"| {name} | {share:.0%} | {base:,.0f} | {slow:.1f} | {fast:.0f} |")


if __name__ == "__main__":
    main()
