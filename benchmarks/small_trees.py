"""Measure the method distilled-dqn: small trees from mediocre demonstrations, every step counted.

Run: python benchmarks/small_trees.py TASK [TASK ...] [--seeds 10] [--first 0] [--steps N]
     [--max-leaves L] [--out docs/results] [--runs FOLDER] [--links] [--cut LEAVES] [--pages]

For each seed 15 demonstrations of a mediocre scripted controller are recorded, and `learn` goes on
from them with what is left of the steps: the teacher's, DAgger's and the races' steps all count,
demonstrations too. The last tree is evaluated on 200 fresh episodes. Beside it stand, on the same
episodes, C4.5's tree of the demonstrations, the teacher, and what DAgger and VIPER (with CART) make
of that very teacher at the same size, with the steps that it left.
Seeds that the table in `--out` has already are not run again; what they lack of DAgger and VIPER is
added, for which the teacher alone learns once more, to the same bytes.
With `--links` nothing is learned: for each of a task's runs in `--runs`, finished or not, it says
where the chain from teacher to tree loses, one figure for each link, and how the other world model,
planning's model trees, would have ordered the trees that were really run.
With `--cut LEAVES` nothing is learned: each run's tree is cut to so many leaves as `eutree compress
--max-leaves LEAVES --imagined` does it, which takes no step, and evaluated on the same episodes.
`--pages` writes the pages of the tables in `--out` anew, and runs nothing.
Seeds from 1000 on are for tuning; reported are seeds below.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from examples.two_tanks import FloatSwitch, method_for

import eutree
from eutree.compression import ImaginedEpisodes
from eutree.distillation import DistillationSettings
from eutree.envs.experts import EXPERTS
from eutree.evaluation import mean_interval
from eutree.files import read_archive
from eutree.learners.declared import part
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.distilled_dqn.races import RACED_TREE, RacedTree, unpacked_raced
from eutree.learners.distilled_dqn.state import NUMBERS, Stage
from eutree.policies import TreePolicy
from eutree.policy_search.model_trust import RankCorrelation, rank_correlation
from eutree.training import stored_transitions
from eutree.training.checkpoint import MAX_CHECKPOINT, CheckpointDocument
from eutree.world_model import ActionTree, PairedRollouts, fit_world_models
from eutree.world_model.action_trees import to_decision_tree

FINAL_EPISODES = 200
SEEDS = 10
DEMONSTRATIONS = 15
ROUNDS = 10  # trees of DAgger and of VIPER
MOST_GATHERED, MOST_VALIDATED = 10, 50  # episodes for each of them: eutree.distill's own
BASELINES = ("dagger", "viper")
FEWEST_RETURNS = 4  # of a tree whose order counts


@dataclass(frozen=True)
class Task:
    """A task: environment, demonstrator, most leaves, most steps, the return to reach."""

    env: str
    expert: Any
    leaves: int
    steps: int
    target: float | None
    method: Callable[[int], DistilledDQN] = lambda leaves: DistilledDQN(max_leaves=leaves)


LANDER = Task("LunarLander-v3", EXPERTS["LunarLander-v3"]["brake"], 34, 500_000, 165.0)
TASKS = {
    "LunarLander": LANDER,
    "LunarLander20": replace(LANDER, leaves=20, target=120.0),
    "Acrobot": Task("Acrobot-v1", EXPERTS["Acrobot-v1"]["both"], 8, 100_000, -81.0),
    "CartPole": Task("CartPole-v1", EXPERTS["CartPole-v1"]["fall"], 4, 50_000, 499.5),
    "MountainCar": Task("MountainCar-v0", EXPERTS["MountainCar-v0"]["push"], 6, 100_000, -99.1),
    "TwoTanks": Task("TwoTanks-v0", FloatSwitch(), 20, 100_000, None, method_for),
}
OF_TEACHER = ("teacher", "teacher_steps", *(f"{name}{what}" for name in BASELINES
                                           for what in ("", "_leaves", "_steps")))  # fmt: skip
CUT_COLUMNS = ("seed", "whole", "return", "error", "leaves", "before", "after", "seconds",
               *OF_TEACHER)  # fmt: skip
COLUMNS = ("seed", "shown", "start", "return", "error", "leaves", "steps", "seconds",
           *OF_TEACHER)  # fmt: skip
Row = dict[str, float | int]


class Measurement:
    """One seed of a task.

    Args:
        task: The task.
        seed: The seed.
        folder: Where the run is written.
    """

    def __init__(self, task: Task, seed: int, folder: Path) -> None:
        self._task, self._seed, self._folder = task, seed, folder
        self._env = gymnasium.make(task.env)
        self._shown = eutree.record(self._env, task.expert, episodes=DEMONSTRATIONS, seed=seed)
        self._expert = eutree.fit_expert_tree(self._shown)
        self._teacher: Any = None

    def learned(self) -> Row:
        """Return what the whole run came to."""
        begin = time.process_time()
        result = self._learn(lambda: False, self._folder)
        seconds = time.process_time() - begin
        self._teacher = result.teacher
        found = self._evaluated(result.policy)
        return {
            "seed": self._seed,
            "shown": round(float(np.mean([e.undiscounted_return for e in self._shown])), 2),
            "start": round(self._evaluated(self._expert).mean_return, 2),
            "return": round(found.mean_return, 2),
            "error": round(float(np.std(found.returns) / FINAL_EPISODES**0.5), 2),
            "leaves": result.policy.n_leaves,
            "steps": self._shown.n_transitions + result.steps,
            "seconds": round(seconds),
            "teacher_steps": teacher_steps(self._folder),
        }

    def baselines(self, leaves: int | None = None) -> Row:
        """Return what the teacher earns, and what DAgger and VIPER make of it at the same size.

        Args:
            leaves: Most leaves; the task's if None.
        """
        teacher = self._taught()
        row: Row = {
            "teacher": round(self._evaluated(teacher).mean_return, 2),
            "teacher_steps": teacher_steps(self._folder),
        }
        left = self._task.steps - self._shown.n_transitions - row["teacher_steps"]
        length = np.mean([len(episode) for episode in self._shown])
        for name in BASELINES:
            settings = DistillationSettings(
                method=name,
                learner="cart",
                max_leaves=leaves or self._task.leaves,
                iterations=ROUNDS,
            )
            rows = self._distilled(teacher, settings, left, float(length))
            row |= {f"{name}{what}": value for what, value in rows.items()}
        return row

    def _distilled(
        self, teacher: Any, settings: DistillationSettings, left: float, length: float
    ) -> Row:
        """Return what a baseline comes to; it takes fewer episodes where its steps would not do.

        Episodes may become longer than the demonstrations were: then they are reckoned anew.
        """
        while True:
            affordable = int(left / (ROUNDS * length))
            gathered = int(np.clip(affordable // 2, 1, MOST_GATHERED))
            tree, told = eutree.distill(
                teacher,
                self._env,
                replace(
                    settings,
                    episodes=gathered,
                    validation_episodes=int(np.clip(affordable - gathered, 2, MOST_VALIDATED)),
                ),
                seed=self._seed,
            )
            if told.environment_steps <= left or affordable <= 3:
                break
            length *= 1.05 * told.environment_steps / left
        return {
            "": round(self._evaluated(tree).mean_return, 2),
            "_leaves": tree.n_leaves,
            "_steps": told.environment_steps,
        }

    def _taught(self) -> Any:
        """Return the teacher: the run's, or the same one from a run that ends when it is taught."""
        if self._teacher is None:
            over = False

            def look(run: Any) -> None:
                nonlocal over
                over = run.learner.stage is not Stage.TEACHER

            result = self._learn(lambda: over, self._folder, look)
            self._teacher = result.teacher
        return self._teacher

    def _learn(
        self, stop: Callable[[], bool], folder: Path, look: Callable[[Any], None] | None = None
    ) -> Any:
        return eutree.learn(
            self._env,
            demonstrations=self._shown,
            expert=self._expert,
            method=self._task.method(self._task.leaves),
            steps=self._task.steps - self._shown.n_transitions,
            seed=self._seed,
            evaluate_every=10**6,
            evaluation_episodes=1,  # two evaluations of one episode, which decide nothing
            out=folder,
            resume=(folder / "config.json").exists(),
            checkpoint_seconds=600.0,
            stop=stop,
            on_progress=look,
        )

    def _evaluated(self, policy: Any) -> Any:
        """Evaluate on fresh episodes, the same for all."""
        return evaluated(policy, self._env, self._seed)


def evaluated(policy: Any, env: Any, seed: int) -> Any:
    """Evaluate on a seed's fresh episodes, the same for all."""
    return eutree.evaluate(policy, env, episodes=FINAL_EPISODES, seed=1_000_000 + seed)


def events_of(folder: Path) -> list[dict[str, Any]]:
    """Return what happened in a run."""
    lines = (folder / "events.jsonl").read_text().splitlines()
    return [json.loads(line) for line in lines]


def teacher_steps(folder: Path) -> int:
    """Return the steps in which a run's teacher learned."""
    events = events_of(folder)
    return max(event["steps"] for event in events if event.get("stage") == "teacher")


def front_matter(command: str) -> list[str]:
    """Return the first lines of a page: what made it, of which commit, when."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    return [
        "---",
        f"command: {command}",
        f"commit: {commit}",
        f"date: {time.strftime('%Y-%m-%d')}",
        "sources: benchmarks/small_trees.py src/eutree/learners/distilled_dqn/__init__.py "
        "src/eutree/neural src/eutree/world_model src/eutree/policy_search src/eutree/cart",
        "---",
        "",
    ]


def summary(returns: list[float]) -> str:
    """Return the mean over seeds, its interval and the worst seed, in words."""
    interval = "one seed: no interval over seeds"
    if len(returns) > 1:
        low, high = mean_interval(np.array(returns))
        interval = f"95 % over seeds [{low:.1f}, {high:.1f}]"
    return (
        f"Mean of {len(returns)} seed{'s' if len(returns) > 1 else ''}: {np.mean(returns):.1f}, "
        f"{interval}; worst seed {min(returns):.1f}"
    )


def report(task: Task, rows: list[Row], command: str) -> str:
    """Return the page of one task."""
    returns = [row["return"] for row in rows]
    target = "clearly better than its start" if task.target is None else f"{task.target:g}"
    lines = [
        *front_matter(command),
        f"# {task.env}: a small tree from a counted teacher",
        "",
        f"Made by `{command}`.",
        f"At most {task.leaves} leaves and {task.steps:,} environment steps, all counted; "
        f"target: {target}.",
        f"{summary(returns)}.",
        "",
        "| seed | demonstrations | C4.5's tree of them | learned | s.e. of 200 episodes | leaves "
        "| steps | CPU s | teacher | DAgger | VIPER |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['seed']} | {row['shown']:.1f} | {row['start']:.1f} | {row['return']:.1f} | "
            f"{row['error']:.1f} | {row['leaves']} | {row['steps']:,} | {row['seconds']} | "
            f"{beside(row)} |"
        )
    return "\n".join([*lines, *said_of_baselines(rows, task.leaves)]) + "\n"


def beside(row: Row) -> str:
    """Return the cells of the teacher, DAgger and VIPER, empty where they were not measured."""
    return " | ".join(f"{row[name]:.1f}" if name in row else "" for name in ("teacher", *BASELINES))


def said_of_baselines(rows: list[Row], leaves: int) -> list[str]:
    """Return what is said of them below a table, if anything."""
    known = [row for row in rows if BASELINES[-1] in row]
    if not known:
        return []
    means = {name: np.mean([row[name] for row in known]) for name in ("teacher", *BASELINES)}
    most = max(row[f"{name}_steps"] + row["teacher_steps"] for row in known for name in BASELINES)
    return [
        "",
        f"The teacher of each run earns {means['teacher']:.1f} on average; DAgger and VIPER, "
        f"with CART, at most {leaves} leaves and the best of {ROUNDS} trees on validation "
        f"episodes, make {means['dagger']:.1f} and {means['viper']:.1f} of it, in at most "
        f"{most:,} steps with the teacher's.",
    ]


def table_of(path: Path) -> dict[int, Row]:
    """Return the rows measured before, by seed."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        rows = [
            {name: float(text) if "." in text else int(text) for name, text in row.items() if text}
            for row in csv.DictReader(file)
        ]
    return {int(row["seed"]): row for row in rows}


def write_table(path: Path, rows: list[Row], columns: tuple[str, ...] = COLUMNS) -> None:
    """Write rows as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=columns)
        writer.writeheader()
        writer.writerows(rows)


def command_of(name: str, rows: list[Row], more: str = "") -> str:
    """Return what makes the page of a task, of these seeds: one command for each stretch."""
    seeds = [int(row["seed"]) for row in rows]
    begins = [seed for seed in seeds if seed - 1 not in seeds]
    ends = [seed for seed in seeds if seed + 1 not in seeds]
    commands = []
    for begin, end in zip(begins, ends, strict=True):
        command = f"python benchmarks/small_trees.py {name}"
        command += f" --first {begin}" if begin else ""
        command += f" --seeds {end - begin + 1}" if end - begin + 1 != SEEDS else ""
        commands.append(command + more)
    return " && ".join(commands)


def measure(name: str, task: Task, options: argparse.Namespace) -> None:
    """Measure a task's seeds, and write the page after each."""
    path = options.out / f"small-trees-{name}.csv"
    known = table_of(path)
    for seed in range(options.first, options.first + options.seeds):
        row = known.get(seed, {})
        with tempfile.TemporaryDirectory() as temporary:
            folder = (options.runs or Path(temporary)) / f"{name}-{seed}"
            one = Measurement(task, seed, folder)
            if "return" not in row:
                row |= one.learned()
            if BASELINES[-1] not in row:
                row |= one.baselines()
        known[seed] = row
        print(name, row, file=sys.stderr, flush=True)
        rows = [known[number] for number in sorted(known)]
        write_table(path, rows)
        path.with_suffix(".md").write_text(report(task, rows, command_of(name, rows)))


def cut(task: Task, folder: Path, leaves: int) -> Row:
    """Return what a run's tree comes to, cut to so many leaves by imagined returns."""
    seed = int(folder.name.rpartition("-")[2])
    policy = policy_of(folder)
    env = gymnasium.make(task.env)
    begin = time.process_time()
    known = stored_transitions(folder, policy.schema.n_actions)
    small, told = eutree.compress(
        policy,
        known.observations,
        max_leaves=leaves,
        imagined=ImaginedEpisodes(known, task.method(leaves).world_model),
        seed=seed,
    )
    seconds = time.process_time() - begin
    found = evaluated(small, env, seed)
    before, after = told.imagined or (float("nan"), float("nan"))
    return {
        "seed": seed,
        "whole": round(evaluated(policy, env, seed).mean_return, 2),
        "return": round(found.mean_return, 2),
        "error": round(float(np.std(found.returns) / FINAL_EPISODES**0.5), 2),
        "leaves": small.n_leaves,
        "before": round(before, 2),
        "after": round(after, 2),
        "seconds": round(seconds),
    }


def report_of_cuts(name: str, leaves: int, rows: list[Row]) -> str:
    """Return the page of trees that were cut."""
    learned = command_of(name, rows, " --runs runs")
    command = f"python benchmarks/small_trees.py {name} --cut {leaves} --runs runs"
    returns = [row["return"] for row in rows]
    return "\n".join(
        [
            *front_matter(f"{learned} && {command}"),
            f"# {TASKS[name].env}: the trees of the runs, cut to {leaves} leaves",
            "",
            f"Made by `{command}` from the folders of the runs of `{learned}`. Each tree",
            "is cut by imagined returns, in a world model fitted to its run's transitions; that",
            f"takes no step. Return on 200 fresh episodes: {summary(returns)}.",
            "",
            "| seed | whole tree | cut | s.e. of 200 episodes | leaves | imagined before "
            "| imagined after | CPU s | teacher | DAgger | VIPER |",
            "|---|---|---|---|---|---|---|---|---|---|---|",
            *(
                f"| {row['seed']} | {row['whole']:.1f} | {row['return']:.1f} | {row['error']:.1f} "
                f"| {row['leaves']} | {row['before']:.1f} | {row['after']:.1f} "
                f"| {row['seconds']} | {beside(row)} |"
                for row in rows
            ),
            *said_of_baselines(rows, leaves),
            "",
        ]
    )


def cut_all(name: str, options: argparse.Namespace) -> None:
    """Cut the trees of a task's runs, those not cut before, and write the page.

    Beside them stand DAgger and VIPER of the runs' teachers at that size.
    """
    path = options.out / f"small-trees-{name}-cut-{options.cut}.csv"
    known = table_of(path)
    for folder in runs_of(name, options.runs):
        seed = int(folder.name.rpartition("-")[2])
        row = known.get(seed) or cut(TASKS[name], folder, options.cut)
        if BASELINES[-1] not in row:
            row |= Measurement(TASKS[name], seed, folder).baselines(options.cut)
        known[seed] = row
        print(name, row, file=sys.stderr, flush=True)
        rows = [known[number] for number in sorted(known)]
        write_table(path, rows, CUT_COLUMNS)
        path.with_suffix(".md").write_text(report_of_cuts(name, options.cut, rows))


def runs_of(name: str, runs: Path | None) -> list[Path]:
    """Return the folders of a task's runs in which trees have raced."""
    folders = sorted(path.parent for path in (runs or Path()).glob(f"{name}-*/events.jsonl"))
    return [one for one in folders if any("entrant" in event for event in events_of(one))]


def links(folder: Path) -> dict[str, str]:
    """Return one figure for each link of the chain from teacher to tree, of a finished run."""
    events = events_of(folder)
    earned: dict[str, list[float]] = {}
    for event in events:
        if event.get("stage") in ("teacher", "dagger") and "return" in event:
            earned.setdefault(event["stage"], []).append(event["return"])
    met = [one for one in raced_trees_of(folder) if len(one.returns) >= FEWEST_RETURNS]
    real = np.array([one.mean_return for one in met])
    neural = rank_correlation(np.array([one.imagined for one in met]), real)
    trees = rank_correlation(imagined_by_model_trees(folder, [one.tree for one in met]), real)
    of = {
        kind: [one.mean_return for one in met if one.origin.startswith(kind)]
        for kind in ("start", "cart", "pruned")
    }
    return {
        "teacher, last 50 episodes": means(earned.get("teacher", [])[-50:]),
        "DAgger's large trees": means(earned.get("dagger", [])),
        "CART of the size allowed": means(of["cart"]),
        "pruned by imagined returns": means(of["pruned"]),
        **of_rounds(events),
        "the policy now, 200 fresh episodes": earned_by_policy(folder),
        "steps of the teacher, and so far": f"{teacher_steps(folder):,}, {events[-1]['steps']:,}",
        "the best of them in races": f"{max(of['pruned'], default=float('nan')):.1f}",
        "order by the networks": str_of(neural),
        "order by model trees": str_of(trees),
    }


def of_rounds(events: list[dict[str, Any]]) -> dict[str, str]:
    """Return what prunings earned in their first race, for the first and for later races."""
    raced = [e for e in events if e.get("stage") == "race" and "entrant" in e]
    first_race: dict[int, int] = {}
    returns: dict[int, list[float]] = {}
    of_round: dict[int, list[float]] = {}
    for episode in raced:
        race, entrant = episode["race"], episode["entrant"]
        if episode["origin"].startswith("pruned") and first_race.setdefault(entrant, race) == race:
            returns.setdefault(entrant, []).append(episode["return"])
    for entrant, earned in returns.items():
        of_round.setdefault(min(first_race[entrant], 2), []).append(float(np.mean(earned)))
    return {
        "prunings in their first race, first round": means(of_round.get(1, [])),
        "the same, later rounds": means(of_round.get(2, [])),
    }


def raced_trees_of(folder: Path) -> list[RacedTree]:
    """Return all trees of a run, with their scores and returns."""
    _, arrays = read_archive(folder / "checkpoint.npz", CheckpointDocument, limit=MAX_CHECKPOINT)
    return unpacked_raced(part(arrays, RACED_TREE))


def policy_of(folder: Path) -> TreePolicy:
    """Return the policy of a run: the last, or that of the checkpoint where it is not finished."""
    if (folder / "policy.json").exists():
        return TreePolicy.load(folder / "policy.json")
    expert = TreePolicy.load(folder / "expert.json")
    _, arrays = read_archive(folder / "checkpoint.npz", CheckpointDocument, limit=MAX_CHECKPOINT)
    incumbent = int(arrays["numbers"][NUMBERS.index("races.incumbent")])
    tree = raced_trees_of(folder)[incumbent].tree
    structure, actions = to_decision_tree(tree, expert.tree.n_features)
    return replace(expert, tree=structure, actions=actions, leaves=None, locked=())


def earned_by_policy(folder: Path) -> str:
    """Return the mean return of a run's policy on the seed's fresh episodes, and its leaves."""
    name, _, seed = folder.name.rpartition("-")
    policy = policy_of(folder)
    found = evaluated(policy, gymnasium.make(TASKS[name].env), int(seed))
    error = float(np.std(found.returns) / FINAL_EPISODES**0.5)
    return f"{found.mean_return:.1f} (s.e. {error:.1f}), {policy.n_leaves} leaves"


def imagined_by_model_trees(folder: Path, trees: list[ActionTree]) -> Any:
    """Return the mean return of each tree in planning's world model of the run's transitions."""
    n_actions = policy_of(folder).schema.n_actions
    known = stored_transitions(folder, n_actions).recent(50_000)
    model = fit_world_models(known, (0.99,))[0]  # as pessimistic as planning's challenger
    rollouts = PairedRollouts(model, 150, 1.0, np.random.default_rng(0))
    found = []
    for tree in trees:
        rollouts.run(tree)
        found.append(rollouts.mean_return)
    return np.array(found)


def means(values: list[float]) -> str:
    """Return a mean, and the lowest and highest value."""
    if not values:
        return "unknown"
    return f"{np.mean(values):.1f} ({min(values):.1f} to {max(values):.1f})"


def str_of(found: RankCorrelation) -> str:
    """Return a rank correlation with its interval."""
    return f"{found.value:.2f} [{found.low:.2f}, {found.high:.2f}], {found.n} trees"


def table_of_links(folders: list[Path]) -> str:
    """Return the links of several runs beside each other."""
    columns = [links(folder) for folder in folders]
    lines = [
        "| link | " + " | ".join(folder.name for folder in folders) + " |",
        "|---" * (len(folders) + 1) + "|",
    ]
    lines += [
        f"| {name} | " + " | ".join(column[name] for column in columns) + " |"
        for name in columns[0]
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="+", choices=list(TASKS))
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--steps", type=int, help="in place of the task's")
    parser.add_argument("--max-leaves", type=int, help="in place of the task's")
    parser.add_argument("--out", type=Path, default=Path("docs/results"),
                        help="folder for small-trees-TASK.md and .csv")  # fmt: skip
    parser.add_argument("--runs", type=Path, help="folder to keep the run folders in")
    parser.add_argument(
        "--pages", action="store_true", help="write the pages of the tables anew, no run"
    )
    parser.add_argument("--links", action="store_true", help="say where the chain loses, no run")
    parser.add_argument("--cut", type=int, metavar="LEAVES", help="cut the runs' trees, no run")
    options = parser.parse_args()
    if options.links:
        for name in options.tasks:
            print(table_of_links(runs_of(name, options.runs)))
        return
    if options.cut:
        for name in options.tasks:
            cut_all(name, options)
        return
    if options.pages:
        for name in options.tasks:
            path = options.out / f"small-trees-{name}.csv"
            rows = [row for _, row in sorted(table_of(path).items())]
            path.with_suffix(".md").write_text(report(TASKS[name], rows, command_of(name, rows)))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    for name in options.tasks:
        task = TASKS[name]
        task = replace(
            task, steps=options.steps or task.steps, leaves=options.max_leaves or task.leaves
        )
        measure(name, task, options)
        print((options.out / f"small-trees-{name}.md").read_text())


if __name__ == "__main__":
    main()
