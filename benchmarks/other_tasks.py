"""Measure other people's tasks: the default learner and distillation beside each other.

Run: python benchmarks/other_tasks.py TASK [TASK ...] [--seeds 10] [--first 0] [--only NAME]
     [--out docs/results]

For each seed 15 demonstrations of a mediocre scripted controller are recorded. From the same ones
start `learn` with racing, and `distill` by cloning and DAgger with C4.5 and CART; the script is
the teacher. All have the same budget of environment steps, in which everything is
counted: demonstrations, gathering, validation, races. The last tree is evaluated on 200 fresh
episodes. The script has no action values, so VIPER's weights are equal: its rows would be DAgger's.
"""

import argparse
import csv
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.distillation import DistillationSettings
from eutree.envs.experts import EXPERTS
from eutree.evaluation import mean_interval

FINAL_EPISODES = 200
DEMONSTRATIONS = 15
ITERATIONS = 8  # of DAgger


@dataclass(frozen=True)
class Task:
    """A task: its environment, who demonstrates, and what is to be reached.

    ``episodes`` is how many episodes are learned before racing; ``spent`` how many of the
    steps allowed are spent at most, so that a run takes minutes.
    """

    env: str
    expert: str
    target: float
    leaves: int
    steps: int
    episodes: int
    spent: int


TASKS = {
    "CartPole": Task("CartPole-v1", "fall", 499.0, 4, 50_000, 30, 50_000),
    "MountainCar": Task("MountainCar-v0", "push", -103.0, 6, 100_000, 200, 100_000),
    "Acrobot": Task("Acrobot-v1", "both", -80.0, 8, 100_000, 60, 100_000),
    "LunarLander": Task("LunarLander-v3", "brake", 150.0, 34, 1_000_000, 20, 400_000),
}

Found = dict[str, tuple[eutree.TreePolicy, int]]  # and the steps, demonstrations included


def learned(task: Task, env: Any, demonstrations: eutree.Demonstrations, seed: int) -> Found:
    """Learn; and again, with a race to at most so many leaves for the steps that are left."""
    options: dict[str, Any] = {
        "demonstrations": demonstrations,
        "episodes": task.episodes,
        "seed": seed,
        "evaluate_every": max(task.episodes, 1),
        "evaluation_episodes": 1,
    }
    result = eutree.learn(env, **options)
    # The two frozen evaluations, of one episode each, decide nothing and are not counted.
    steps = demonstrations.n_transitions + result.steps
    plain, _ = eutree.compress(result.policy, result.history.observations)
    left = max(task.spent - steps, 1)
    raced = eutree.learn(env, race_steps=left, max_leaves=task.leaves, **options)
    return {
        "learned": (plain, steps),
        "learned, raced": (raced.policy, raced.environment_steps.total),
    }


def distilled(
    task: Task,
    env: Any,
    demonstrations: eutree.Demonstrations,
    seed: int,
    *,
    method: str,
    learner: str,
) -> Found:
    """Distil, with twice as many episodes of validation as of gathering."""
    length = demonstrations.n_transitions / len(demonstrations)
    episodes = max(int(task.spent / length / ITERATIONS / 3), 1)
    tree, report = eutree.distill(
        EXPERTS[task.env][task.expert],
        env,
        DistillationSettings(
            method=method,
            learner=learner,
            max_leaves=task.leaves,
            iterations=ITERATIONS,
            episodes=min(episodes, 100),
            validation_episodes=min(2 * episodes, 200),
        ),
        demonstrations=demonstrations,
        seed=seed,
    )
    return {f"{method}, {learner}": (tree, report.environment_steps)}


WAYS: dict[str, Any] = {"learned": learned} | {
    f"{method}, {learner}": (
        lambda *arguments, method=method, learner=learner: distilled(
            *arguments, method=method, learner=learner
        )
    )
    for method in ("cloning", "dagger")
    for learner in ("c4.5", "cart")
}


def run(task: Task, way: str, seed: int) -> list[dict[str, Any]]:
    """Return the rows of one way and seed."""
    env = gymnasium.make(task.env)
    demonstrations = eutree.record(
        env, EXPERTS[task.env][task.expert], episodes=DEMONSTRATIONS, seed=seed
    )
    shown = np.mean([episode.undiscounted_return for episode in demonstrations])
    begin = time.thread_time()
    found = WAYS[way](task, env, demonstrations, seed)
    seconds = time.thread_time() - begin
    rows = []
    for name, (policy, steps) in found.items():
        end = eutree.evaluate(policy, env, episodes=FINAL_EPISODES, seed=1_000_000 + seed)
        rows.append(
            {
                "way": name,
                "seed": seed,
                "shown": round(float(shown), 2),
                "return": round(end.mean_return, 2),
                "leaves": policy.n_leaves,
                "steps": steps,
                "seconds": round(seconds, 1),
            }
        )
    return rows


def report(name: str, task: Task, rows: list[dict[str, Any]], command: str) -> str:
    """Return the page of one task: means with intervals, then every seed."""
    shown = np.mean([row["shown"] for row in rows])
    lines = [
        f"# {task.env}: the default learner and distillation",
        "",
        f"Made by `{command}`.",
        f"Target: a mean return of at least {task.target:g} with at most {task.leaves} leaves in "
        f"{task.steps:,} steps;",
        f"{task.spent:,} are spent at most. All start from the same 15 demonstrations",
        f"of the script `{task.expert}`, who earns {shown:.1f}. 200 fresh episodes each;",
        "95 % intervals over seeds. The script has no action values, so VIPER would be DAgger.",
        "",
        "| way | seeds | return | leaves | steps | seeds that reach the target |",
        "|---|---|---|---|---|---|",
    ]
    ways = list(dict.fromkeys(row["way"] for row in rows))
    for way in ways:
        mine = [row for row in rows if row["way"] == way]
        returns = np.array([row["return"] for row in mine], dtype=np.float64)
        low, high = mean_interval(returns)
        leaves, steps = (np.mean([row[key] for row in mine]) for key in ("leaves", "steps"))
        good = sum(
            row["return"] >= task.target
            and row["leaves"] <= task.leaves
            and row["steps"] <= task.steps
            for row in mine
        )
        lines.append(
            f"| {way} | {len(mine)} | {returns.mean():.1f} [{low:.1f}, {high:.1f}] | "
            f"{leaves:.1f} | {steps:,.0f} | {good} |"
        )
    lines += ["", "Return (leaves) of each seed:", ""]
    seeds = sorted({row["seed"] for row in rows})
    lines += ["| way | " + " | ".join(map(str, seeds)) + " |", "|---" * (len(seeds) + 1) + "|"]
    for way in ways:
        mine = {row["seed"]: row for row in rows if row["way"] == way}
        cells = [f"{mine[s]['return']:.1f} ({mine[s]['leaves']})" for s in seeds]
        lines.append(f"| {way} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="+", choices=list(TASKS))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", choices=list(WAYS), action="append")
    parser.add_argument("--out", type=Path, help="folder for task-TASK.md and .csv")
    options = parser.parse_args()
    for name in options.tasks:
        command = (
            f"python benchmarks/other_tasks.py {name} --first {options.first} "
            f"--seeds {options.seeds}"
        )
        rows: list[dict[str, Any]] = []
        for seed in range(options.first, options.first + options.seeds):
            for way in options.only or WAYS:
                rows += run(TASKS[name], way, seed)
                print(name, rows[-1], file=sys.stderr, flush=True)
            text = report(name, TASKS[name], rows, command)
            if options.out is not None:
                (options.out / f"task-{name}.md").write_text(text)
                with (options.out / f"task-{name}.csv").open("w", newline="") as file:
                    writer = csv.DictWriter(file, fieldnames=list(rows[0]))
                    writer.writeheader()
                    writer.writerows(rows)
        print(text)


if __name__ == "__main__":
    main()
