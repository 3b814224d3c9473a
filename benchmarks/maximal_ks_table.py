"""Make src/eutree/splitting/_maximal_ks_table.py: python benchmarks/maximal_ks_table.py

Simulates the largest scaled two-sample Kolmogorov-Smirnov statistic over all cuts of a random
permutation. ``--scale 0.1`` makes a rougher table in a tenth of the time.
"""

import argparse
import math
from pathlib import Path

import numpy as np

from eutree.splitting import _kernels

SEED = 20060626
SIZES = (10, 14, 20, 30, 50, 70, 100, 150, 200, 300, 500, 1000, 2000, 5000, 10_000, 30_000, 100_000)
TAILS = (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
TARGET = Path(__file__).parents[1] / "src/eutree/splitting/_maximal_ks_table.py"


def replicates(n: int, scale: float) -> int:
    return int(scale * max(20_000, min(200_000, 50_000_000 // n)))


def simulate(n: int, share: float, count: int, generator: np.random.Generator) -> np.ndarray:
    """Return ``count`` draws of the maximum of K, in increasing order."""
    side = max(1, math.ceil(share * n))
    legal = np.ones(n, dtype=np.bool_)
    cumulative = np.arange(1.0, n + 1.0)
    values = np.empty(count)
    for k in range(count):
        rank = generator.permutation(n).astype(np.int32)
        _, _, score = _kernels.best_cut(
            rank, legal, cumulative, side, False, 0.0, 0, _kernels.BRUTE
        )
        values[k] = math.sqrt(score / n)
    return np.sort(values)


def upper_quantiles(values: np.ndarray) -> tuple[float, ...]:
    """Return for each tail the smallest value v with share(values >= v) <= tail."""
    beyond = np.searchsorted(values, values, side="left")  # values[k:] reach values[k]
    share = (values.size - beyond) / values.size
    found = []
    for tail in TAILS:
        fits = np.flatnonzero(share <= tail)
        value = values[fits[0]] if fits.size else values[-1] * (1 + 1e-9)
        found.append(max(float(value), found[-1] + 1e-4) if found else float(value))
    return tuple(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--output", type=Path, default=TARGET)
    options = parser.parse_args()
    lines = [
        '"""Upper quantiles of the maximal scaled KS statistic; made by '
        'benchmarks/maximal_ks_table.py."""',
        "",
        f"SIZES = {SIZES!r}",
        f"TAILS = {TAILS!r}",
    ]
    for name, share in (("VALUES", 0.0), ("VALUES_SHARE_10", 0.1)):
        lines += ["", f"{name} = ("]
        for n, seed in zip(SIZES, np.random.SeedSequence(SEED).spawn(len(SIZES)), strict=True):
            values = simulate(n, share, replicates(n, options.scale), np.random.default_rng(seed))
            row = ", ".join(f"{value:.4f}" for value in upper_quantiles(values))
            lines.append(f"    ({row}),  # n = {n}")
            print(name, lines[-1].strip(), flush=True)
        lines.append(")")
    options.output.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
