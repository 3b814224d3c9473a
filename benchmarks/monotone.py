"""Measure what a monotone rule costs a fitted and a learned tree, over five seeds.

Run: python benchmarks/monotone.py; with --learning for learned ones alone
"""

import sys
import time
import warnings

import numpy as np

import eutree
from eutree.envs import experts
from eutree.fitting.fit import fit
from eutree.inspection import verify

TASKS = [
    ("CartPole-v1", "balance", ["right in angle", "right in turn rate"]),
    ("MountainCar-v0", "rock", ["right in velocity"]),
    ("eutree/Evasion2-v0", "gate", ["go in position"]),
]
SEEDS, SHOWN, JUDGED = 5, 6, 20
STEPS, FRESH = 5_000, 50


def holds(policy: eutree.TreePolicy, rules: list[str]) -> bool:
    """Return whether a policy keeps all rules."""
    return all(verify(policy, f"monotone {rule}").holds for rule in rules)


def learning() -> None:
    """Print leaves, return and CPU seconds of trees learned with and without the rules."""
    for task, name, rules in TASKS:
        rows = []
        for seed in range(SEEDS):
            shows = experts.careless(experts.EXPERTS[task][name], 0.2, seed=seed)
            demos = eutree.record(task, shows, episodes=SHOWN, seed=seed)
            rows.append([])
            for kept in ([], rules):
                begun = time.process_time()
                policy = eutree.learn(
                    task, demonstrations=demos, method="planning", steps=STEPS, seed=seed,
                    monotone=kept, judge_episodes=0, front_steps=0, evaluate_every=10**6,
                    evaluation_episodes=1,
                ).policy  # fmt: skip
                spent = time.process_time() - begun
                played = eutree.evaluate(policy, task, episodes=FRESH, seed=10**6)
                rows[-1] += [not holds(policy, rules), policy.n_leaves, played.mean_return, spent]
        figures = " ".join(f"{mean:.2f}" for mean in np.array(rows, dtype=float).mean(axis=0))
        print(f"{task} {rules}: {figures}", flush=True)


def main() -> None:
    """Print a row for each task, with a careful and a careless demonstrator."""
    warnings.simplefilter("ignore")
    if "--learning" in sys.argv:
        learning()
        return
    for task, name, rules in TASKS:
        for share in (0.0, 0.2):
            rows = []
            for seed in range(SEEDS):
                shows = experts.careless(experts.EXPERTS[task][name], share, seed=seed)
                demos = eutree.record(task, shows, episodes=SHOWN, seed=seed)
                trees = [
                    fit(demos, task, episodes=JUDGED, history=0, seed=seed, monotone=kept)
                    for kept in ([], rules)
                ]
                assert holds(trees[1].policy, rules)
                rows.append([float(not holds(trees[0].policy, rules))])
                for one in trees:
                    played = np.nan if one.played is None else one.played.mean_return
                    rows[-1] += [one.policy.n_leaves, one.training_accuracy, played]
            broke, *means = np.array(rows, dtype=float).T
            figures = " ".join(f"{mean.mean():.3f}" for mean in means)
            print(f"{task} {share} {rules} broken {int(broke.sum())} of {SEEDS}: {figures}")


if __name__ == "__main__":
    main()
