"""Measure the default learner: learning runs of named cases, per seed and on average.

Run: python benchmarks/default_learner.py CASE [CASE ...] [--seeds 15] [--first 0] [--out DIR]

Evasion cases: 15 demonstrations of the gate demonstrator unless the name says otherwise, frozen
evaluations of 100 episodes every 20, 1,000 episodes at the end. Cases named ``without-...`` switch
one idea off; those of ``TRIED``, which ``all`` leaves out, are settings that were tried and not
taken. Other people's tasks are measured by other_tasks.py.
"""

import argparse
import csv
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.envs.experts import Expert, RulePolicy, careless
from eutree.evaluation import mean_interval
from eutree.learners import DEFAULT, PAPER, Method, PlanningMethod


@dataclass(frozen=True)
class Case:
    """What a learning run is made of."""

    env: str = "eutree/Evasion2-v0"
    expert: Expert = eutree.experts.wait_at_crossing
    demonstrations: int = 15
    episodes: int = 400
    start: str | None = None
    history: int = 0
    method: Method = DEFAULT
    shown: dict[str, Any] = field(default_factory=dict)  # of the environment of demonstrations
    learned: dict[str, Any] = field(default_factory=dict)  # of the environment of learning
    every: int = 20
    final: int = 1000
    limit: int = 0  # leaves to which real episodes prune the last tree, if any
    compared: bool = False  # whether the expert tree runs the last episodes too


def planning(**choices: Any) -> PlanningMethod:
    """Return the default method with other choices of its planner."""
    return replace(DEFAULT, planner=replace(DEFAULT.planner, **choices))


def always_go(env: Any) -> RulePolicy:
    """Return a demonstrator that never waits."""
    return RulePolicy(lambda observations: np.ones(observations.shape[:-1], dtype=np.int64))


GATE = Case()
PRUNING_STEPS = 10_000
IMPROVEMENT = DEFAULT.planner.improvement
CASES = {
    "eu-tree": replace(GATE, limit=15),
    "eu-tree-dt": replace(GATE, start="tree"),
    "c-u-tree": replace(GATE, demonstrations=0, episodes=1000),
    "three": replace(GATE, env="eutree/Evasion3-v0", episodes=600),
    "four": replace(
        GATE,
        env="eutree/Evasion-v0",
        shown={"n_opponents": 4},
        learned={"n_opponents": 4},
        method=planning(improvement=replace(IMPROVEMENT, max_leaves=30)),
        compared=True,
    ),
    "speed-4.2": replace(GATE, learned={"opponent_speed": 4.2}),
    "direction": replace(
        GATE, shown={"observe_direction": True}, learned={"observe_direction": True}
    ),
    "history-1": replace(GATE, history=1),
    "3-demonstrations": replace(GATE, demonstrations=3, episodes=600),
    "careless": replace(GATE, expert=careless(GATE.expert, 0.2), episodes=600),
    "always-go": replace(GATE, expert=always_go, episodes=600),
    "15-leaves": replace(GATE, method=planning(improvement=replace(IMPROVEMENT, max_leaves=15))),
    "paper": replace(GATE, method=PAPER),
    "without-pessimism": replace(GATE, method=planning(pessimism=0.5)),
    "without-explorer": replace(GATE, method=planning(explorer_share=0.0)),
    "few-imagined": replace(GATE, method=planning(n_episodes=200)),
    "without-price": replace(GATE, method=planning(improvement=replace(IMPROVEMENT, price=0.0))),
}

TRIED = {  # and not taken; measured on seeds from 1000
    "short-trials": replace(GATE, method=planning(min_episodes=20, memory=30)),
    "seldom-planned": replace(GATE, method=planning(growth=1.15)),
    "dear-leaves": replace(GATE, method=planning(improvement=replace(IMPROVEMENT, price=0.004))),
}


def run(case: Case, seed: int) -> dict[str, Any]:
    """Return what came of a run."""
    shown, env = (gymnasium.make(case.env, **a) for a in (case.shown, case.learned))
    demonstrations = None
    if case.demonstrations:
        demonstrations = eutree.record(shown, case.expert, episodes=case.demonstrations, seed=seed)
    learned = partial(
        eutree.learn,
        env,
        demonstrations=demonstrations,
        start=case.start,
        history=case.history,
        method=case.method,
        episodes=case.episodes,
        seed=seed,
    )
    start = time.thread_time()
    result = learned(evaluate_every=case.every)
    seconds = time.thread_time() - start
    small, _ = eutree.compress(result.policy, result.history.observations)
    end = eutree.evaluate(small, env, episodes=case.final, seed=1_000_000 + seed)
    row = {
        "seed": seed,
        "success": end.success_rate,
        "return": end.mean_return,
        "leaves": result.policy.n_leaves,
        "compressed": small.n_leaves,
        "steps": result.steps + (demonstrations.n_transitions if demonstrations else 0),
        "seconds": round(seconds, 2),
        "success_curve": _joined(point.success_rate for point in result.curve),
        "return_curve": _joined(point.mean_return for point in result.curve),
        "leaves_curve": _joined(point.n_leaves for point in result.curve),
    }
    if case.compared and demonstrations:
        expert = eutree.fit_expert_tree(demonstrations)
        begin = eutree.evaluate(expert, env, episodes=case.final, seed=1_000_000 + seed)
        row["expert_success"], row["expert_return"] = begin.success_rate, begin.mean_return
    if case.limit:
        raced = learned(race_steps=PRUNING_STEPS, max_leaves=case.limit, evaluation_episodes=1)
        pruned = raced.policy
        end = eutree.evaluate(pruned, env, episodes=case.final, seed=1_000_000 + seed)
        row["pruned_success"], row["pruned_return"] = end.success_rate, end.mean_return
        row["pruned_leaves"], row["pruned_steps"] = pruned.n_leaves, raced.environment_steps.racing
    return row


def _joined(values: Iterable[float]) -> str:
    return ";".join(f"{value:.4g}" for value in values)


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write the runs of one case."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


PAGE = """# The default learner, case by case

Made by `python benchmarks/default_learner.py all --out docs/results`; {seeds}, none of them used
in tuning. Means with 95 % intervals over runs, of 1,000 fresh episodes with the compressed tree.
*Lowest* is the lowest of the frozen evaluations (100 episodes, every 20 episodes of learning), each
averaged over the runs; *for good* is the mean number of episodes until the success rate stays at
95 % or more for five evaluations in a row (runs that do not get there count with all episodes).
Every run is in the folder `default`.

| case | runs | success % | return | leaves | compressed | lowest % | for good | steps | CPU s |
|---|---|---|---|---|---|---|---|---|---|
"""


PRUNED = """
The same runs ended by `learn(..., race_steps=10_000, max_leaves=15)`: races on real episodes,
whose steps are counted here, choose among smaller trees (compression as such gives nothing up).

| case | success % | return | leaves | steps more |
|---|---|---|---|---|
"""


def kept(folder: Path, cases: dict[str, Case]) -> Iterator[tuple[str, Case, list[dict[str, str]]]]:
    """Yield each case that has rows in a folder, with its name and these."""
    for name, case in cases.items():
        path = folder / f"{name}.csv"
        if path.exists():
            with path.open(newline="") as file:
                yield name, case, list(csv.DictReader(file))


def page(folder: Path) -> str:
    """Return the page of all cases in a folder."""
    lines, counts = [], set()
    for name, case, rows in kept(folder, CASES | TRIED):
        counts.add(len(rows))
        curves = np.array([[float(x) for x in r["success_curve"].split(";")] for r in rows])
        good = [_for_good(curve) * case.every for curve in curves]
        cells = [
            name,
            str(len(rows)),
            _mean([100 * float(r["success"]) for r in rows]),
            _mean([float(r["return"]) for r in rows]),
            *(_mean([float(r[key]) for r in rows]) for key in ("leaves", "compressed")),
            f"{100 * curves.mean(axis=0).min():.1f}",
            f"{np.mean(good):.0f}",
            *(f"{np.mean([float(r[key]) for r in rows]):.0f}" for key in ("steps", "seconds")),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    seeds = f"seeds from 0, {' or '.join(str(count) for count in sorted(counts))} runs a case"
    return PAGE.format(seeds=seeds) + "\n".join(lines) + "\n" + pruned(folder) + compared(folder)


COMPARED = """
On the same fresh episodes the expert tree that a run began with; *worst* is the run in which the
learned tree's success is least above it (or most below), in points.

| case | expert tree's success % | return | learned more, points | worst |
|---|---|---|---|---|
"""


def compared(folder: Path) -> str:
    """Return the table of the expert trees beside what was learned from them."""
    lines = []
    for name, case, rows in kept(folder, CASES):
        if not case.compared:
            continue
        gains = [100 * (float(r["success"]) - float(r["expert_success"])) for r in rows]
        cells = [
            name,
            _mean([100 * float(r["expert_success"]) for r in rows]),
            _mean([float(r["expert_return"]) for r in rows]),
            _mean(gains),
            f"{min(gains):.1f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return COMPARED + "\n".join(lines) + "\n" if lines else ""


def pruned(folder: Path) -> str:
    """Return the table of trees that real episodes pruned."""
    lines = []
    for name, case, rows in kept(folder, CASES):
        if not case.limit:
            continue
        cells = [
            name,
            _mean([100 * float(r["pruned_success"]) for r in rows]),
            *(_mean([float(r[f"pruned_{key}"]) for r in rows]) for key in ("return", "leaves")),
            f"{np.mean([float(r['pruned_steps']) for r in rows]):.0f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return PRUNED + "\n".join(lines) + "\n"


def _mean(values: list[float]) -> str:
    low, high = mean_interval(values)
    return f"{np.mean(values):.1f} [{low:.1f}, {high:.1f}]"


def _for_good(curve: Any) -> int:
    """Return the first of five evaluations in a row at 95 % or more, or the number of all."""
    high = np.asarray(curve) >= 0.95
    for at in range(high.size - 4):
        if high[at : at + 5].all():
            return at
    return high.size - 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="+", choices=["all", *CASES, *TRIED])
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for default-learner.md and default/")
    options = parser.parse_args()
    for name in CASES if "all" in options.cases else options.cases:
        rows = []
        for seed in range(options.first, options.first + options.seeds):
            rows.append(run((CASES | TRIED)[name], seed))
            print(name, rows[-1], file=sys.stderr, flush=True)
            if options.out is not None:
                write(options.out / "default" / f"{name}.csv", rows)
                (options.out / "default-learner.md").write_text(page(options.out / "default"))
    if options.out is not None:
        print((options.out / "default-learner.md").read_text())


if __name__ == "__main__":
    main()
