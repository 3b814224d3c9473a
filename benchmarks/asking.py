"""What asking is worth: 2-Evasion learned alone and with stretches shown where the tree is unsure.

    python benchmarks/asking.py --seeds 15

The gate demonstrator answers at most 15 requests of at most 20 steps. Control: the same budget
without a criterion, asked in each of the first 15 episodes. Means over seeds with 95 % intervals.
"""

import argparse

import gymnasium
import numpy as np

import eutree
from eutree.evaluation import mean_interval
from eutree.experiments.runs import STARTS
from eutree.learners.confidence import Confidence
from eutree.training import Asking

CASES = (("c-u-tree", "paper", 0), ("eu-tree", "paper", 3), ("c-u-tree", "default", 0),
         ("eu-tree", "default", 3))  # fmt: skip
AT = (40, 100, 200)
NEVER_SURE = Confidence(min_tried=10**9)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--first-seed", type=int, default=0)
    arguments = parser.parse_args()
    env = gymnasium.make("eutree/Evasion2-v0")
    gate = eutree.experts.wait_at_crossing
    askers = (
        ("nobody", None, None),
        ("where unsure", gate(env), Confidence()),
        ("always", gate(env), NEVER_SURE),
    )
    columns = " | ".join(f"return at {episode}" for episode in AT)
    print(f"| learner, preset | demonstrations | asked | steps shown | {columns} |")
    print("|---|---|---|---|" + "---|" * len(AT))
    for learner, preset, n_demos in CASES:
        for name, controller, confidence in askers:
            returns, shown = [], []
            for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
                demos = None
                if n_demos:
                    demos = eutree.record(env, gate, episodes=n_demos, seed=seed)
                result = eutree.learn(
                    env,
                    demonstrations=demos,
                    start=STARTS[learner],
                    method=preset,
                    episodes=AT[-1],
                    seed=seed,
                    evaluation_episodes=200,
                    ask=controller,
                    asking=Asking(max_requests=15, confidence=confidence or Confidence()),
                )
                curve = {point.episode: point.mean_return for point in result.curve}
                returns.append([curve[episode] for episode in AT])
                before = 0 if demos is None else demos.n_transitions
                own = result.history.demonstrated.sum() - (before if learner == "eu-tree" else 0)
                shown.append(own)
            cells = []
            for values in np.transpose(returns):
                low, high = mean_interval(values)
                cells.append(f"{values.mean():.1f} ({low:.1f} to {high:.1f})")
            print(
                f"| {learner}, {preset} | {n_demos} | {name} | {np.mean(shown):.0f} | "
                f"{' | '.join(cells)} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
