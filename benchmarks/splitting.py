"""Cost of the exact best split: python benchmarks/splitting.py [--quick] [--output FILE]

Every figure is a ratio of thread CPU times measured in turn in one process: to the fit of
scikit-learn's ``DecisionTreeRegressor(max_depth=1)`` on the same data (4 attributes, minimum side
10), to the noise case of the same score, or to calling ``scipy.stats.ks_2samp`` at every cut.
"""

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from scipy import stats
from sklearn.tree import DecisionTreeRegressor
from tests.splitting.samples import adversarial_returns

from eutree.splitting import best_split

SIZES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
KINDS = ("noise", "step", "mixed")
SCORES = ("scaled", "distance")
FIRST_SPLIT = """
import numpy as np
from eutree.splitting import best_split
generator = np.random.default_rng(0)
best_split(generator.normal(size=(1000, 4)), generator.normal(size=1000))
"""


def cpu(call: Callable[[], object]) -> float:
    start = time.thread_time()
    call()
    return time.thread_time() - start


def sample(kind: str, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (x, q): pure noise, a step of one standard deviation, or tied and mixed attributes."""
    generator = np.random.default_rng(seed)
    x, q = generator.normal(size=(n, 4)), generator.normal(size=n)
    if kind == "step":
        q += x[:, 1] > 0.3
    if kind == "mixed":
        x[:, 0], x[:, 1] = generator.random(n), np.round(20 * generator.random(n))
        x[:, 2] = generator.integers(0, 3, size=n)
        q = np.where(generator.random(n) < 0.7, 0.0, np.round(q, 1)) + (x[:, 0] > 0.6)
    return x, q


def compare_with_cart(n: int, kind: str, repeats: int) -> dict[str, float]:
    """Return median milliseconds of the fit and of both scores, and median paired ratios."""
    times = []
    for seed in range(repeats):
        x, q = sample(kind, n, seed)
        fit = cpu(lambda x=x, q=q: DecisionTreeRegressor(max_depth=1).fit(x, q))
        ours = [cpu(lambda x=x, q=q, s=s: best_split(x, q, score=s)) for s in SCORES]
        times.append([fit, *ours])
    times = np.array(times)
    row = dict(zip(("fit", *SCORES), 1e3 * np.median(times, axis=0), strict=True))
    for k, score in enumerate(SCORES, start=1):
        row[f"{score} / fit"] = float(np.median(times[:, k] / times[:, 0]))
    return row


def search_alone(x: np.ndarray, q: np.ndarray, score: str) -> float:
    """Return the seconds of a search without those of sorting: a search of a single cut."""
    whole = cpu(lambda: best_split(x, q, score=score))
    return whole - cpu(lambda: best_split(x, q, min_leaf=q.size // 2))


def adversarial(n: int, repeats: int) -> Iterator[tuple[str, str, float, float]]:
    """Yield (score, case, milliseconds, ratio to noise) of one attribute."""
    x = np.arange(n, dtype=float)[:, None]
    for score in SCORES:
        noises = [np.random.default_rng(seed).normal(size=n) for seed in range(2 * repeats)]
        noise = float(np.median([search_alone(x, q, score) for q in noises]))
        for name, q in adversarial_returns(n):
            cost = float(np.median([search_alone(x, q, score) for _ in range(repeats)]))
            cost = noise if name == "noise" else max(cost, 0.0)
            yield score, name, 1e3 * cost, cost / noise


def against_a_loop(n: int) -> float:
    """Return how many times faster the search is than ks_2samp at every cut (50 cuts timed)."""
    x, q = sample("noise", n, 0)
    ordered = q[np.argsort(x[:, 0])]
    cuts = np.linspace(10, n - 10, 50).astype(int)
    stats.ks_2samp(ordered[:10], ordered[10:], method="asymp")
    loop = cpu(lambda: [stats.ks_2samp(ordered[:i], ordered[i:], method="asymp") for i in cuts])
    ours = np.median([cpu(lambda: best_split(x, q)) for _ in range(20)])
    return loop / cuts.size * (n - 19) * x.shape[1] / ours


def first_split(folder: str) -> tuple[float, float]:
    """Return (wall, CPU) seconds of a new process that imports the package and splits once."""
    before, start = os.times(), time.perf_counter()
    environment = os.environ | {"NUMBA_CACHE_DIR": folder}
    subprocess.run([sys.executable, "-c", FIRST_SPLIT], check=True, env=environment)
    after = os.times()
    used = after.children_user + after.children_system
    return time.perf_counter() - start, used - before.children_user - before.children_system


def report(quick: bool) -> Iterator[str]:
    sizes = SIZES[:3] if quick else SIZES
    yield "# Speed of the exact split\n"
    yield f"Made by `python benchmarks/splitting.py{' --quick' if quick else ''}`;"
    yield f"\n{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
    yield f"numpy {np.__version__}. Milliseconds are medians of thread CPU time; ratios are\n"
    yield "medians of paired runs and are what to compare.\n\n"
    yield "| data | n | stump fit, ms | scaled, ms | distance, ms | scaled / fit | "
    yield "distance / fit |\n"
    yield "|---|---|---|---|---|---|---|\n"
    best_split(*sample("noise", 500, 0))
    growth = {}
    for kind in KINDS:
        for n in sizes:
            row = compare_with_cart(n, kind, 15 if n <= 30_000 else 7 if n <= 100_000 else 3)
            growth[kind, n] = row
            yield f"| {kind} | {n:,} | {row['fit']:.2f} | {row['scaled']:.2f} | "
            yield f"{row['distance']:.2f} | {row['scaled / fit']:.2f} | "
            yield f"{row['distance / fit']:.2f} |\n"
    yield "\nGrowth from 3,000 tuples to the largest size, as an exponent of n:\n\n"
    for kind in KINDS:
        first, last = growth[kind, 3_000], growth[kind, sizes[-1]]
        exponents = (np.log(last[s] / first[s]) / np.log(sizes[-1] / 3_000) for s in SCORES)
        yield f"- {kind}: " + ", ".join(
            f"{s} {e:.2f}" for s, e in zip(SCORES, exponents, strict=True)
        )
        yield "\n"
    n = 10_000 if quick else 100_000
    yield f"\nSearch of one attribute without sorting, n = {n:,}, against the noise case:\n\n"
    yield "| score | case | ms | ratio to noise |\n|---|---|---|---|\n"
    for score, name, cost, ratio in adversarial(n, 5):
        yield f"| {score} | {name} | {cost:.2f} | {ratio:.2f} |\n"
    yield "\n`scipy.stats.ks_2samp` at every cut of 4 attributes (extrapolated from 50 cuts of "
    yield f"one):\nthe search is {against_a_loop(1_000):,.0f} times faster at n = 1,000"
    yield "" if quick else f", {against_a_loop(10_000):,.0f} times at n = 10,000"
    yield ".\n\nImport and first split of a new process, seconds (wall, CPU):\n\n"
    with tempfile.TemporaryDirectory() as folder:
        for state in ("nothing compiled yet", "compiled before"):
            wall, used = first_split(folder)
            yield f"- {state}: {wall:.1f}, {used:.1f}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small sizes only")
    parser.add_argument("--output", type=Path, help="write the report there too")
    options = parser.parse_args()
    text = []
    for part in report(options.quick):
        text.append(part)
        print(part, end="", flush=True)
    if options.output:
        options.output.write_text("".join(text))


if __name__ == "__main__":
    main()
