"""Measure what is learned where nobody shows anything: `eutree learn TASK --steps N`, no more.

Run: python benchmarks/from_nothing.py [TASK ...] [--seeds 10] [--first 20000] [--out FILE]
     python benchmarks/from_nothing.py --page

A run has no demonstrations and the defaults of `learn`, but that it is neither judged nor made
smaller at its end (``judge_episodes=0, front_steps=0``), so its steps are all that it takes; 200
fresh episodes say what its tree earns. A row is written as soon as it is known, and what the file
has already is not run again at the same commit. ``--page`` makes docs/results/from-nothing.md of
all rows: before, and now. Seeds from 1000 to 1999 are for tuning.
"""

import argparse
import multiprocessing
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.interaction import DecodedObservation, GriddedAction

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the examples, and what is beside

import examples.inventory
from benchmarks.table import ROOT, Cell, commit, keep, row_of, rows_of
from benchmarks.table_page import summary

assert examples.inventory  # it registers a task
ROWS = ROOT / "docs" / "results" / "from-nothing.csv"
TASKS = {
    "CartPole-v1": 10_000,
    "MountainCar-v0": 40_000,
    "Acrobot-v1": 40_000,
    "Inventory-v0": 10_000,
    "eutree/Evasion2-v0": 10_000,
    "eutree/Evasion3-v0": 20_000,
    "LunarLander-v3": 100_000,
    "FrozenLake-v1": 20_000,
    "FrozenLake8x8-v1": 50_000,
    "CliffWalking-v1": 20_000,
    "Blackjack-v1": 20_000,
    "Taxi-v4": 50_000,
    "Pendulum-v1": 20_000,
}
# The last commits at which a single action that is no good stayed, at which nothing counted, and at
# which angles were planned.
BEFORE = ("f712b558", "69af6808", "5dd23141")
TORQUES = {"torque": [-2.0, 0.0, 2.0]}
LIMITS = {"CliffWalking-v1": 200}  # steps; it names none itself
HEAD = """\
# What is learned from nothing

Nobody shows anything: `eutree learn TASK --steps N`, without the judgement and the search for
smaller trees that follow. Made by `python benchmarks/from_nothing.py` at each commit, and `--page`.
Mean return of ten runs with 95 % interval, worst run, leaves, and share of episodes that succeed
where the task has a success; 200 fresh episodes a run, seeds from 20,000 on, tuned on others. Every
run is a row of `from-nothing.csv`. [What changed](../decisions/from-nothing.md), and [from
FrozenLake on](../decisions/counted-worlds.md). CliffWalking has a limit of 200 steps, Taxi is
decoded, and the pendulum has three torques.
"""


def made(task: str) -> Any:
    """Return the environment of a task, with a time limit, and few actions; Taxi's is decoded."""
    env = gymnasium.make(task, max_episode_steps=LIMITS.get(task))
    if task.startswith("Pendulum"):
        return GriddedAction(env, TORQUES)
    return DecodedObservation(env) if task.startswith("Taxi") else env


def measured(task: str, seed: int) -> dict[str, Any]:
    """Return the row of a run."""
    begin = time.process_time()
    env = made(task)
    found = eutree.learn(
        env, steps=TASKS[task], seed=seed, judge_episodes=0, front_steps=0, evaluate_every=10**6
    )
    spent = time.process_time() - begin
    cell = Cell("nothing", task, TASKS[task], 0, seed)
    return row_of(cell, found.policy, env, found.environment_steps.total, spent)


def page() -> str:
    """Return the page of all rows that are stored: those of before, and those since."""
    rows = rows_of(ROWS)
    sides = [
        [row for row in rows if (row["commit"] in BEFORE) == is_before]
        for is_before in (True, False)
    ]
    lines = [HEAD, "| task, steps | before | now |", "|---|---|---|"]
    for task, steps in TASKS.items():
        here = [[row for row in side if row["task"] == task] for side in sides]
        cells = [summary(cell) if cell else "" for cell in here]
        lines.append(f"| {task}, {steps:,} | {' | '.join(cells)} |")
    spent = [np.mean([float(row["cpu_s"]) for row in side]) for side in sides]
    commits = [", ".join(sorted({row["commit"] for row in side})) for side in sides]
    said = [
        f"{name}: {of}, {seconds:.0f} CPU seconds a run on average."
        for name, of, seconds in zip(("Before", "Now"), commits, spent, strict=True)
    ]
    return "\n".join([*lines, "", *said]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tasks", nargs="*", default=list(TASKS))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=20_000)
    parser.add_argument("--out", type=Path, default=ROWS)
    parser.add_argument("--page", action="store_true")
    arguments = parser.parse_args()
    if arguments.page:
        ROWS.with_suffix(".md").write_text(page())
        return
    known = {(row["task"], int(row["seed"]), row["commit"]) for row in rows_of(arguments.out)}
    context = multiprocessing.get_context("spawn")
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        for task in arguments.tasks:
            if (task, seed, commit()) not in known:
                with context.Pool(1) as pool:
                    keep(pool.apply(measured, (task, seed)), arguments.out)


if __name__ == "__main__":
    main()
