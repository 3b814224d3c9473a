"""Measure which method a task wants: planning and distilled-dqn from the same demonstrations.

Run: python benchmarks/auto.py [TASK ...] [--steps 20000] [--seeds 3] [--out docs/results]

For each seed 15 episodes of the task's rule of thumb are recorded; from them both methods learn, at
their defaults, for the same number of further environment steps. What each has learned (without the
judgement, which would hand over the start where nothing better was found) is evaluated on 200 fresh
episodes, as is the start. A row is written as soon as it is known, so that the measurement can be
stopped and gone on with; the page is made of all rows.
"""

import argparse
import csv
import importlib
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.envs.experts import EXPERTS

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the examples

DEMONSTRATIONS, FINAL_EPISODES = 15, 200
METHODS = ("planning", "distilled-dqn")
COLUMNS = ("task", "steps", "method", "seed", "start", "return", "error", "leaves", "seconds")


@dataclass(frozen=True)
class Task:
    """A task and its rule of thumb.

    Attributes:
        env: Id of the environment.
        rule: Name of the rule in the example's module, or of the scripted expert.
        module: The example that registers the environment; "" for none.
    """

    env: str
    rule: str
    module: str = ""

    def made(self) -> tuple[Any, Any]:
        """Return the environment and its rule."""
        if not self.module:
            return gymnasium.make(self.env), EXPERTS[self.env][self.rule]
        module = importlib.import_module(f"examples.{self.module}")
        rule = getattr(module, self.rule)
        return gymnasium.make(self.env), rule() if isinstance(rule, type) else rule


TASKS = {
    "inventory": Task("Inventory-v0", "order_up_to", "inventory"),
    "motor currents": Task("MotorCurrents-v0", "towards_the_error", "motor_currents"),
    "heated room": Task("HeatedRoom-v0", "thermostat", "heated_room"),
    "Acrobot": Task("Acrobot-v1", "both"),
    "house battery": Task("HouseBattery-v0", "own_use", "house_battery"),
    "two tanks": Task("TwoTanks-v0", "FloatSwitch", "two_tanks"),
    "LunarLander": Task("LunarLander-v3", "brake"),
    "traffic light": Task("TrafficLight-v0", "longest_queue", "crossing"),
}


def measured(name: str, method: str, steps: int, seed: int) -> dict[str, Any]:
    """Return a row: what a method learns of a task."""
    env, rule = TASKS[name].made()
    shown = eutree.record(env, rule, episodes=DEMONSTRATIONS, seed=seed)
    begin = time.thread_time()
    result = eutree.learn(
        env,
        demonstrations=shown,
        method=method,
        steps=steps,
        seed=seed,
        judge_episodes=0,
        evaluate_every=10**6,
        evaluation_episodes=1,
    )
    seconds = time.thread_time() - begin
    start, end = (
        eutree.evaluate(policy, env, episodes=FINAL_EPISODES, seed=10**6 + seed)
        for policy in (result.expert, result.learned)
    )
    gain = end.returns - start.returns
    return {
        "task": name,
        "steps": steps,
        "method": method,
        "seed": seed,
        "start": round(start.mean_return, 3),
        "return": round(end.mean_return, 3),
        "error": round(float(gain.std(ddof=1)) / FINAL_EPISODES**0.5, 3),
        "leaves": result.learned.n_leaves,
        "seconds": round(seconds, 1),
    }


def known_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows measured so far."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def keep(path: Path, row: dict[str, Any]) -> None:
    """Write a row behind the others."""
    begun = path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if not begun:
            writer.writeheader()
        writer.writerow(row)


def key_of(row: dict[str, Any]) -> tuple[str, int, str, int]:
    """Return what tells a row from the others."""
    return row["task"], int(row["steps"]), row["method"], int(row["seed"])


def cell(rows: list[dict[str, Any]]) -> str:
    """Return the gain of a method over the start, seed by seed, with the leaves."""
    parts = [
        f"{float(row['return']) - float(row['start']):+.3g} ± {2 * float(row['error']):.2g} "
        f"({row['leaves']})"
        for row in sorted(rows, key=lambda row: int(row["seed"]))
    ]
    return ", ".join(parts) or "-"


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Return a line for each task and budget."""
    lines = [
        "| task | features, actions | steps | start | planning | distilled-dqn | seconds |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, task in TASKS.items():
        env, _ = task.made()
        size = f"{env.observation_space.shape[0]}, {env.action_space.n}"
        for steps in sorted({int(row["steps"]) for row in rows if row["task"] == name}):
            mine = [row for row in rows if row["task"] == name and int(row["steps"]) == steps]
            by_method = [[row for row in mine if row["method"] == method] for method in METHODS]
            start = np.mean([float(row["start"]) for row in mine])
            seconds = " / ".join(
                f"{np.mean([float(row['seconds']) for row in each]):.0f}" if each else "-"
                for each in by_method
            )
            cells = " | ".join(cell(each) for each in by_method)
            lines.append(f"| {name} | {size} | {steps:,} | {start:.4g} | {cells} | {seconds} |")
    return lines


def page(rows: list[dict[str, Any]]) -> str:
    """Return the page of all rows."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip
    today = time.strftime("%Y-%m-%d", time.gmtime())
    lines = "\n".join(table(rows))
    return f"""---
command: python benchmarks/auto.py
commit: {commit}
date: {today}
sources: benchmarks/auto.py examples
---

# Which method a task wants

Made by `python benchmarks/auto.py`, with `--steps`, `--first` and `--seeds` as the rows say, on
{today}. Both methods at their defaults, from the same 15 episodes of the task's rule of thumb; the
steps are those after them. *Start* is the return of C4.5's tree of these episodes on 200 fresh
ones. Each entry is a seed, from 1000 on: what the learned tree earns more than the start on the
same episodes, ± two standard errors, and its leaves; +0 ± 0 is the start itself. Nothing is judged:
a run with its judgement hands over the start where the entry is negative. CPU seconds of both.

{lines}

One or two seeds are an indication, no benchmark. [The default](../methods.md) follows them as far
as they go: planning where features are few; elsewhere the smaller tree until steps are many.
"""


def main() -> None:
    """Measure what is not known yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", help="by default all")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    path = options.out / "auto.csv"
    known = {key_of(row) for row in known_rows(path)}
    for seed in range(options.first, options.first + options.seeds):
        for task in options.tasks or TASKS:
            for method in METHODS:
                if (task, options.steps, method, seed) not in known:
                    keep(path, measured(task, method, options.steps, seed))
    (options.out / "auto.md").write_text(page(known_rows(path)), encoding="utf-8")


if __name__ == "__main__":
    main()
