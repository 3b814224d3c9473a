"""Measure what runs hand over, and what compression by playing makes of it, in 2-Evasion.

Run: python benchmarks/handover.py runs [--seeds 15] [--first 30000] [--keep DIR]
     python benchmarks/handover.py lines [--seeds 10] [--first 30000]
     python benchmarks/handover.py compress --keep DIR

``runs``: the default learner, 400 episodes, 15 demonstrations of the run's own seed. ``lines``: the
commands of the README's section "From the shell", its 200 episodes, other seeds of the
demonstrations and of the run. ``compress``: the learned trees that ``runs`` kept in DIR, as
``eutree compress`` does it, for each the smallest tree of the front within a point of return, and
the return with 75 % and 60 % of the leaves. Every tree is judged on 5,000 fresh episodes, the same
for all trees of a seed.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.evaluation import Evaluation, mean_interval
from eutree.policies import TreePolicy

ENVIRONMENT = "eutree/Evasion2-v0"
FRESH, EPISODES = 9_000_000, 5000  # seed and episodes of what judges all trees
Row = dict[str, Any]


def fresh(policy: TreePolicy, seed: int) -> Evaluation:
    """Return what a policy does in episodes that chose nothing."""
    return eutree.evaluate(policy, ENVIRONMENT, episodes=EPISODES, seed=FRESH + seed)


def measured(name: str, policy: TreePolicy, seed: int) -> Row:
    """Return the columns of a tree."""
    found = fresh(policy, seed)
    return {
        f"{name} leaves": policy.n_leaves,
        f"{name} success %": 100.0 * (found.success_rate or 0.0),
        f"{name} return": found.mean_return,
    }


def run(seed: int, episodes: int, keep: Path | None) -> Row:
    """Return what a run handed over, and what it had learned."""
    env = gymnasium.make(ENVIRONMENT)
    shown = eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=seed)
    begin = time.process_time()
    result = eutree.learn(env, demonstrations=shown, episodes=episodes, seed=seed)
    seconds = time.process_time() - begin
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        result.learned.save(keep / f"{seed}.json")
    row: Row = {"seed": seed}
    row |= measured("start", result.first, seed)
    row |= measured("learned", result.learned, seed)
    row |= measured("handed over", result.policy, seed)
    counts = result.environment_steps
    return row | {
        "steps": counts.learning,
        "front steps": counts.front,
        "CPU s": seconds,
        "is start": int(result.is_start),
    }


def compressed(path: Path, seed: int) -> Row:
    """Return what compression by playing makes of a tree."""
    policy = TreePolicy.load(path)
    begin = time.process_time()
    small, report = eutree.compress(
        policy, np.empty((0, policy.tree.n_features)), env=ENVIRONMENT, seed=seed
    )
    seconds = time.process_time() - begin
    row: Row = {"seed": seed} | measured("before", policy, seed) | measured("after", small, seed)
    for share in (75, 60):
        most = share * policy.n_leaves / 100
        trees = [one.policy for one in report.front[1:] if one.policy.n_leaves <= most]
        if trees:  # the best of at most so many leaves is the largest of them
            row |= measured(f"{share} %", trees[0], seed)
    return row | {"CPU s": seconds}


def table(rows: list[Row]) -> str:
    """Return the rows, their means with 95 % intervals, and the worst, as a table."""
    names = list(rows[0])
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(_number(row.get(name)) for name in names) + " |" for row in rows]
    means = []
    for name in names[1:]:
        values = np.array([row[name] for row in rows if name in row], dtype=np.float64)
        low, high = mean_interval(values)
        means.append(f"{values.mean():.1f} [{low:.1f}, {high:.1f}]")
    lines.append("| mean | " + " | ".join(means) + " |")
    return "\n".join(lines)


def _number(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.1f}" if isinstance(value, float) else str(value)


def verdict(rows: list[Row]) -> str:
    """Return the figures that the targets name."""
    leaves = np.array([row["handed over leaves"] for row in rows])
    success = np.array([row["handed over success %"] for row in rows])
    start = np.array([row["start success %"] for row in rows])
    returns = np.array([row["handed over return"] for row in rows])
    return (
        f"{leaves.mean():.1f} leaves on average, {leaves.max()} at most; return "
        f"{returns.mean():.1f}; success {success.mean():.2f} % (starts {start.mean():.2f} %), "
        f"{(success - start).min():+.2f} points against its start in the worst run"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", choices=("runs", "lines", "compress"))
    parser.add_argument("--seeds", type=int, default=None)
    parser.add_argument("--first", type=int, default=30_000)
    parser.add_argument("--keep", type=Path, default=None)
    options = parser.parse_args()
    if options.which == "compress":
        paths = sorted(options.keep.glob("*.json"))[: options.seeds]
        tasks: list[Callable[[], Row]] = [
            lambda path=path: compressed(path, int(path.stem))  # type: ignore[misc]
            for path in paths
        ]
    else:
        episodes, usual = (400, 15) if options.which == "runs" else (200, 10)
        seeds = range(options.first, options.first + (options.seeds or usual))
        tasks = [
            lambda seed=seed: run(seed, episodes, options.keep)  # type: ignore[misc]
            for seed in seeds
        ]
    rows = []
    for task in tasks:
        rows.append(task())
        print(rows[-1], flush=True)
    print(table(rows))
    if options.which != "compress":
        print(verdict(rows))


if __name__ == "__main__":
    main()
