"""Measure the default learner: learning runs of named cases, per seed and on average.

Run: python benchmarks/default_learner.py CASE [CASE ...] [--seeds 15] [--first 0] [--out DIR]

Evasion cases: 15 demonstrations of the gate demonstrator unless the name says otherwise, frozen
evaluations of 100 episodes every 20, 1,000 episodes at the end. Cases named ``without-...`` switch
one idea off. Other tasks: 15 demonstrations of a mediocre scripted controller, 200 episodes at the
end; steps are those of learning and demonstrations, the learner makes no others.
"""

import argparse
import csv
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.envs.experts import EXPERTS, Expert, careless
from eutree.learning import DEFAULT, PAPER, Settings


@dataclass(frozen=True)
class Case:
    """What a learning run is made of."""

    env: str = "eutree/Evasion2-v0"
    expert: Expert = eutree.experts.wait_at_crossing
    demonstrations: int = 15
    episodes: int = 400
    learner: str | None = None
    history: int = 0
    settings: Settings = DEFAULT
    shown: dict[str, Any] = field(default_factory=dict)  # of the environment of demonstrations
    learned: dict[str, Any] = field(default_factory=dict)  # of the environment of learning
    every: int = 20
    final: int = 1000


def imagining(**choices: Any) -> Settings:
    """Return the default settings with other choices of imagination."""
    return replace(DEFAULT, imagination=replace(DEFAULT.imagination, **choices))


def gymnasium_case(env: str, expert: str, episodes: int) -> Case:
    """Return the case of another people's task."""
    return Case(env, EXPERTS[env][expert], episodes=episodes, every=episodes, final=200)


GATE = Case()
IMPROVEMENT = DEFAULT.imagination.improvement
CASES = {
    "eu-tree": GATE,
    "eu-tree-dt": replace(GATE, learner="eu-tree-dt"),
    "c-u-tree": replace(GATE, demonstrations=0, episodes=1000),
    "three": replace(GATE, env="eutree/Evasion3-v0", episodes=600),
    "speed-4.2": replace(GATE, learned={"opponent_speed": 4.2}),
    "direction": replace(
        GATE, shown={"observe_direction": True}, learned={"observe_direction": True}
    ),
    "history-1": replace(GATE, history=1),
    "3-demonstrations": replace(GATE, demonstrations=3, episodes=600),
    "careless": replace(GATE, expert=careless(GATE.expert, 0.2), episodes=600),
    "paper": replace(GATE, settings=PAPER),
    "without-pessimism": replace(GATE, settings=imagining(pessimism=0.5)),
    "without-explorer": replace(GATE, settings=imagining(explorer_share=0.0)),
    "without-trial": replace(GATE, settings=imagining(min_trial=2, memory=2)),
    "few-imagined": replace(GATE, settings=imagining(n_episodes=200)),
    "without-price": replace(GATE, settings=imagining(improvement=replace(IMPROVEMENT, price=0.0))),
    "CartPole": gymnasium_case("CartPole-v1", "fall", 100),
    "MountainCar": gymnasium_case("MountainCar-v0", "push", 300),
    "Acrobot": gymnasium_case("Acrobot-v1", "both", 400),
}


def run(case: Case, seed: int) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the row of a run's end, and the rows of its curve."""
    shown, env = (gymnasium.make(case.env, **a) for a in (case.shown, case.learned))
    demonstrations = None
    if case.demonstrations:
        demonstrations = eutree.record(shown, case.expert, episodes=case.demonstrations, seed=seed)
    start = time.thread_time()
    result = eutree.learn(
        env,
        demonstrations=demonstrations,
        learner=case.learner,
        history=case.history,
        settings=case.settings,
        episodes=case.episodes,
        seed=seed,
        evaluate_every=case.every,
    )
    seconds = time.thread_time() - start
    small, _ = eutree.compress(result.policy, result.history.observations)
    end = eutree.evaluate(small, env, episodes=case.final, seed=1_000_000 + seed)
    row = {
        "seed": seed,
        "success": np.nan if end.success_rate is None else end.success_rate,
        "return": end.mean_return,
        "leaves": result.policy.n_leaves,
        "compressed": small.n_leaves,
        "steps": result.steps + (demonstrations.n_transitions if demonstrations else 0),
        "seconds": seconds,
    }
    return row, [{"seed": seed, **vars(point)} for point in result.curve]


def report(name: str, rows: list[dict[str, Any]], curves: list[dict[str, Any]]) -> str:
    """Return the lines of one case: its means, each seed, the mean curve."""
    keys = list(rows[0])[1:]
    means = [np.mean([row[key] for row in rows]) for key in keys]
    lines = [
        f"## {name}",
        "",
        "| seed | " + " | ".join(keys) + " |",
        "|---" * (len(keys) + 1) + "|",
    ]
    for label, values in [("mean", means), *((r["seed"], [r[k] for k in keys]) for r in rows)]:
        lines.append(f"| {label} | " + " | ".join(f"{value:.4g}" for value in values) + " |")
    episodes = sorted({point["episode"] for point in curves})
    lines += ["", "| episode | success | return | leaves |", "|---|---|---|---|"]
    for episode in episodes:
        here = [p for p in curves if p["episode"] == episode]
        success = np.mean(
            [np.nan if p["success_rate"] is None else p["success_rate"] for p in here]
        )
        mean_return = np.mean([p["mean_return"] for p in here])
        leaves = np.mean([p["n_leaves"] for p in here])
        lines.append(f"| {episode} | {success:.3f} | {mean_return:.2f} | {leaves:.1f} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="+", choices=list(CASES))
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for default-CASE.md and .csv")
    options = parser.parse_args()
    for name in options.cases:
        rows, curves = [], []
        for seed in range(options.first, options.first + options.seeds):
            row, curve = run(CASES[name], seed)
            rows.append(row)
            curves += curve
            print(name, row, file=sys.stderr, flush=True)
            text = report(name, rows, curves)
            if options.out is not None:
                (options.out / f"default-{name}.md").write_text(text)
                with (options.out / f"default-{name}.csv").open("w", newline="") as file:
                    writer = csv.DictWriter(file, fieldnames=list(curves[0]))
                    writer.writeheader()
                    writer.writerows(curves)
        print(text)


if __name__ == "__main__":
    main()
