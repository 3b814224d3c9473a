"""How often contests are wrong, and how often they see a gain that is there.

The incumbent always earns 0, so the return of the challenger is the difference of a pair; all lie
in [-100, 100]. *Level*: it earns as much on average as the incumbent, and should win in 5 % of the
contests at most. *Power*: it earns 2, or 5, more. The rule looks after every pair and gives up as
``Better`` does. Beside it: the rule that is not told the range, and Student's t, looked at as often
as the rule asks for episodes. Then: how good the tree is that ``Halving`` and
``SmallestWithin`` take of many.

Run: python benchmarks/contests.py [--paths 20000] [--most 1000]
"""

import argparse
import math
from collections.abc import Callable, Iterator

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.contests import Better, Halving, SmallestWithin, hold, new_table
from eutree.contests.betting import log_wealth_path
from eutree.contests.rules import BLIND, FIRST, GROWTH, HOPELESS

LIMIT = 100.0
ERROR = 0.05
BATCH = 2000  # paths at once
T_95 = 1.645

Draw = Callable[[np.random.Generator, int, int], Floats]


def normal(generator: np.random.Generator, paths: int, n: int) -> Floats:
    return 20.0 * generator.standard_normal((paths, n))


def skewed(generator: np.random.Generator, paths: int, n: int) -> Floats:
    return 20.0 - generator.exponential(20.0, (paths, n))


def heavy_tailed(generator: np.random.Generator, paths: int, n: int) -> Floats:
    return 5.0 * generator.standard_t(2.0, (paths, n))


def tied(generator: np.random.Generator, paths: int, n: int) -> Floats:
    return 20.0 * generator.choice([-1.0, 0.0, 1.0], (paths, n), p=[0.1, 0.8, 0.1])


def autocorrelated(generator: np.random.Generator, paths: int, n: int) -> Floats:
    noise = 20.0 * math.sqrt(1 - 0.5**2) * generator.standard_normal((paths, n))
    noise[:, 0] /= math.sqrt(1 - 0.5**2)
    for k in range(1, n):
        noise[:, k] += 0.5 * noise[:, k - 1]
    return noise


def rare_loss(generator: np.random.Generator, paths: int, n: int) -> Floats:
    return 0.38 - 95.0 * (generator.random((paths, n)) < 0.004)


DRAWS: dict[str, Draw] = {
    "normal": normal,
    "skewed to losses": skewed,
    "heavy tails (t of 2)": heavy_tailed,
    "four of five tied": tied,
    "autocorrelated (0.5)": autocorrelated,
    "rare loss (95 at 0.004)": rare_loss,
}


def looks(most: int) -> Iterator[int]:
    """Yield after how many pairs the rule asks for more."""
    n = FIRST
    while n < most:
        yield n
        n = math.ceil(GROWTH * n)
    yield most


def hopeless_after(gains: Floats) -> Floats:
    """Return after how many pairs each challenger is given up; more than there are for never."""
    paths, most = gains.shape
    after = np.full(paths, most + 1.0)
    for n in reversed(list(looks(most))):
        now = gains[:, :n]
        mean, error = now.mean(axis=1), now.std(axis=1, ddof=1) / math.sqrt(n)
        gone = mean + HOPELESS * error < 0.0
        if n >= most // 2:
            gone |= mean <= 0.0
        after[gone] = n
    return after


def first_true(found: Booleans) -> Floats:
    """Return the place of the first, from 1, in each row; infinite where there is none."""
    return np.where(found.any(axis=1), found.argmax(axis=1) + 1.0, np.inf)


def known_range(gains: Floats) -> Booleans:
    """Return which challengers win where the range is known: as ``Better``, path by path."""
    shown = first_true(log_wealth_path(gains, 0.0, -2 * LIMIT) >= -math.log(ERROR))
    won: Booleans = shown <= hopeless_after(gains)
    return won & np.isfinite(shown)


def seen_range(gains: Floats) -> Booleans:
    """Return which win where it is not known; it is looked at each time more is asked for."""
    won = np.zeros(len(gains), dtype=bool)
    gone = hopeless_after(gains)
    for n in looks(gains.shape[1]):
        now = gains[:, :n]
        width = np.maximum(now.max(axis=1), 0.0) - np.minimum(now.min(axis=1), 0.0)
        if n < min(BLIND, gains.shape[1]):
            continue
        wealth = log_wealth_path(now, 0.0, -width[:, None])
        enough = wealth >= -math.log(ERROR)
        enough[:, : BLIND - 1] = False
        won |= enough.any(axis=1) & (gone >= n) & (width > 0)
    return won


def student(gains: Floats) -> Booleans:
    """Return which win by Student's t at some look; the rule of a naive user."""
    won = np.zeros(len(gains), dtype=bool)
    for n in looks(gains.shape[1]):
        now = gains[:, :n]
        won |= now.mean(axis=1) > T_95 * now.std(axis=1, ddof=1) / math.sqrt(n)
    return won


def shares(draw: Draw, gain: float, *, paths: int, most: int, seed: int) -> list[float]:
    """Return how often each of the three takes the challenger."""
    generator = np.random.default_rng(seed)
    won = []
    for _ in range(0, paths, BATCH):
        gains = draw(generator, BATCH, most)
        centre = 0.0
        for _ in range(3):  # what lies outside of the limits is cut off; the mean stays 0
            centre -= float(np.clip(gains + centre, -LIMIT, LIMIT).mean())
        gains = np.clip(gains + (centre if draw is heavy_tailed else 0.0) + gain, -LIMIT, LIMIT)
        won.append([rule(gains).mean() for rule in (known_range, seen_range, student)])
    means: list[float] = np.mean(won, axis=0).tolist()
    return means


def check_twins(most: int) -> None:
    """Raise AssertionError unless the vectorised rules decide as the real ones do."""
    gains = np.clip(normal(np.random.default_rng(0), 60, most) + 4.0, -LIMIT, LIMIT)
    for rule, twin in (
        (Better(most=most, known=(-LIMIT, LIMIT)), known_range),
        (Better(most=most), seen_range),
    ):
        own = [
            hold(
                rule,
                new_table(2, most),
                lambda tree, starts, path=path: path[list(starts)] * tree,
            ).winner
            for path in gains
        ]
        assert own == twin(gains).astype(int).tolist(), f"{rule} and its twin differ"


def of_many(runs: int) -> None:
    """Print the winner among 16 trees, each a leaf smaller and by a half worse than the last."""
    means = -np.arange(16.0) / 2
    sizes = tuple(int(size) for size in 20 - np.arange(16))
    rules = {
        "Halving, 512 starts": Halving(most=512),
        "SmallestWithin a standard error, 1,000 starts": SmallestWithin(sizes=sizes),
        "SmallestWithin 4, 1,000 starts": SmallestWithin(
            sizes=sizes, margin=4.0, known=(-LIMIT, LIMIT)
        ),
    }
    print("| rule | mean return of the winner | its leaves | episodes run | beyond 4 |")
    print("|---|---|---|---|---|")
    for name, rule in rules.items():
        found, run = [], 0
        for seed in range(runs):
            generator = np.random.default_rng((3, seed))
            common = generator.normal(0.0, 20.0, 4000)

            def draw(
                tree: int,
                starts: list[int],
                own: np.random.Generator = generator,
                common: Floats = common,
            ) -> Floats:
                returns = means[tree] + common[starts] + own.normal(0.0, 6.0, len(starts))
                return np.clip(returns, -LIMIT, LIMIT)

            table = new_table(16, rule.most)
            found.append(hold(rule, table, draw).winner)
            run += int((~np.isnan(table)).sum())
        winners = np.array(found)
        print(
            f"| {name} | {means[winners].mean():.2f} | {np.array(sizes)[winners].mean():.1f} "
            f"| {run // runs} | {(means[winners] < -4.0).mean():.3f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--paths", type=int, default=20_000)
    parser.add_argument("--most", type=int, default=1_000)
    options = parser.parse_args()
    check_twins(options.most)
    print("| differences | gain | range known | range seen | Student at every look |")
    print("|---|---|---|---|---|")
    for number, (name, draw) in enumerate(DRAWS.items()):
        for gain in (0.0, 2.0, 5.0):
            found = shares(draw, gain, paths=options.paths, most=options.most, seed=number)
            print(f"| {name} | {gain:g} | {' | '.join(f'{x:.3f}' for x in found)} |", flush=True)
    print()
    of_many(options.paths // 200)


if __name__ == "__main__":
    main()
