"""Is the advice of `eutree demos stats` right? Foretold against true gains of five more episodes.

    python benchmarks/demonstrations_needed.py --seeds 20

For each seed, 10, 15 and 30 demonstrations of 2-Evasion by the gate demonstrator with 5 % random
actions; the gain that ``expert_curve`` foretells for five more; and the gain that trees of n and
n + 5 such episodes show on 100 further episodes. Agreement is counted where the true mean gain is
in the interval foretold.
"""

import argparse

import gymnasium
import numpy as np

import eutree
from eutree.data import Demonstrations
from eutree.evaluation import mean_interval
from eutree.evaluation.expert_curve import expert_curve

N_TEST = 100


def accuracy(episodes, test, demonstrations):
    part = Demonstrations(tuple(episodes), demonstrations.schema)
    tree = eutree.fit_expert_tree(part)
    chosen = [tree.actions[tree.tree.leaf_index(e.observations[:-1])] == e.actions for e in test]
    return np.mean([hits.mean() for hits in chosen])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    arguments = parser.parse_args()
    env = gymnasium.make("eutree/Evasion2-v0")
    print("| episodes | gain foretold | its interval, mean | true gain | 95 % interval |")
    print("|---|---|---|---|---|")
    for n in (10, 15, 30):
        foretold, true = [], []
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
            hands = eutree.experts.careless(eutree.experts.wait_at_crossing, 0.05, seed=seed)
            all_of = eutree.record(env, hands, episodes=n + 5 + N_TEST, seed=seed)
            head, test = all_of.episodes[:n], all_of.episodes[n + 5 :]
            curve = expert_curve(Demonstrations(head, all_of.schema))
            assert curve is not None
            foretold.append((curve.gain, *curve.gain_interval))
            more = all_of.episodes[: n + 5]
            true.append(accuracy(more, test, all_of) - accuracy(head, test, all_of))
        gain, low, high = 100 * np.mean(foretold, axis=0)
        interval = [100 * end for end in mean_interval(true)]
        print(
            f"| {n} | {gain:.1f} | {low:.1f} to {high:.1f} | {100 * np.mean(true):.1f} | "
            f"{interval[0]:.1f} to {interval[1]:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
