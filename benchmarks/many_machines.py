"""What dividing work saves: `learn --runs` beside single runs, two Dask workers beside joblib's.

Run: python benchmarks/many_machines.py [--episodes 60] [--repeats 1] [--out docs/results]

Eight single runs, each a process of its own one after another, against ``eutree learn --runs 8``,
which also plays the selection and the judgement; then the same eight on two Dask workers on
loopback, started before and warmed up, as a cluster is. Every repeat does all three in turn; the
page shows the least wall time of each, and CPU seconds, which other programs on the machine do not
lengthen. It says how busy the machine was.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

RUNS = 8
LINE = ("learn", "eutree/Evasion2-v0", "--evaluation-episodes", "20")


@dataclass(frozen=True)
class Spent:
    """Seconds of the clock, and of the processors where these are known."""

    wall: float
    cpu: float


def eutree(*words: str, folder: Path) -> None:
    command = [sys.executable, "-m", "eutree", *words]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def spent_on(*lines: tuple[str, ...], folder: Path) -> Spent:
    """Return what some command lines cost, one after another."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    for line in lines:
        eutree(*line, folder=folder)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(wall, cpu)


@contextmanager
def dask_workers(folder: Path, count: int = 2) -> Iterator[str]:
    """Run a scheduler and workers on loopback; yield the file that says where."""
    dask, quiet = [sys.executable, "-m", "dask"], {"stdout": subprocess.DEVNULL,
                                                   "stderr": subprocess.DEVNULL}  # fmt: skip
    file = str(folder / "scheduler.json")
    here = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", file]
    workers = ["worker", "--nworkers", str(count), "--nthreads", "1", *here]
    processes = [
        subprocess.Popen([*dask, "scheduler", "--port", "0", *here], cwd=folder, **quiet),
        subprocess.Popen([*dask, *workers], cwd=folder, **quiet),
    ]
    try:
        yield file
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(timeout=60)


def measure(episodes: int) -> dict[str, Spent]:
    """Return what each way costs once."""
    line = (*LINE, "--episodes", str(episodes))
    many = (*line, "--runs", str(RUNS), "--n-jobs", "2")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        singles = [(*line, "--seed", str(seed), "--out", f"one{seed}") for seed in range(RUNS)]
        found = {"single": spent_on(*singles, folder=folder)}
        found["joblib"] = spent_on((*many, "--out", "joblib"), folder=folder)
        with dask_workers(folder) as file:
            dask = ("--backend", "dask", "--address", file)
            eutree(*LINE, "--episodes", "2", "--runs", "2", "--out", "warm", *dask, folder=folder)
            found["dask"] = spent_on((*many, "--out", "dask", *dask), folder=folder)
    return found


def page(episodes: int, repeats: list[dict[str, Spent]], load: tuple[float, float]) -> str:
    best = {way: min(one[way].wall for one in repeats) for way in repeats[0]}
    cpu = {way: min(one[way].cpu for one in repeats) for way in repeats[0]}
    titles = {
        "single": "eight single runs, one after another",
        "joblib": "`--runs 8 --n-jobs 2`",
        "dask": "the same on two Dask workers on loopback",
    }
    rows = [
        f"| {titles[way]} | {best[way]:.1f} | {best[way] / best['single']:.2f} | "
        + (f"{cpu[way]:.1f} |" if way != "dask" else "in the workers |")
        for way in titles
    ]
    return "\n".join([
        "# Dividing runs among processes and workers",
        "",
        f"Made by `python benchmarks/many_machines.py --episodes {episodes} --repeats "
        f"{len(repeats)}`: 2-Evasion, the default method, seeds 0 to 7, {os.cpu_count()} cores; "
        f"load average {load[0]:.1f} at the beginning, {load[1]:.1f} at the end (about 2 is this "
        "program's own).",
        "",
        "| way | seconds | of eight single runs | CPU seconds |",
        "|---|---|---|---|",
        *rows,
        "",
        f"Dask took {best['dask'] / best['joblib']:.2f} of joblib's time. `--runs` includes 200 "
        "episodes that choose among the runs and 1,000 that judge the winner, which single runs do "
        "not play; asked for are at most 0.6 of eight single runs, and at most 1.15 of joblib's "
        "time. Where other programs keep the cores busy, two processes get a larger share of them "
        "than one, which lowers the ratios of wall times. CPU seconds do not change by that; they "
        "are of a command and of the processes that it waited for. Runs this short spend much of "
        "their time on starting Python, which eight single runs do eight times.",
        "",
    ])  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=60)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    begin = os.getloadavg()[0]
    repeats = [measure(arguments.episodes) for _ in range(arguments.repeats)]
    text = page(arguments.episodes, repeats, (begin, os.getloadavg()[0]))
    print(text)
    if arguments.out is not None:
        (arguments.out / "many-machines.md").write_text(text)


if __name__ == "__main__":
    main()
