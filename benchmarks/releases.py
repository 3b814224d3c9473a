"""Compare what is learned now with what earlier releases learned, on a small fixed part.

Run: python -m benchmarks.releases [--keep] [--tasks TASK ...] [--processes 2]
     python -m benchmarks.releases --page

Twenty runs of the table, four seeds of five tasks, and twelve that begin from nothing
(``benchmarks/from_nothing.py``), under ten minutes on two cores (``make table-smoke``). Each task's
returns are compared with those of the last release that has any: the
probability of improvement is the share of all pairs, a run of now and a run of then, in which that
of now earns more; ties count half (Agarwal and others, 2021, section 4.3). Its interval is that of
2,000 bootstrap samples of the runs of both. The exit status is the number of tasks that are worse.
``--keep`` stores the rows, as ``docs/results/releases/NUMBER-VERSION-COMMIT.csv``, and renews the
page, which ``--page`` does alone.
"""

import argparse
import multiprocessing
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks import from_nothing
from benchmarks.table import FIRST, ROOT, Cell, commit, keep, measured, rows_of

import eutree

HOME = ROOT / "docs" / "results" / "releases"
PARTS = (
    ("MountainCar-v0", 50_000, 8),
    ("CartPole-v1", 50_000, 4),
    ("eutree/Evasion2-v0", 10_000, 16),
    ("Acrobot-v1", 50_000, 8),
    ("Pendulum-v1", 50_000, 8),
)
FROM_NOTHING = ("CartPole-v1", "Acrobot-v1", "eutree/Evasion3-v0")
SHOWN_NOTHING = "{}, from nothing"  # what such a task is called in rows
SEEDS, SAMPLES = 4, 2000
WORSE, LARGER = 0.25, 3.0  # a probability below, or mean leaves so many above, is a warning

Rows = Sequence[dict[str, Any]]


def stored() -> list[Path]:
    return sorted(HOME.glob("*.csv"))


def column(rows: Rows, task: str, name: str) -> np.ndarray:
    return np.array([float(row[name]) for row in rows if row["task"] == task])


def probability(now: np.ndarray, then: np.ndarray) -> float:
    """Return the share of pairs in which the one of now is larger; ties count half."""
    difference = np.sign(now[:, None] - then[None, :])
    return float(np.mean(difference + 1.0) / 2.0)


def interval(now: np.ndarray, then: np.ndarray) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the probability of improvement."""
    rng = np.random.default_rng(0)
    samples = [
        probability(rng.choice(now, now.size), rng.choice(then, then.size)) for _ in range(SAMPLES)
    ]
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(low), float(high)


def is_worse(now: Rows, then: Rows, task: str) -> bool:
    """Return whether a task's trees earn less than then, or are larger."""
    returns, leaves = (
        [column(rows, task, name) for rows in (now, then)] for name in ("return", "has_leaves")
    )
    grown = leaves[0].mean() > leaves[1].mean() + LARGER
    return bool(grown or probability(*returns) < WORSE)


def line(now: Rows, then: Rows, task: str) -> str:
    """Return a row of the page: a task now and then."""
    returns = [column(rows, task, "return") for rows in (now, then)]
    leaves = [column(rows, task, "has_leaves").mean() for rows in (now, then)]
    low, high = interval(*returns)
    file = next(row["file"] for row in then if row["task"] == task)
    return (
        f"| {task} | {file}: {returns[1].mean():.1f}, {leaves[1]:.1f} leaves | "
        f"{returns[0].mean():.1f}, "
        f"{leaves[0]:.1f} leaves | {probability(*returns):.2f} [{low:.2f}, {high:.2f}] | "
        f"{'**worse**' if is_worse(now, then, task) else ''} |"
    )


def latest(files: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the rows of each task from the last of the files that has any; each names its file."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for file in files:
        stored_rows = [row | {"file": file.stem} for row in rows_of(file)]
        for task in {row["task"] for row in stored_rows}:
            rows[task] = [row for row in stored_rows if row["task"] == task]
    return [row for of_task in rows.values() for row in of_task]


def tasks_of(now: Rows, then: Rows) -> list[str]:
    both = {row["task"] for row in now} & {row["task"] for row in then}
    names = [task for task, *_ in PARTS] + [*map(SHOWN_NOTHING.format, FROM_NOTHING)]
    return [name for name in names if name in both]


def page() -> str:
    """Return the page: each release beside those before it, the latest first."""
    lines = [HEAD]
    files = stored()
    for place in range(len(files) - 1, 0, -1):
        now, then = rows_of(files[place]), latest(files[:place])
        lines += ["", f"## {files[place].stem}", "", TITLES]
        lines += [line(now, then, task) for task in tasks_of(now, then)]
    return "\n".join(lines) + "\n"


def run(tasks: Sequence[str], processes: int) -> list[dict[str, Any]]:
    """Return the rows of the fixed part."""
    cells = [
        Cell("eutree", task, steps, leaves, seed)
        for task, steps, leaves in PARTS if not tasks or task in tasks
        for seed in range(FIRST, FIRST + SEEDS)
    ]  # fmt: skip
    nothing = [
        (task, seed)
        for task in FROM_NOTHING if not tasks or task in tasks
        for seed in range(FIRST, FIRST + SEEDS)
    ]  # fmt: skip
    # A process for each run: the peak of its memory is that of all that it ran before.
    with multiprocessing.get_context("spawn").Pool(processes, maxtasksperchild=1) as pool:
        rows = pool.starmap(measured, [(cell, None, None) for cell in cells], chunksize=1)
        others = pool.starmap(from_nothing.measured, nothing, chunksize=1)
    return rows + [row | {"task": SHOWN_NOTHING.format(row["task"])} for row in others]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--page", action="store_true")
    parser.add_argument("--tasks", nargs="+", default=[])
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    worse = 0
    if not arguments.page:
        files, now = stored(), run(arguments.tasks, arguments.processes)
        if files:
            then = latest(files)
            print(TITLES, *(line(now, then, one) for one in tasks_of(now, then)), sep="\n")
            worse = sum(is_worse(now, then, one) for one in tasks_of(now, then))
        if arguments.keep:
            name = f"{len(files) + 1:03}-{eutree.__version__}-{commit()}.csv"
            for row in now:
                keep(row, HOME / name)
    if arguments.page or arguments.keep:
        (HOME.parent / "between-releases.md").write_text(page())
    raise SystemExit(worse)


TITLES = """\
| task | before | after | probability of improvement [95 %] | |
|---|---|---|---|---|"""
HEAD = """\
# Between releases

A default that grows worse, or larger, is to be seen by the next change and not by a user. `make
table-smoke` runs twenty runs of [the table](table.md), the same four seeds of five tasks, and since
006 twelve that begin [from nothing](from-nothing.md), and sets them beside those of the last
release that has the task (`ARGS=--keep` stores them, a file each in `docs/results/releases/`). The
probability of improvement is the share of all pairs, a run of the one and a run of the other, in
which the later one earns more; ties count half; the interval is bootstrapped over runs. With four
runs each it is wide: what is certain here is only a large change. A task is **worse** where the
probability is below 0.25, or the trees have three leaves more."""


if __name__ == "__main__":
    main()
