"""Learn for very many environment steps; show time per step and memory by decade.

    python -m benchmarks.soak --preset corrected --max-transitions 20000 --steps 10000000

A table of processor
time per step, memory and leaves at 10^3, 2 * 10^3, 5 * 10^3, 10^4, ... steps.
Evaluations are left out, so the time is that of gathering, learning and expanding alone.
"""

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import gymnasium

import eutree
from eutree.learners import PRESETS
from eutree.training import Run

ENVIRONMENT = "eutree/Evasion2-v0"


def marks() -> Iterator[int]:
    """Yield 1000, 2000, 5000, 10000, ..."""
    decade = 1000
    while True:
        yield from (decade, 2 * decade, 5 * decade)
        decade *= 10


def memory() -> float:
    """Return the memory that this process has now, in MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Run the soak and print a row at each mark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--preset", default="paper", choices=PRESETS)
    parser.add_argument("--max-transitions", type=int)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    env = gymnasium.make(ENVIRONMENT)
    method = replace(PRESETS[arguments.preset], max_transitions=arguments.max_transitions)
    short = {"evaluate_every": 10**9, "evaluation_episodes": 1, "method": method}
    eutree.learn(env, episodes=40, **short)  # compile before the clock starts
    upcoming = marks()
    mark = next(upcoming)
    start, last_time, last_steps = time.process_time(), 0.0, 0

    def note(run: Run) -> None:
        nonlocal mark, last_time, last_steps
        if run.at.steps < mark:
            return
        spent = time.process_time() - start
        per_step = (spent - last_time) / max(run.at.steps - last_steps, 1)
        history = run.learner.history
        print(
            f"| {run.at.steps:,} | {run.episode:,} | {1e6 * per_step:.0f} | {spent:.0f} "
            f"| {memory():.0f} | {history.size:,} | {history.columns.nbytes / history.size:.0f} "
            f"| {run.policy().n_leaves} |",
            flush=True,
        )
        last_time, last_steps = spent, run.at.steps
        mark = next(upcoming)

    steps_left = arguments.steps
    print("| steps | episodes | us a step since | s | MB | stored | B a row | leaves |")
    print("|---|---|---|---|---|---|---|---|")
    result = eutree.learn(
        env,
        episodes=10**9,
        seed=arguments.seed,
        stop=lambda: mark > steps_left,
        on_progress=note,
        **short,
    )
    print(f"{result.steps:,} steps in {result.episodes:,} episodes")


if __name__ == "__main__":
    main()
