"""Measure the default learner with each of its world models: model trees and networks.

Run: python benchmarks/world_models.py [TASK ...] [--seeds 3] [--first 0] [--out docs/results]

For each task and seed 15 demonstrations of a mediocre script are recorded (of the gate demonstrator
in 2-Evasion and its kin), and `learn` goes on from them without a race, once for each world model,
for as many steps more as the task is given here: some 20 plannings, a fraction of the budgets of
default_learner.py and other_tasks.py. Both last trees and the expert tree are evaluated on the same
200 fresh episodes. Seeds that the table in `--out` has already are not run again.
"""

import argparse
import csv
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from examples.two_tanks import FloatSwitch

import eutree
from eutree.envs.experts import EXPERTS
from eutree.evaluation import mean_interval
from eutree.learners import DEFAULT
from eutree.policy_search.planner import WORLD_MODELS

DEMONSTRATIONS, FINAL_EPISODES = 15, 200
COLUMNS = ("task", "seed", "world_model", "start", "return", "success", "leaves", "steps",
           "seconds")  # fmt: skip
Row = dict[str, str]


@dataclass(frozen=True)
class Task:
    """A task: environment, demonstrator, steps of learning."""

    env: str
    expert: Any
    steps: int
    arguments: dict[str, Any] = field(default_factory=dict)


GATE = eutree.experts.wait_at_crossing
TASKS = {
    "2-Evasion": Task("eutree/Evasion2-v0", GATE, 3_000),
    "3-Evasion": Task("eutree/Evasion3-v0", GATE, 4_000),
    "4-Evasion": Task("eutree/Evasion-v0", GATE, 4_000, {"n_opponents": 4}),
    "CartPole": Task("CartPole-v1", EXPERTS["CartPole-v1"]["fall"], 10_000),
    "MountainCar": Task("MountainCar-v0", EXPERTS["MountainCar-v0"]["push"], 8_000),
    "Acrobot": Task("Acrobot-v1", EXPERTS["Acrobot-v1"]["both"], 6_000),
    "LunarLander": Task("LunarLander-v3", EXPERTS["LunarLander-v3"]["brake"], 12_000),
    "TwoTanks": Task("TwoTanks-v0", FloatSwitch(), 10_000),
}


def runs(name: str, seed: int) -> list[Row]:
    """Return what each world model comes to from the same demonstrations."""
    task = TASKS[name]
    env = gymnasium.make(task.env, **task.arguments)
    shown = eutree.record(env, task.expert, episodes=DEMONSTRATIONS, seed=seed)
    judged = {"episodes": FINAL_EPISODES, "seed": 1_000_000 + seed}
    start = eutree.evaluate(eutree.fit_expert_tree(shown), env, **judged)
    rows = []
    for world_model in WORLD_MODELS:
        method = replace(DEFAULT, planner=replace(DEFAULT.planner, world_model=world_model))
        begin = time.process_time()
        result = eutree.learn(
            env, demonstrations=shown, method=method, steps=task.steps, seed=seed,
            evaluation_episodes=1,
        )  # fmt: skip
        seconds = time.process_time() - begin
        end = eutree.evaluate(result.policy, env, **judged)
        rows.append(
            {
                "task": name,
                "seed": str(seed),
                "world_model": world_model,
                "start": f"{start.mean_return:.2f}",
                "return": f"{end.mean_return:.2f}",
                "success": "" if end.success_rate is None else f"{end.success_rate:.3f}",
                "leaves": str(result.policy.n_leaves),
                "steps": str(result.steps),
                "seconds": f"{seconds:.0f}",
            }
        )
        print(rows[-1], file=sys.stderr, flush=True)
    return rows


PAGE = """# Planning in model trees or in networks

Made by `{command}`.
The default learner, without a race, from 15 demonstrations, with each of its world models
(`--set world_model=neural`); both from the same demonstrations, in the same number of steps.
Means over seeds of 200 fresh episodes; *difference* is networks minus model trees, paired by seed,
with a 95 % interval; *worst* is the worst seed's return, trees first; *s* is CPU seconds.

| task | seeds | steps | expert tree | model trees | networks | difference | worst | leaves | s |
|---|---|---|---|---|---|---|---|---|---|
"""


def page(rows: Sequence[Row], command: str) -> str:
    """Return the page of all rows."""
    lines = []
    for name in TASKS:
        trees, networks = (
            [row for row in rows if row["task"] == name and row["world_model"] == one]
            for one in WORLD_MODELS
        )
        if not trees:
            continue
        one, other = (np.array([float(r["return"]) for r in of]) for of in (trees, networks))
        gap = other - one
        interval = ""
        if gap.size > 1:
            low, high = mean_interval(gap)
            interval = f" [{low:.1f}, {high:.1f}]"
        cells = (
            name,
            len(trees),
            f"{TASKS[name].steps:,}",
            f"{_mean(trees, 'start'):.1f}",
            f"{one.mean():.1f}",
            f"{other.mean():.1f}",
            f"{gap.mean():.1f}{interval}",
            f"{one.min():.1f}, {other.min():.1f}",
            f"{_mean(trees, 'leaves'):.1f}, {_mean(networks, 'leaves'):.1f}",
            f"{_mean(trees, 'seconds'):.0f}, {_mean(networks, 'seconds'):.0f}",
        )
        lines.append("| " + " | ".join(map(str, cells)) + " |\n")
    return PAGE.format(command=command) + "".join(lines)


def _mean(rows: Sequence[Row], column: str) -> float:
    return float(np.mean([float(row[column]) for row in rows]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", metavar="TASK", help=", ".join(TASKS))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    table = options.out / "world-models.csv"
    rows: list[Row] = []
    if table.exists():
        with table.open(newline="") as file:
            rows = list(csv.DictReader(file))
    command = f"python benchmarks/world_models.py --seeds {options.seeds} --first {options.first}"
    for seed in range(options.first, options.first + options.seeds):
        for name in options.tasks or TASKS:
            if any(row["task"] == name and row["seed"] == str(seed) for row in rows):
                continue
            rows += runs(name, seed)
            with table.open("w", newline="") as file:
                writer = csv.DictWriter(file, fieldnames=COLUMNS)
                writer.writeheader()
                writer.writerows(rows)
            table.with_suffix(".md").write_text(page(rows, command))
    print(page(rows, command))


if __name__ == "__main__":
    main()
