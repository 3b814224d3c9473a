"""Measure the method distilled-dqn: small trees from mediocre demonstrations, every step counted.

Run: python benchmarks/small_trees.py TASK [TASK ...] [--seeds 10] [--first 0] [--steps N]
     [--max-leaves L] [--out docs/results]

For each seed 15 demonstrations of a mediocre scripted controller are recorded, and `learn` goes on
from them with what is left of the steps: the teacher's, DAgger's and the races' steps all count,
demonstrations too. The last tree is evaluated on 200 fresh episodes, and beside it its start,
C4.5's tree of the demonstrations.
Seeds from 1000 on are for tuning; reported are seeds below.
"""

import argparse
import csv
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from examples.two_tanks import FloatSwitch, method_for

import eutree
from eutree.envs.experts import EXPERTS
from eutree.evaluation import mean_interval
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.policies import TreePolicy

FINAL_EPISODES = 200
DEMONSTRATIONS = 15


@dataclass(frozen=True)
class Task:
    """A task: environment, demonstrator, most leaves, most steps, the return to reach."""

    env: str
    expert: Any
    leaves: int
    steps: int
    target: float | None
    method: Callable[[int], DistilledDQN] = lambda leaves: DistilledDQN(max_leaves=leaves)


TASKS = {
    "LunarLander": Task("LunarLander-v3", EXPERTS["LunarLander-v3"]["brake"], 34, 500_000, 165.0),
    "Acrobot": Task("Acrobot-v1", EXPERTS["Acrobot-v1"]["both"], 8, 100_000, -81.0),
    "CartPole": Task("CartPole-v1", EXPERTS["CartPole-v1"]["fall"], 4, 50_000, 499.5),
    "MountainCar": Task("MountainCar-v0", EXPERTS["MountainCar-v0"]["push"], 6, 100_000, -99.1),
    "TwoTanks": Task("TwoTanks-v0", FloatSwitch(), 20, 100_000, None, method_for),
}


def run(task: Task, seed: int) -> dict[str, Any]:
    """Return the row of one seed."""
    env = gymnasium.make(task.env)
    shown = eutree.record(env, task.expert, episodes=DEMONSTRATIONS, seed=seed)
    expert = eutree.fit_expert_tree(shown)
    begin = time.process_time()
    result = eutree.learn(
        env,
        demonstrations=shown,
        expert=expert,
        method=task.method(task.leaves),
        steps=task.steps - shown.n_transitions,
        seed=seed,
        evaluate_every=10**6,
        evaluation_episodes=1,  # two evaluations of one episode, which decide nothing
    )
    seconds = time.process_time() - begin
    found = {
        "return": evaluated(result.policy, env, seed),
        "start": evaluated(expert, env, seed),
    }
    return {
        "seed": seed,
        "shown": round(float(np.mean([e.undiscounted_return for e in shown])), 2),
        **{name: round(one.mean_return, 2) for name, one in found.items()},
        "error": round(float(np.std(found["return"].returns) / FINAL_EPISODES**0.5), 2),
        "leaves": result.policy.n_leaves,
        "steps": shown.n_transitions + result.steps,
        "seconds": round(seconds),
    }


def evaluated(policy: TreePolicy, env: Any, seed: int) -> Any:
    """Evaluate on fresh episodes."""
    return eutree.evaluate(policy, env, episodes=FINAL_EPISODES, seed=1_000_000 + seed)


def report(name: str, task: Task, rows: list[dict[str, Any]], command: str) -> str:
    """Return the page of one task."""
    returns = np.array([row["return"] for row in rows])
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    interval = "one seed: no interval over seeds"
    if len(rows) > 1:
        low, high = mean_interval(returns)
        interval = f"95 % over seeds [{low:.1f}, {high:.1f}]"
    target = "clearly better than its start" if task.target is None else f"{task.target:g}"
    lines = [
        "---",
        f"command: {command}",
        f"commit: {commit}",
        f"date: {time.strftime('%Y-%m-%d')}",
        "sources: benchmarks/small_trees.py src/eutree/learners/distilled_dqn.py "
        "src/eutree/neural src/eutree/world_model src/eutree/policy_search src/eutree/cart",
        "---",
        "",
        f"# {task.env}: a small tree from a counted teacher",
        "",
        f"Made by `{command}`.",
        f"At most {task.leaves} leaves and {task.steps:,} environment steps, all counted; "
        f"target: {target}.",
        f"Mean of {len(rows)} seed{'s' if len(rows) > 1 else ''}: {returns.mean():.1f}, {interval};"
        f" worst seed {returns.min():.1f}.",
        "",
        "| seed | demonstrations | C4.5's tree of them | learned | s.e. of 200 episodes | leaves "
        "| steps | CPU s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['seed']} | {row['shown']:.1f} | {row['start']:.1f} | {row['return']:.1f} | "
        f"{row['error']:.1f} | {row['leaves']} | {row['steps']:,} | {row['seconds']} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="+", choices=list(TASKS))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--steps", type=int, help="in place of the task's")
    parser.add_argument("--max-leaves", type=int, help="in place of the task's")
    parser.add_argument("--out", type=Path, help="folder for small-trees-TASK.md and .csv")
    options = parser.parse_args()
    for name in options.tasks:
        task = TASKS[name]
        task = replace(
            task, steps=options.steps or task.steps, leaves=options.max_leaves or task.leaves
        )
        command = " ".join(["python benchmarks/small_trees.py", *sys.argv[1:]])
        rows: list[dict[str, Any]] = []
        for seed in range(options.first, options.first + options.seeds):
            rows.append(run(task, seed))
            print(name, rows[-1], file=sys.stderr, flush=True)
            if options.out is not None:
                text = report(name, task, rows, command)
                (options.out / f"small-trees-{name}.md").write_text(text)
                with (options.out / f"small-trees-{name}.csv").open("w", newline="") as file:
                    writer = csv.DictWriter(file, fieldnames=list(rows[0]))
                    writer.writeheader()
                    writer.writerows(rows)
        print(report(name, task, rows, command))


if __name__ == "__main__":
    main()
