"""What one call of the u-tree's learner costs, by how many transitions it has stored.

    python benchmarks/learner_calls.py [--stored 10000 100000]

The learner starts from so many recorded transitions of 2-Evasion and splits until no leaf is due.
Then the same episodes are lived through several times, each taken back at its end, and stored once
more. Every call is timed by itself; the least of its repeats counts, which another process on the
machine disturbs least. Run it with PYTHONPATH at two checkouts to compare them.
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from benchmarks.learner import many_episodes

from eutree.learners import CORRECTED, Problem, Start, Step
from eutree.splitting import Maximal

EPISODES, REPEATS = 40, 8
METHOD = replace(CORRECTED, significance=Maximal())


def calls(stored: int) -> dict[str, float]:
    """Return microseconds of each call, and the leaves of the tree."""
    recorded = many_episodes(stored)
    learner = METHOD.start(Problem(recorded.schema), Start(episodes=recorded.episodes))
    generator = np.random.default_rng(0)
    while learner.update(generator).splits:
        pass
    lived = [
        (e.observations[0], [
            Step(int(a), float(r), o, e.terminated and t == len(e) - 1, False)
            for t, (a, r, o) in enumerate(
                zip(e.actions, e.rewards, e.observations[1:], strict=True))
        ])
        for e in recorded.episodes[-EPISODES:]
    ]  # fmt: skip
    least = np.min([one_round(learner, lived, generator) for _ in range(REPEATS)], axis=0)
    ends = np.min([stored_again(learner, lived, generator) for _ in range(REPEATS)], axis=0)
    n_steps = np.array([len(steps) for _, steps in lived])
    begins = np.cumsum(1 + 2 * n_steps) - (1 + 2 * n_steps)
    inside = np.delete(least, begins)
    parts = {
        "start_episode": least[begins].mean(),
        "act": inside[::2].mean(),
        "observe": inside[1::2].mean(),
        "end_episode": ends.mean(),
    }
    micro = {name: 1e6 * float(seconds) for name, seconds in parts.items()}
    once = (micro["start_episode"] + micro["end_episode"]) / float(n_steps.mean())
    return micro | {
        "a step": micro["act"] + micro["observe"] + once,
        "leaves": learner.tree.n_leaves,
    }


def one_round(learner, lived, generator) -> np.ndarray:
    """Live through the episodes and take them back; return the seconds of each call."""
    spent, clock = [], time.perf_counter
    for first, steps in lived:
        begin = clock()
        learner.start_episode(first, generator)
        spent.append(clock() - begin)
        for step in steps:
            begin = clock()
            learner.act()
            middle = clock()
            learner.observe(step)
            spent += [middle - begin, clock() - middle]
        learner.discard_episode()
    return np.array(spent)


def stored_again(learner, lived, generator) -> np.ndarray:
    """Live through the episodes and store them; return the seconds of each ``end_episode``."""
    spent, clock = [], time.perf_counter
    for first, steps in lived:
        learner.start_episode(first, generator)
        for step in steps:
            learner.observe(step)
        begin = clock()
        learner.end_episode()
        spent.append(clock() - begin)
    return np.array(spent)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stored", type=int, nargs="+", default=[10_000, 100_000])
    for stored in parser.parse_args().stored:
        row = {name: f"{value:.2f}" for name, value in calls(stored).items()}
        print(f"| {stored:,} | " + " | ".join(row.values()) + " |", flush=True)


if __name__ == "__main__":
    main()
