"""Measure the table: what a small tree earns at a size after a number of counted steps.

Run: python benchmarks/table.py TASK [TASK ...] [--who eutree derived sums dagger viper network]
     [--steps 10000 50000 100000] [--leaves 4 8 16 32] [--seeds 10] [--first 20000]
     [--trees FOLDER] [--out docs/results/table]

A cell is a run of its own, in a process of its own: 15 demonstrations of the task's script, then
the settings of ``src/eutree/zoo/settings/TASK.toml`` for the steps that are left (demonstrations
count). The tree has at most so many leaves, and 200 fresh episodes say what it earns. What sizes
have in common is learned once, and counted in each (``benchmarks/common_part.py``).
``derived`` does the same with the settings of ``TASK-derived.toml``, which declare features.
``sums`` lets trees ask for three weighted sums that the run finds: no person declares anything.
For the others ``sums`` is 0, whatever the settings say: their trees ask for raw numbers.
``dagger`` and ``viper`` make trees (CART) of a DQN of Stable-Baselines3 with the settings of its
zoo, which has four fifths of the steps; all its steps count. ``network`` is that DQN with all of
them: the line above. A task that its zoo does not know has the settings of Acrobot there.
A row is written as soon as it is known, and what a file of rows has already is not run again.
``--trees`` keeps each tree, from which ``benchmarks/zoo.py`` takes the best;
``benchmarks/table_page.py`` makes the page of the rows, and a picture for each task.
``benchmarks/releases.py`` runs a small fixed part and compares it with earlier ones.
Seeds from 1000 to 1999 are for tuning; those of the table begin at 20,000.
"""

import argparse
import csv
import importlib
import multiprocessing
import resource
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree import zoo
from eutree.cli._given import RunSettings, chosen_method
from eutree.distillation import DistillationSettings
from eutree.envs.experts import EXPERTS
from eutree.interaction.making import make
from eutree.interaction.names import Names, named
from eutree.schema import EnvironmentSpec

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the examples, and what is beside

from benchmarks.common_part import GoesOn, LeavesCheckpoint, fitted_once, name_of

ROOT = Path(__file__).resolve().parents[1]
ROWS = ROOT / "docs" / "results" / "table"
STEPS, LEAVES = (10_000, 50_000, 100_000), (4, 8, 16, 32)
SEEDS, FIRST, FINAL_EPISODES = 10, 20_000, 200
OURS = ("eutree", "derived", "sums")
SUMS = {"sums": 3}  # that trees may ask for; of the others none
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
ELSEWHERE = DQN["Acrobot-v1"]  # LunarLander's too, and those of tasks that its zoo does not know


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
    derived: Names  # of its features, those that are computed

    @classmethod
    def of(cls, task: str, who: str = "eutree") -> "Settings":
        path = zoo.settings_of(settings_name(task, who))
        method = chosen_method(None, offline=False, settings=path, changes=(), discount=None)
        if hasattr(method, "sums"):
            method = replace(method, sums=SUMS.get(who, 0))
        run = RunSettings.of(path)
        script = script_of(task, str(run.expert))
        return cls(method, script, run.demonstrations, run.race_share, dict(run.arguments),
                   Names(derived=tuple(run.derived)))  # fmt: skip


def settings_name(task: str, who: str) -> str:
    """Return the name of the settings with which somebody learns a task."""
    return f"{task}-derived" if who == "derived" else task


def script_of(task: str, name: str) -> Any:
    """Return who demonstrates: one of the package's, or MODULE:NAME, which registers the task."""
    module, _, own = name.rpartition(":")
    found = getattr(importlib.import_module(module), own) if module else EXPERTS[task][name]
    return found() if isinstance(found, type) else found


class Learning:
    """A run with its task's settings, in the steps that its demonstrations leave.

    What it has in common with other sizes is kept in a folder, if there is one.
    """

    def __init__(
        self, cell: Cell, env: Any, settings: Settings, folder: Path | None = None
    ) -> None:
        shown = eutree.record(
            env, settings.expert, episodes=settings.demonstrations, seed=cell.seed
        )
        left = cell.steps - shown.n_transitions
        if left <= 0:
            raise SystemExit(f"{cell}: the demonstrations alone take {shown.n_transitions} steps")
        self._leaves = cell.leaves
        self._learn = partial(
            eutree.learn, env, demonstrations=shown, method=settings.method, steps=left,
            race_steps=int(settings.race * left), judge_episodes=0, evaluate_every=10**6,
            evaluation_episodes=1, seed=cell.seed,
        )  # fmt: skip
        name = settings_name(cell.task, cell.who).replace("/", "-")
        name = f"{name}-{cell.seed}-{name_of(settings.method, left)}.npz"
        self._common = None if folder is None else folder / name

    def common_seconds(self) -> float:
        """Return the CPU seconds of what sizes have in common; the first of them learns that."""
        if self._common is None:
            return 0.0
        path = self._common.with_suffix(".seconds")
        if not path.exists():
            begin = time.process_time()
            self._learn(max_leaves=min(LEAVES), listeners=LeavesCheckpoint(self._common))
            path.write_text(str(time.process_time() - begin))
        return float(path.read_text())

    def result(self) -> tuple[eutree.TreePolicy, int]:
        """Return the tree, and all steps that the run took."""
        begins = () if self._common is None else GoesOn(self._common)
        found = self._learn(max_leaves=self._leaves, listeners=begins)
        return found.policy, found.environment_steps.total


def learned(
    cell: Cell, env: Any, settings: Settings, common: Path | None
) -> tuple[eutree.TreePolicy, int, float]:
    """Return the tree of a run of ours, all steps that it took, and its CPU seconds."""
    learning = Learning(cell, env, settings, common)
    shared = learning.common_seconds()
    begin = time.process_time()
    with nullcontext([0.0]) if common is None else fitted_once(common) as spared:
        policy, used = learning.result()
    return policy, used, time.process_time() - begin + shared + sum(spared)


@cache
def network(task: str, steps: int, seed: int) -> tuple[Any, float]:
    """Return a DQN of Stable-Baselines3 that learned for so many steps, and its CPU seconds."""
    import stable_baselines3
    import torch

    begin = time.process_time()
    torch.set_num_threads(1)
    model = stable_baselines3.DQN(
        "MlpPolicy",
        make(EnvironmentSpec(task, Settings.of(task).arguments)),
        policy_kwargs={"net_arch": [256, 256]},
        seed=seed,
        device="cpu",
        **DQN.get(task, ELSEWHERE),
    )
    return model.learn(steps), time.process_time() - begin


def distilled(cell: Cell, env: Any) -> tuple[eutree.TreePolicy, int, float]:
    """Return the best tree that DAgger or VIPER makes of a network, all steps, the CPU seconds."""
    steps = int(TEACHERS * cell.steps)
    model, taught = network(cell.task, steps, cell.seed)
    begin = time.process_time()

    def action_values(observations: np.ndarray) -> np.ndarray:
        measured = observations[:, : model.observation_space.shape[0]].astype(np.float32)
        tensor, _ = model.policy.obs_to_tensor(measured)
        return model.q_net(tensor).detach().numpy()

    left, longest = cell.steps - steps, gymnasium.spec(cell.task).max_episode_steps or 1000
    rounds = min(ROUNDS, left // (3 * longest))  # an episode to learn from, two to judge
    if rounds == 0:
        raise SystemExit(
            f"{cell}: {left} steps are left for episodes of {longest}: three are needed"
        )
    each = left // (3 * rounds * longest)
    tree, report = eutree.distill(
        model, env,
        DistillationSettings(method=cell.who, learner="cart", max_leaves=cell.leaves,
                             iterations=rounds, episodes=each, validation_episodes=2 * each),
        action_values=action_values, seed=cell.seed,
    )  # fmt: skip
    return tree, steps + report.environment_steps, time.process_time() - begin + taught


def measured(cell: Cell, trees: Path | None, common: Path | None) -> dict[str, Any]:
    """Run a cell and return its row.

    Args:
        cell: Which.
        trees: Where its tree is kept; None for nowhere.
        common: Where what it has in common with other sizes is kept; None learns it anew.
    """
    settings = Settings.of(cell.task, cell.who)
    with named(settings.derived):
        env = make(EnvironmentSpec(cell.task, settings.arguments))
    policy: Any
    if cell.who in OURS:
        policy, used, spent = learned(cell, env, settings, common)
    elif cell.who in STUDENTS:
        policy, used, spent = distilled(cell, env)
    else:
        (policy, spent), used = network(cell.task, cell.steps, cell.seed), cell.steps
    if trees is not None and cell.who in OURS:
        trees.mkdir(parents=True, exist_ok=True)
        policy.save(trees / tree_of(cell))
    return row_of(cell, policy, env, used, spent)


def row_of(cell: Cell, policy: Any, env: Any, used: int, spent: float) -> dict[str, Any]:
    """Return the row of a cell: what its policy earns on fresh episodes, and what it cost."""
    has_leaves = policy.tree.n_leaves if isinstance(policy, eutree.TreePolicy) else 0
    end = eutree.evaluate(policy, env, episodes=FINAL_EPISODES, seed=1_000_000 + cell.seed)
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


def tree_of(cell: Cell) -> str:
    """Return the name of the file that a cell's tree is kept in."""
    who = "" if cell.who == OURS[0] else f"-{cell.who}"
    return f"{cell.task.replace('/', '-')}{who}-{cell.steps}-{cell.leaves}-{cell.seed}.json"


def cell_of(row: dict[str, str]) -> Cell:
    """Return the cell that a row is of."""
    return Cell(row["who"], row["task"], int(row["steps"]), int(row["leaves"]), int(row["seed"]))


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
    return {cell_of(row) for row in rows_of(path)}


def run(cells: Iterable[Cell], folder: Path, trees: Path | None) -> None:
    """Run what is not known yet, one after the other: trees of one network in one process."""
    context = multiprocessing.get_context("spawn")
    new = [cell for cell in cells if cell not in known(file_of(folder, cell.task))]
    with TemporaryDirectory() as common:
        for _, together in groupby(new, key=process_of):
            with context.Pool(1) as pool:
                for cell in together:
                    row = pool.apply(measured, (cell, trees, Path(common)))
                    keep(row, file_of(folder, cell.task))


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
    arguments = parser.parse_args()
    run(cells_of(arguments), arguments.out, arguments.trees)


if __name__ == "__main__":
    main()
