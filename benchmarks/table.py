"""Measure the table: what a small tree earns at a size after a number of counted steps.

Run: python benchmarks/table.py TASK [TASK ...] [--who eutree dagger viper network]
     [--steps 10000 50000 100000] [--leaves 4 8 16 32] [--seeds 10] [--first 20000]
     [--trees FOLDER] [--out docs/results/table]
     python benchmarks/table.py --pages

A cell is a run of its own, in a process of its own: 15 demonstrations of the task's script, then
the settings of ``src/eutree/zoo/settings/TASK.toml`` for the steps that are left (demonstrations
count). The tree has at most so many leaves, and 200 fresh episodes say what it earns.
``dagger`` and ``viper`` make trees (CART) of a DQN of Stable-Baselines3 with the settings of its
zoo, which has four fifths of the steps; all its steps count. ``network`` is that DQN with all of
them: the line above. A row is written as soon as it is known, and what a file of rows has already
is not run again. ``--trees`` keeps each tree, from which ``benchmarks/zoo.py`` takes the best.
``benchmarks/releases.py`` runs a small fixed part and compares it with earlier ones.
Seeds from 1000 to 1999 are for tuning; those of the table begin at 20,000.
"""

import argparse
import csv
import importlib
import multiprocessing
import resource
import subprocess
import textwrap
import time
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree import zoo
from eutree.distillation import DistillationSettings
from eutree.envs.experts import EXPERTS
from eutree.evaluation import mean_interval
from eutree.interaction.making import make
from eutree.learners import method as method_of
from eutree.learners.registry import with_choices
from eutree.schema import EnvironmentSpec

ROOT = Path(__file__).resolve().parents[1]
ROWS = ROOT / "docs" / "results" / "table"
STEPS, LEAVES = (10_000, 50_000, 100_000), (4, 8, 16, 32)
SEEDS, FIRST, FINAL_EPISODES = 10, 20_000, 200
ENOUGH = 0.9  # a cell whose runs used a smaller share of their steps says so
STUDENTS = ("dagger", "viper")
ROUNDS, TEACHERS = 8, 0.8  # of DAgger and VIPER; the share of the steps that their teacher takes
COLUMNS = ("who", "task", "steps", "leaves", "seed", "return", "error", "success", "worst",
           "has_leaves", "used", "cpu_s", "peak_mb", "commit")  # fmt: skip
# Of rl-baselines3-zoo's tuned DQN, as published; every number is in its hyperparams/dqn.yml.
DQN: dict[str, dict[str, Any]] = {
    "CartPole-v1": {
        "learning_rate": 2.3e-3,
        "batch_size": 64,
        "buffer_size": 100_000,
        "learning_starts": 1000,
        "gamma": 0.99,
        "target_update_interval": 10,
        "train_freq": 256,
        "gradient_steps": 128,
        "exploration_fraction": 0.16,
        "exploration_final_eps": 0.04,
    },
    "MountainCar-v0": {
        "learning_rate": 4e-3,
        "batch_size": 128,
        "buffer_size": 10_000,
        "learning_starts": 1000,
        "gamma": 0.98,
        "target_update_interval": 600,
        "train_freq": 16,
        "gradient_steps": 8,
        "exploration_fraction": 0.2,
        "exploration_final_eps": 0.07,
    },
    "Acrobot-v1": {
        "learning_rate": 6.3e-4,
        "batch_size": 128,
        "buffer_size": 50_000,
        "learning_starts": 0,
        "gamma": 0.99,
        "target_update_interval": 250,
        "train_freq": 4,
        "gradient_steps": -1,
        "exploration_fraction": 0.12,
        "exploration_final_eps": 0.1,
    },
}
DQN["LunarLander-v3"] = DQN["Acrobot-v1"]  # published with the same numbers


@dataclass(frozen=True)
class Cell:
    """One run: who learns what, for how many steps, with how many leaves at most, which seed."""

    who: str
    task: str
    steps: int
    leaves: int
    seed: int


@dataclass(frozen=True)
class Settings:
    """What the settings of a task say: its method, and how a run of it goes."""

    method: Any
    expert: Any  # who records them
    demonstrations: int
    race: float  # share of the steps that are left
    arguments: dict[str, Any]  # that the task is made with

    @classmethod
    def of(cls, task: str) -> "Settings":
        document = tomllib.loads(zoo.settings_of(task).read_text())
        run = document.pop("run")
        method = with_choices(method_of(document.pop("method")), document)
        script = script_of(task, run["expert"])
        shown, share = run["demonstrations"], run["race_share"]
        return cls(method, script, shown, share, run.get("arguments", {}))


def script_of(task: str, name: str) -> Any:
    """Return who demonstrates: one of the package's, or MODULE:NAME, which registers the task."""
    module, _, own = name.rpartition(":")
    found = getattr(importlib.import_module(module), own) if module else EXPERTS[task][name]
    return found() if isinstance(found, type) else found


def learned(cell: Cell, env: Any, settings: Settings) -> tuple[eutree.TreePolicy, int]:
    """Return the tree of a run with the task's settings, and all steps that it took."""
    episodes = settings.demonstrations
    shown = eutree.record(env, settings.expert, episodes=episodes, seed=cell.seed)
    left = cell.steps - shown.n_transitions
    if left <= 0:
        raise SystemExit(f"{cell}: the demonstrations alone take {shown.n_transitions} steps")
    result = eutree.learn(
        env, demonstrations=shown, method=settings.method, steps=left,
        race_steps=int(settings.race * left), max_leaves=cell.leaves, judge_episodes=0,
        evaluate_every=10**6, evaluation_episodes=1, seed=cell.seed,
    )  # fmt: skip
    return result.policy, result.environment_steps.total


@cache
def network(task: str, steps: int, seed: int) -> tuple[Any, float]:
    """Return a DQN of Stable-Baselines3 that learned for so many steps, and its CPU seconds."""
    import stable_baselines3
    import torch

    begin = time.process_time()
    torch.set_num_threads(1)
    model = stable_baselines3.DQN(
        "MlpPolicy",
        gymnasium.make(task),
        policy_kwargs={"net_arch": [256, 256]},
        seed=seed,
        device="cpu",
        **DQN[task],
    )
    return model.learn(steps), time.process_time() - begin


def distilled(cell: Cell, env: Any) -> tuple[eutree.TreePolicy, int]:
    """Return the best tree that DAgger or VIPER makes of a network; all steps are counted."""
    steps = int(TEACHERS * cell.steps)
    model, _ = network(cell.task, steps, cell.seed)

    def action_values(observations: np.ndarray) -> np.ndarray:
        tensor, _ = model.policy.obs_to_tensor(observations.astype(np.float32))
        return model.q_net(tensor).detach().numpy()

    left, longest = cell.steps - steps, gymnasium.spec(cell.task).max_episode_steps or 1000
    rounds = min(ROUNDS, left // (3 * longest))  # an episode to learn from, two to judge
    each = left // (3 * rounds * longest)
    tree, report = eutree.distill(
        model, env,
        DistillationSettings(method=cell.who, learner="cart", max_leaves=cell.leaves,
                             iterations=rounds, episodes=each, validation_episodes=2 * each),
        action_values=action_values, seed=cell.seed,
    )  # fmt: skip
    return tree, steps + report.environment_steps


def measured(cell: Cell, trees: Path | None) -> dict[str, Any]:
    """Run a cell and return its row; its tree is kept in a folder, if there is one."""
    settings = Settings.of(cell.task)
    env = make(EnvironmentSpec(cell.task, settings.arguments))
    taught = int(TEACHERS * cell.steps) if cell.who in STUDENTS else 0
    teacher = network(cell.task, taught, cell.seed)[1] if taught else 0.0
    begin = time.process_time() - teacher
    if cell.who == "network":
        policy: Any = network(cell.task, cell.steps, cell.seed)[0]
        used, has_leaves = cell.steps, 0
    else:
        ours = cell.who == "eutree"
        policy, used = learned(cell, env, settings) if ours else distilled(cell, env)
        has_leaves = policy.tree.n_leaves
    spent = time.process_time() - begin
    end = eutree.evaluate(policy, env, episodes=FINAL_EPISODES, seed=1_000_000 + cell.seed)
    if trees is not None and cell.who == "eutree":
        trees.mkdir(parents=True, exist_ok=True)
        name = f"{cell.task.replace('/', '-')}-{cell.steps}-{cell.leaves}-{cell.seed}.json"
        policy.save(trees / name)
    returns = end.returns
    return {
        "who": cell.who, "task": cell.task, "steps": cell.steps, "leaves": cell.leaves,
        "seed": cell.seed, "return": round(float(returns.mean()), 2),
        "error": round(float(returns.std(ddof=1) / np.sqrt(returns.size)), 2),
        "success": "" if end.success_rate is None else round(float(end.success_rate), 4),
        "worst": round(float(returns.min()), 2), "has_leaves": has_leaves, "used": used,
        "cpu_s": round(spent, 1),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        "commit": commit(),
    }  # fmt: skip


def commit() -> str:
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    )
    return done.stdout.strip()


def file_of(folder: Path, task: str) -> Path:
    return folder / f"{task.replace('/', '-')}.csv"


def rows_of(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def known(path: Path) -> set[Cell]:
    return {
        Cell(row["who"], row["task"], int(row["steps"]), int(row["leaves"]), int(row["seed"]))
        for row in rows_of(path)
    }


def run(cells: Iterable[Cell], folder: Path, trees: Path | None) -> None:
    """Run what is not known yet, one after the other: trees of one network in one process."""
    context = multiprocessing.get_context("spawn")
    new = [cell for cell in cells if cell not in known(file_of(folder, cell.task))]
    for _, together in groupby(new, key=process_of):
        with context.Pool(1) as pool:
            for cell in together:
                keep(pool.apply(measured, (cell, trees)), file_of(folder, cell.task))


def process_of(cell: Cell) -> Cell:
    """Return what cells that may share a process have in common: the network that teaches."""
    return replace(cell, who="student", leaves=0) if cell.who in STUDENTS else cell


def keep(row: dict[str, Any], path: Path) -> None:
    """Append a row to a file of rows."""
    fresh = not path.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if fresh:
            writer.writeheader()
        writer.writerow(row)
    print(*(f"{key}={row[key]}" for key in COLUMNS), flush=True)


def cells_of(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells that were asked for; a network has no leaves, so one size is enough."""
    return [
        Cell(who, task, steps, leaves, seed)
        for task in arguments.tasks
        for steps in arguments.steps
        for seed in range(arguments.first, arguments.first + arguments.seeds)
        for who in arguments.who
        for leaves in ([0] if who == "network" else arguments.leaves)
    ]


def summary(rows: list[dict[str, str]]) -> str:
    """Return a cell of the table: mean, its interval over seeds, the worst seed, the leaves."""
    returns = [float(row["return"]) for row in rows]
    low, high = mean_interval(returns)
    has = np.mean([float(row["has_leaves"]) for row in rows])
    size = f"; {has:.1f} leaves" if has else ""
    used = np.mean([float(row["used"]) for row in rows])
    left = f", {used:,.0f} steps used" if used < ENOUGH * float(rows[0]["steps"]) else ""
    return f"{np.mean(returns):.1f} [{low:.1f}, {high:.1f}], worst {min(returns):.1f}{size}{left}"


def page(folder: Path) -> str:
    """Return the page of all rows that are stored, and of those known from elsewhere."""
    others = rows_of(folder.parent / "elsewhere.csv")
    files = {rows_of(path)[0]["task"]: path for path in folder.glob("*.csv")}
    lines = [HEAD]
    for task in sorted({*files, *(row["task"] for row in others)}):
        lines += ["", f"## {task}"]
        lines += of_task(files[task]) if task in files else []
        lines += elsewhere([row for row in others if row["task"] == task])
    return "\n".join([*lines, "", AIMS]) + "\n"


def of_task(path: Path) -> list[str]:
    """Return the picture and the table of a task's own rows."""
    rows = rows_of(path)
    budgets = sorted({int(row["steps"]) for row in rows})
    lines = ["", f"![Return at each size](table-{path.stem}.svg)", ""]
    lines.append(f"| who, at most | {' | '.join(f'{b:,} steps' for b in budgets)} |")
    lines.append("|---" * (len(budgets) + 1) + "|")
    for who, leaves in sorted({(row["who"], int(row["leaves"])) for row in rows}):
        cells = []
        for budget in budgets:
            here = [
                row for row in rows
                if (row["who"], int(row["leaves"]), int(row["steps"])) == (who, leaves, budget)
            ]  # fmt: skip
            few = f" ({len(here)} seeds)" if 0 < len(here) < SEEDS else ""
            cells.append(summary(here) + few if here else "")
        name = who if not leaves else f"{who}, {leaves} leaves"
        lines.append(f"| {name} | {' | '.join(cells)} |")
    ours = [row for row in rows if row["who"] == "eutree"]
    seconds = [float(row["cpu_s"]) for row in ours]
    said = (
        f"A run of eutree took {np.mean(seconds):.0f} CPU seconds on average, {max(seconds):.0f} "
        f"at most, and {max(int(row['peak_mb']) for row in ours)} MB at its peak. Sources: "
        f"{', '.join(sorted({row['commit'] for row in rows}))}."
    )
    return [*lines, "", *textwrap.wrap(said, 100)]


def elsewhere(rows: list[dict[str, str]]) -> list[str]:
    """Return the table of what is known of a task from elsewhere; nothing where nothing is."""
    if not rows:
        return []
    titles = ("who", "leaves", "steps", "return", "known")
    lines = ["", f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    return [*lines, *(f"| {' | '.join(row[title] for title in titles)} |" for row in rows)]


HEAD = """\
# Return at size at counted steps

Each cell: mean return of ten runs (200 fresh episodes each), 95 % interval over the runs, worst
run, mean number of leaves. Every environment step is counted: demonstrations, learning, races; of
`dagger` and `viper` those of their network too. Made by `python benchmarks/table.py TASK` for each
task and `python benchmarks/table.py --pages`; every run is a row in `docs/results/table/`. The
settings are those of `eutree learn --settings zoo:TASK` and were chosen on seeds from 1000 on; the
runs here have the seeds from 20,000 on. A cell that was made of fewer than ten runs says so; an
empty one was not run yet.

`dagger` and `viper` are CART by DAgger and VIPER from a DQN of Stable-Baselines3, with its zoo's
settings and half of the steps; `network` is that DQN with all of them and no tree at all. What
they gather is planned for episodes of full length, so where episodes are short steps are left. The
half was not tuned for them: what copies of a network that learned to its end reach, in more steps,
is in the rows from elsewhere.

Each size is a run of its own. The front of a single run has every size too, but pays for it: it
plays each of its trees from 60 starts or more, by default two steps for each step of the run, and
within 100,000 steps of MountainCar there are enough for two trees.

Below each task's own rows: *measured*, with the authors' code on fresh seeds (Gymnasium 1.4, two
cores; these programs are not part of this repository); *published*, by them; *here*, by another
command of this repository, on the page that is linked."""


AIMS = """\
## Aims that were missed

| aim | reached | tried |
|---|---|---|
| CartPole 500 with 4 leaves, 50 k | 496.9; three runs of ten | nothing beyond the settings |
| MountainCar -98.5 with 5 leaves | -99.3, some 240 k steps | the tree of 8 copied by DAgger; \
[sets of actions](../decisions/labels-as-sets.md) as labels: -101.9 |
| Acrobot -80 with 8 leaves, 100 k | -86.5; the best run -82.6 | sets of actions: no swing |
| LunarLander 200 with 34, 160 with 20, 500 k | 166.8, 133.6 | nothing new: six CPU minutes a run |
| two tanks -165 | -178.5 | nothing new |
| 3-Evasion: 98.5 %, return 90 | 98.8 %, 85.8 with 16 leaves, 10 k, four runs | larger not run |
| 4-Evasion: 92 %, return 75 | not run | nothing new |"""


def draw(folder: Path) -> None:
    """Draw a picture for each task: mean return over size, a line for each budget and rival."""
    import matplotlib as mpl

    mpl.use("svg")
    import matplotlib.pyplot as plt

    mpl.rcParams["svg.hashsalt"] = "eutree"
    others = rows_of(folder.parent / "elsewhere.csv")
    for path in sorted(folder.glob("*.csv")):
        rows = rows_of(path)
        figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
        kinds = dict.fromkeys((row["who"], int(row["steps"])) for row in rows)
        for who, steps in sorted(kinds):
            here = [row for row in rows if (row["who"], int(row["steps"])) == (who, steps)]
            sizes = sorted({int(row["leaves"]) for row in here})
            returns = [[float(r["return"]) for r in here if int(r["leaves"]) == n] for n in sizes]
            means = [float(np.mean(one)) for one in returns]
            label = f"{who}, {steps:,} steps"
            if who == "network":
                axes.axhline(means[0], linestyle=":", color="0.5", label=label)
                continue
            spread = [np.subtract(mean_interval(one)[1], np.mean(one)) for one in returns]
            axes.errorbar(sizes, means, yerr=spread, marker="o", capsize=3, label=label,
                          linestyle="-" if who == "eutree" else "--")  # fmt: skip
        mark(axes, [row for row in others if row["task"] == rows[0]["task"]])
        axes.set_xscale("log", base=2)
        axes.set_xticks(LEAVES, [str(n) for n in LEAVES])
        axes.set_xlabel("leaves, at most")
        axes.set_ylabel("mean return")
        axes.set_title(rows[0]["task"])
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
        figure.savefig(folder.parent / f"table-{path.stem}.svg", metadata={"Date": None})
        plt.close(figure)


def mark(axes: Any, others: list[dict[str, str]]) -> None:
    """Mark the trees of others that have a size of the table and a return within the picture."""
    low, high = axes.get_ylim()
    known = [(row["leaves"], row["return"]) for row in others if row["known"] != "here"]
    points = [
        (float(leaves), float(earned)) for leaves, earned in known
        if leaves.isdecimal() and earned.lstrip("-").replace(".", "").isdecimal()
    ]  # fmt: skip
    seen = [(x, y) for x, y in points if x <= LEAVES[-1] + 2 and y >= low - (high - low)]
    if seen:
        axes.scatter(
            *zip(*seen, strict=True), marker="x", color="0.3", label="elsewhere, any steps"
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("tasks", nargs="*")
    parser.add_argument("--who", nargs="+", default=["eutree"])
    parser.add_argument("--steps", nargs="+", type=int, default=list(STEPS))
    parser.add_argument("--leaves", nargs="+", type=int, default=list(LEAVES))
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--first", type=int, default=FIRST)
    parser.add_argument("--trees", type=Path)
    parser.add_argument("--out", type=Path, default=ROWS)
    parser.add_argument("--pages", action="store_true")
    arguments = parser.parse_args()
    if arguments.pages:
        draw(arguments.out)
        (arguments.out.parent / "table.md").write_text(page(arguments.out))
    else:
        run(cells_of(arguments), arguments.out, arguments.trees)


if __name__ == "__main__":
    main()
