"""Time C4.5 against scikit-learn's CART (criterion="entropy") in paired runs.

Thread CPU time on the same data in the same process; the ratio is the median over the pairs, its
spread the smallest and the largest. Both learners grow on 10 continuous attributes and 5 classes;
C4.5 also prunes. Data: the class is a quintile of x0 + x1 x2 + sin 3 x3, with noise ("mixed") or
without ("clean").

Run: python benchmarks/c45.py [--sizes 10000 100000 1000000] [--pairs 5]
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from eutree import C45Classifier

Data = tuple[np.ndarray, np.ndarray]
N_FEATURES, QUINTILES = 10, (0.2, 0.4, 0.6, 0.8)


def make(n_rows: int, noise: float, seed: int) -> Data:
    """Return observations [n_rows, 10] and classes 0..4."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n_rows, N_FEATURES))
    score = x[:, 0] + x[:, 1] * x[:, 2] + np.sin(3 * x[:, 3]) + noise * rng.normal(size=n_rows)
    return x, np.searchsorted(np.quantile(score, QUINTILES), score)


def seconds(call: Callable[[], object]) -> float:
    """Return the thread CPU time of a call."""
    begin = time.thread_time()
    call()
    return time.thread_time() - begin


def measure(n_rows: int, noise: float, pairs: int) -> dict[str, list[float]]:
    """Return the times of fit and predict of both learners, one entry for each pair."""
    times: dict[str, list[float]] = {"fit": [], "fit peer": [], "predict": [], "predict peer": []}
    for seed in range(pairs):
        observations, classes = make(n_rows, noise, seed)
        fresh, _ = make(n_rows, noise, pairs + seed)
        ours, peer = C45Classifier(), DecisionTreeClassifier(criterion="entropy", random_state=0)
        times["fit peer"].append(seconds(lambda m=peer: m.fit(observations, classes)))  # noqa: B023
        times["fit"].append(seconds(lambda m=ours: m.fit(observations, classes)))  # noqa: B023
        times["predict peer"].append(seconds(lambda m=peer: m.predict(fresh)))  # noqa: B023
        times["predict"].append(seconds(lambda m=ours: m.predict(fresh)))  # noqa: B023
        times.setdefault("leaves", []).append(ours.get_n_leaves())
        times.setdefault("leaves peer", []).append(int(peer.get_n_leaves()))
    return times


def ratio(times: dict[str, list[float]], what: str) -> str:
    """Return the median of the paired ratios, with their range."""
    ratios = [a / b for a, b in zip(times[what], times[f"{what} peer"], strict=True)]
    return f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--pairs", type=int, default=5)
    arguments = parser.parse_args()
    warm, classes = make(1000, 0.5, 0)
    C45Classifier().fit(warm, classes).predict(warm)
    print("| data | rows | pairs | fit [s] | fit / CART | predict [s] | predict / CART | leaves |")
    print("|---|---|---|---|---|---|---|---|")
    for name, noise in (("mixed", 0.5), ("clean", 0.0)):
        fits = []
        for n_rows in arguments.sizes:
            pairs = arguments.pairs if n_rows < 1_000_000 else min(2, arguments.pairs)
            times = measure(n_rows, noise, pairs)
            fits.append(statistics.median(times["fit"]))
            leaves = f"{times['leaves'][0]} (CART {times['leaves peer'][0]})"
            predict = statistics.median(times["predict"])
            print(
                f"| {name} | {n_rows} | {pairs} | {fits[-1]:.3g} | {ratio(times, 'fit')} | "
                f"{predict:.3g} | {ratio(times, 'predict')} | {leaves} |",
                flush=True,
            )
        sizes = arguments.sizes
        if len(sizes) > 1:
            growth = math.log(fits[-1] / fits[0]) / math.log(sizes[-1] / sizes[0])
            print(f"| {name} | exponent of the fit time, {sizes[0]} to {sizes[-1]}: {growth:.2f} |")


if __name__ == "__main__":
    main()
