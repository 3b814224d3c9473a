"""Compress the state trees that learning produces, in every mode, and evaluate them.

For both Evasion domains and each seed an EU-Tree is learned from 15 scripted demonstrations, in the
paper's settings. Every tree is compressed in every mode on the observations that its run stored,
and evaluated before and after on the same 1,000 fresh episodes. Learned trees are kept in a
folder, so that a second call only compresses.

Run: python benchmarks/compression.py [--runs 15] [--episodes 400] [--trees build/compression]
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from eutree import TreePolicy, evaluate, fit_expert_tree, learn, record
from eutree.c45 import C45Settings, grow
from eutree.compression import RealEpisodes
from eutree.compression.compressing import compress, observation_box
from eutree.envs.experts import experts_for
from eutree.interaction.making import make
from eutree.trees.boxes import disagreement
from eutree_lab.statistics import bootstrap

DOMAINS = {"2-Evasion": "eutree/Evasion2-v0", "3-Evasion": "eutree/Evasion3-v0"}
MARGIN = 2.0  # two stops in an episode; a collision costs 50
WAYS: dict[str, dict[str, Any]] = {
    "exact merge": {"mode": "merge"},
    "the paper's: C4.5 unpruned": {},
    "C4.5 without its limits": {},
    "auto": {"mode": "auto"},
    "auto, rounded": {"mode": "auto", "round_thresholds": True},
    "budget of 1 %": {"max_disagreement": 0.01},
    "budget of 1 %, by Q-gap": {"max_disagreement": 0.01, "weights": "q-gap"},
    "margin of return": {},
}
ALONE = {
    "the paper's: C4.5 unpruned": C45Settings.unpruned(),
    "C4.5 without its limits": C45Settings.lossless(),
}
EVALUATION_EPISODES = 1000


@dataclass(frozen=True)
class Learned:
    """A learned tree and the observations that its run stored."""

    policy: TreePolicy
    observations: np.ndarray


@dataclass(frozen=True)
class Row:
    """What one way made of one tree."""

    before: int
    after: int
    agreement: float
    volume: float
    success: float
    change: float
    digits: float


def learned(name: str, runs: int, episodes: int, folder: Path) -> Iterator[Learned]:
    """Yield the learned trees of a domain, from the folder where they are there."""
    for seed in range(runs):
        stem = folder / f"{name}-{episodes}-{seed:02d}"
        rows, tree = stem.with_suffix(".npy"), stem.with_suffix(".json")
        if not rows.exists():
            env = make(DOMAINS[name])
            gate = experts_for(DOMAINS[name])["gate"]
            shown = record(env, gate, episodes=15, seed=seed)
            result = learn(
                env,
                demonstrations=shown,
                expert=fit_expert_tree(shown),
                method="paper",
                episodes=episodes,
                evaluate_every=episodes,
                evaluation_episodes=1,
                seed=seed,
            )
            folder.mkdir(parents=True, exist_ok=True)
            result.policy.save(tree)
            np.save(rows, result.history.observations)
        yield Learned(TreePolicy.load(tree), np.load(rows))


def measure(name: str, runs: int, episodes: int, folder: Path) -> dict[str, list[Row]]:
    """Return the results of every way on every tree of a domain."""
    env = make(DOMAINS[name])
    rows: dict[str, list[Row]] = {way: [] for way in WAYS}
    for seed, tree in enumerate(learned(name, runs, episodes, folder)):
        before = success(tree.policy, env, seed)
        for way, options in WAYS.items():
            small = compressed(tree, way, options)
            rows[way].append(
                Row(
                    tree.policy.n_leaves,
                    small.n_leaves,
                    agreement(tree, small),
                    volume(tree, small),
                    before,
                    success(small, env, seed) - before,
                    threshold_digits(small),
                )
            )
        print(name, seed, [row[-1].after for row in rows.values()], flush=True)
    return rows


def compressed(tree: Learned, way: str, options: dict[str, Any]) -> TreePolicy:
    """Return a tree made smaller in one way; C4.5 alone is taken as it comes."""
    if way not in ALONE:
        real = None
        if way == "margin of return" and tree.policy.environment is not None:
            real = RealEpisodes(tree.policy.environment, margin=MARGIN)
        return compress(tree.policy, tree.observations, env=real, **options)[0]
    actions = tree.policy.predict(tree.observations)[0]
    grown = grow(
        tree.observations, actions, n_classes=tree.policy.schema.n_actions, settings=ALONE[way]
    )
    structure, labels = grown.to_decision_tree()
    return TreePolicy(structure, labels, tree.policy.schema, tree.policy.environment)


def agreement(tree: Learned, small: TreePolicy) -> float:
    """Return the share of the recorded observations on which both decide the same."""
    same = small.predict(tree.observations)[0] == tree.policy.predict(tree.observations)[0]
    return float(same.mean())


def volume(tree: Learned, small: TreePolicy) -> float:
    """Return the exact share of the observation box on which both decide differently."""
    policy = tree.policy
    box = observation_box(policy.schema, tree.observations)
    return disagreement(policy.tree, policy.actions, small.tree, small.actions, box, policy.schema)


def success(policy: TreePolicy, env: Any, seed: int) -> float:
    """Return the share of successes in 1,000 fresh episodes."""
    return evaluate(policy, env, episodes=EVALUATION_EPISODES, seed=1000 + seed).success_rate or 0.0


def threshold_digits(policy: TreePolicy) -> float:
    """Return the mean number of significant digits of the thresholds."""
    cuts = policy.tree.threshold[policy.tree.feature >= 0].tolist()
    counts = [len(Decimal(repr(cut)).normalize().as_tuple().digits) for cut in cuts]
    return float(np.mean(counts)) if counts else 0.0


def table(rows: dict[str, list[Row]]) -> str:
    """Return the results of a domain as a table: means over the runs, with 95 % intervals."""
    lines = [
        "| way | leaves | after / before (95 %) | larger than the input, the merge | "
        "agreement: mean, worst, runs below 1 | volume | success, change (95 %) | digits |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for way, found in rows.items():
        shares = bootstrap([row.after / row.before for row in found])
        changes = bootstrap([row.change for row in found])
        agreement = [row.agreement for row in found]
        lines.append(
            f"| {way} | {np.mean([row.after for row in found]):.1f} | {shares.value:.3f} "
            f"({shares.interval.low:.3f} to {shares.interval.high:.3f}) | "
            f"{sum(row.after > row.before for row in found)}, "
            f"{sum(a.after > b.after for a, b in zip(found, rows['exact merge'], strict=True))} | "
            f"{np.mean(agreement):.5f}, {min(agreement):.5f}, "
            f"{sum(share < 1 for share in agreement)} | "
            f"{np.mean([row.volume for row in found]):.2%} | {changes.value:+.4f} "
            f"({changes.interval.low:+.4f} to {changes.interval.high:+.4f}) | "
            f"{np.mean([row.digits for row in found]):.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Print one table a domain."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--episodes", type=int, default=400)
    parser.add_argument("--trees", type=Path, default=Path("build/compression"))
    arguments = parser.parse_args()
    for name in DOMAINS:
        rows = measure(name, arguments.runs, arguments.episodes, arguments.trees)
        before = rows["auto"]
        print(
            f"\n## {name}\n\n{len(before)} trees of {min(r.before for r in before)} to "
            f"{max(r.before for r in before)} leaves (mean "
            f"{np.mean([r.before for r in before]):.1f}), success "
            f"{np.mean([r.success for r in before]):.4f}.\n\n{table(rows)}\n"
        )


if __name__ == "__main__":
    main()
