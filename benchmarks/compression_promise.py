"""How often the race of ``compress(margin=...)`` takes a tree that it promises not to take.

A tree earns as much as its input, but for a loss of 100 with probability p in each episode. The
margin is 0.8 of what that costs on average, so the tree must not be taken, in 5 % of the races at
most. Beside it: Student's interval on as many fresh episodes, which the first release used; and how
often a tree without any loss is taken, where the margin is 2.

Run: python benchmarks/compression_promise.py [--runs 1000]
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eutree.arrays import Floats
from eutree.compression.episodes import Demand
from eutree.contests import SmallestWithin, hold, new_table
from eutree.evaluation import mean_interval

LOSS = 100.0
CHANCES = (1e-4, 5e-4, 1e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1)
ERROR = 0.05


def taken(p: float, rule: SmallestWithin, runs: int, noise: float) -> float:
    """Return the share of contests in which the tree is taken."""
    generator = np.random.default_rng(11)
    won = 0
    for _ in range(runs):
        inputs = noise * generator.random(rule.most)  # returns of the input

        def run(tree: int, starts: Sequence[int], inputs: Floats = inputs) -> Floats:
            losses = LOSS * (generator.random(len(starts)) < p)
            return inputs[starts] - tree * losses

        won += hold(rule, new_table(2, rule.most), run).winner
    return won / runs


def by_student(p: float, margin: float, episodes: int, runs: int) -> float:
    """Return the share of confirmations that Student's interval lets pass."""
    generator = np.random.default_rng(12)
    losses = -LOSS * (generator.random((runs, episodes)) < p)
    lows = [mean_interval(row, confidence=1 - 2 * ERROR).low for row in losses]
    return float(np.mean(np.array(lows) >= -margin))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=1000)
    runs = parser.parse_args().runs
    print("| p | margin | episodes | taken: range known | taken: range seen | Student's interval |")
    print("|---|---|---|---|---|---|")
    for p in CHANCES:
        for episodes in (200, 1000):
            margin = 0.8 * p * LOSS
            seen = SmallestWithin(sizes=(2, 1), margin=margin, error=ERROR, episodes=episodes)
            known = replace(seen, known=(-LOSS, 10.0))
            width = Demand(margin=margin, error=ERROR, episodes=episodes).blind_width
            print(
                f"| {p:g} | {margin:g} | {episodes} | {taken(p, known, runs, 10.0):.3f} "
                f"| {taken(p, seen, runs, 10.0):.3f}{'' if width >= LOSS else ' *'} "
                f"| {by_student(p, margin, episodes, runs):.3f} |",
                flush=True,
            )
    print()
    print("| p | taken: margin 2, 1,000 episodes, range known |")
    print("|---|---|")
    for p in (0.0, *CHANCES[:4]):
        rule = SmallestWithin(sizes=(2, 1), margin=2.0, error=ERROR, known=(-LOSS, 10.0))
        print(f"| {p:g} | {taken(p, rule, runs // 5, 10.0):.3f} |", flush=True)


if __name__ == "__main__":
    main()
