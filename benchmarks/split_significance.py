"""False splits and power of the tests of significance: python benchmarks/split_significance.py

Leaves with 3 attributes and 2 actions, level 0.05; ``--leaves`` sets how many leaves per cell and
``--output`` writes the tables to a file as well.
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from eutree.splitting import (
    KolmogorovSmirnov,
    LeafSample,
    Maximal,
    Naive,
    Permutation,
    SignificanceTest,
)

ALPHA = 0.05
SEED = 20060626
TESTS: dict[str, SignificanceTest] = {
    "naive": Naive(ALPHA),
    "maximal": Maximal(ALPHA),
    "permutation": Permutation(alpha=ALPHA, n_permutations=199),
}
BY_EPISODE: dict[str, SignificanceTest] = {
    "by tuple": Permutation(alpha=ALPHA, n_permutations=199),
    "by episode": Permutation(alpha=ALPHA, n_permutations=199, by_episode=True),
}
Leaf = Callable[[np.random.Generator, int], LeafSample]
EQUAL, MIXED = (20,) * 20, (3,) * 40 + (40,) * 5  # steps of episodes


def noise(generator: np.random.Generator, n: int) -> LeafSample:
    return _leaf(generator, n, generator.normal(size=n))


def rare(generator: np.random.Generator, n: int) -> LeafSample:
    return _leaf(generator, n, (generator.random(n) < 0.05).astype(float))


def shift(generator: np.random.Generator, n: int) -> LeafSample:
    leaf = _leaf(generator, n, generator.normal(size=n))
    return LeafSample(leaf.observations, leaf.returns + (leaf.observations[:, 1] > 0), leaf.actions)


def corner(generator: np.random.Generator, n: int) -> LeafSample:
    """Three tenths of the lowest tenth of an attribute collide, and nothing else does."""
    leaf = _leaf(generator, n, np.zeros(n))
    low = leaf.observations[:, 0] <= np.quantile(leaf.observations[:, 0], 0.1)
    return LeafSample(leaf.observations, -50.0 * (low & (generator.random(n) < 0.3)), leaf.actions)


def mixture(generator: np.random.Generator, n: int) -> LeafSample:
    """The return depends on the action alone, and the action on the observation."""
    x = generator.random((n, 3))
    actions = (generator.random(n) < 0.15 + 0.7 * x[:, 0]).astype(np.int64)
    return LeafSample(x, generator.normal(size=n) + 1.5 * actions, actions)


def _leaf(generator: np.random.Generator, n: int, returns: np.ndarray) -> LeafSample:
    return LeafSample(generator.normal(size=(n, 3)), returns, generator.integers(0, 2, size=n))


def episodes(
    lengths: tuple[int, ...], *, wider: bool, effect: float = 0.0
) -> Callable[[np.random.Generator, int], LeafSample]:
    """Return leaves of whole episodes, each with an observation and a return of its own.

    Args:
        lengths: Steps of the episodes; those of () are drawn, 10 in the mean and 60 at most.
        wider: Whether the spread of an episode's return is a quarter of its length, else 1.
        effect: What a positive observation adds to the return, in spreads.
    """

    def make(generator: np.random.Generator, n: int) -> LeafSample:
        steps = lengths or np.minimum(generator.geometric(0.1, size=n), 60)
        owner = np.repeat(np.arange(len(steps)), steps)
        seen = generator.normal(size=(len(steps), 3))
        spread = np.maximum(np.array(steps) / 4.0, 1.0) if wider else np.ones(len(steps))
        returns = spread * (generator.normal(size=len(steps)) + effect * (seen[:, 1] > 0))
        jitter = 0.01 * generator.normal(size=(owner.size, 4))
        return LeafSample(
            np.ascontiguousarray(seen[owner] + jitter[:, :3]),
            returns[owner] + jitter[:, 3],
            generator.integers(0, 2, size=owner.size),
            owner,
        )

    return make


WHOLE: dict[str, tuple[Leaf, int]] = {
    "noise, 20 episodes of 20 steps": (episodes(EQUAL, wider=False), 20),
    "noise, 40 of 3 steps and 5 of 40": (episodes(MIXED, wider=False), 45),
    "noise, the same, returns of the long ones ten times wider": (episodes(MIXED, wider=True), 45),
    "noise, 40 of any length, the longer the wider": (episodes((), wider=True), 40),
    "returns shifted by 3 spreads, 20 of 20": (episodes(EQUAL, wider=False, effect=3.0), 20),
    "returns shifted by 2 spreads, 40 of any length": (episodes((), wider=False, effect=2.0), 40),
    "the same, the longer the wider": (episodes((), wider=True, effect=2.0), 40),
}


def share(
    test: SignificanceTest, search: KolmogorovSmirnov, make: Leaf, n: int, leaves: int
) -> float:
    """Return the share of leaves in which the best split is accepted."""
    generator = np.random.default_rng((SEED, n))
    accepted = 0
    for _ in range(leaves):
        sample = make(generator, n)
        split = search.best(sample)
        accepted += split is not None and (
            test.p_value(split, sample, search, np.random.default_rng(SEED)) <= test.alpha
        )
    return accepted / leaves


def report(leaves: int) -> Iterator[str]:
    search = KolmogorovSmirnov()
    yield "# False splits and power of the tests of significance\n\n"
    yield f"Made by `python benchmarks/split_significance.py`: {leaves} leaves per cell, 3\n"
    yield f"attributes, 2 actions, level {ALPHA}, seed {SEED}; standard error of a share at the\n"
    yield f"level {np.sqrt(ALPHA * (1 - ALPHA) / leaves):.3f}. Share of leaves that are split:\n\n"
    yield "| leaves | n | naive | maximal | permutation |\n|---|---|---|---|---|\n"
    cases: dict[str, Leaf] = {
        "noise": noise,
        "noise, binary q, 5 % ones": rare,
        "mean of q shifted by one deviation": shift,
        "rare event in one corner": corner,
    }
    for name, make in cases.items():
        for n in (100, 400):
            cells = [f"{share(test, search, make, n, leaves):.3f}" for test in TESTS.values()]
            yield f"| {name} | {n} | {' | '.join(cells)} |\n"
    yield "\nReturns that depend on the action alone, while the action depends on the observation\n"
    yield "(n = 200, maximal test): "
    for compare in ("pooled", "centred", "action"):
        found = share(TESTS["maximal"], KolmogorovSmirnov(compare=compare), mixture, 200, leaves)
        yield f"{compare} {found:.3f}" + (".\n" if compare == "action" else ", ")
    yield "\n## Tuples of one episode\n\n"
    yield "Observation and return are those of the episode: its tuples are one finding, not many.\n"
    yield "Share of leaves that are split:\n\n"
    yield f"| leaves | {' | '.join(BY_EPISODE)} |\n|---|---|---|\n"
    for name, (make, n) in WHOLE.items():
        cells = [f"{share(test, search, make, n, leaves):.3f}" for test in BY_EPISODE.values()]
        yield f"| {name} | {' | '.join(cells)} |\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--leaves", type=int, default=1000)
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    text = []
    for part in report(options.leaves):
        text.append(part)
        print(part, end="", flush=True)
    if options.output:
        options.output.write_text("".join(text))


if __name__ == "__main__":
    main()
