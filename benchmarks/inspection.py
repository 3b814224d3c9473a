"""Time exact comparison and verification of random trees of 200 leaves over 8 features.

Thread CPU time, the median and the largest over pairs of trees.

Run: python benchmarks/inspection.py [--pairs 5]
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from eutree import DecisionTree, Feature, Schema, TreePolicy, diff, verify, why

N_LEAVES, N_FEATURES = 200, 8


def random_policy(seed: int) -> TreePolicy:
    """Return a policy whose every leaf holds observations, actions drawn at random."""
    generator = np.random.default_rng(seed)
    tree = DecisionTree.single_leaf(N_FEATURES)
    low, high = [np.zeros(N_FEATURES)], [np.ones(N_FEATURES)]
    while tree.n_leaves < N_LEAVES:
        leaf, feature = int(generator.integers(tree.n_leaves)), int(generator.integers(N_FEATURES))
        cut = float(generator.uniform(low[leaf][feature], high[leaf][feature]))
        tree = tree.split(leaf, feature, cut)
        low.append(low[leaf].copy())
        high.append(high[leaf].copy())
        high[leaf][feature] = low[-1][feature] = cut
    names = tuple(Feature(f"x{number}", "", 0.0, 1.0) for number in range(N_FEATURES))
    return TreePolicy(tree, generator.integers(0, 2, N_LEAVES), Schema(names, ("stop", "go")))


def seconds(call: Callable[[], object]) -> float:
    """Return the thread CPU time of a call."""
    begin = time.thread_time()
    call()
    return time.thread_time() - begin


def main() -> None:
    """Print one line for each question."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=5)
    pairs = parser.parse_args().pairs
    questions: dict[str, Callable[[TreePolicy, TreePolicy], object]] = {
        "diff": diff,
        "verify never": lambda one, _: verify(one, "never go when x0 > 0.5 and x1 <= 0.5"),
        "verify monotone": lambda one, _: verify(one, "monotone go in x0"),
        "why": lambda one, _: why(one, np.full(N_FEATURES, 0.5)),
    }
    diff(random_policy(0), random_policy(1))
    print("| question | median [s] | largest [s] |\n|---|---|---|")
    for name, ask in questions.items():
        times = []
        for seed in range(pairs):
            one, two = random_policy(2 * seed), random_policy(2 * seed + 1)
            times.append(seconds(lambda: ask(one, two)))  # noqa: B023
        print(f"| {name} | {statistics.median(times):.3f} | {max(times):.3f} |")


if __name__ == "__main__":
    main()
