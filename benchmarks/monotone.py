"""Measure what a monotone rule costs a fitted tree: leaves, agreement, return, over five seeds.

Run: python benchmarks/monotone.py
"""

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


def holds(policy: eutree.TreePolicy, rules: list[str]) -> bool:
    """Return whether a policy keeps all rules."""
    return all(verify(policy, f"monotone {rule}").holds for rule in rules)


def main() -> None:
    """Print a row for each task, with a careful and a careless demonstrator."""
    warnings.simplefilter("ignore")
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
