"""Prove how often the trees of 2-Evasion succeed, and sample the same trees beside.

Run: python benchmarks/proofs_chance.py [--seeds 8] [--episodes 100000] [--runs FOLDER]
     [--out docs/results]

Of each seed there are fifteen demonstrations of the gate rule, the tree that `eutree fit` makes of
them, and the tree that `eutree learn` makes of them in 400 episodes. They are made once and kept in
the folder of the runs. Trees that remember are left out: they cannot be proven.
"""

import argparse
import resource
import subprocess
import time
from pathlib import Path

import numpy as np

from eutree.evaluation import evaluate
from eutree.policies import TreePolicy
from eutree.proof import plant_of, prove
from eutree.schema import EnvironmentSpec

SPEC = EnvironmentSpec("eutree/Evasion2-v0")
WITHIN = (0.02, 0.05)  # points that the bounds are to keep to what is sampled


def trees_of(seed: int, folder: Path) -> dict[str, Path]:
    """Return the files of a seed's trees, made now where the folder lacks them."""
    demos, fitted, run = (folder / f"{name}-{seed}" for name in ("demos", "fitted", "run"))
    fitted = fitted.with_suffix(".json")
    for made, words in (
        (demos, f"record {SPEC.id} --expert gate --episodes 15 --seed {seed} --out {demos}"),
        (fitted, f"fit {demos} --out {fitted}"),
        (run, f"learn --demos {demos} --seed {seed} --out {run}"),
    ):
        if not made.exists():
            subprocess.run(["eutree", *words.split()], check=True, capture_output=True)
    return {"fitted": fitted, "learned": run / "learned.json"}


def row_of(name: str, seed: int, policy: TreePolicy, episodes: int) -> tuple[str, list[float]]:
    """Return the row of a tree; how far its bounds and what was sampled are apart."""
    plant = plant_of(SPEC)
    assert plant is not None
    begin = time.process_time()
    found = prove(policy, plant)
    seconds = time.process_time() - begin
    low, high = found.bounds["success"]
    played = evaluate(policy, SPEC, episodes=episodes, seed=seed)
    sampled = float(np.mean(played.successes))
    off = 3 * np.sqrt(sampled * (1 - sampled) / episodes)
    holds = low - off <= sampled <= high + off
    return (
        f"| {seed} | {name} | {policy.n_leaves} | {low:.4f} | {high:.4f} | {sampled:.4f} | "
        f"{100 * (sampled - low):.1f} | {found.bounds['best_success'][1] - low:.4f} | "
        f"{found.work['cells']:,} | {seconds:.0f} |",
        [sampled - low, float(holds)],
    )


def page(rows: list[str], offs: list[list[float]], command: str, episodes: int) -> str:
    """Return the page of results."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    within = [sum(off <= points for off, _ in offs) for points in WITHIN]
    return "\n".join(
        [
            "---",
            f"command: {command}",
            f"commit: {commit}",
            f"date: {time.strftime('%Y-%m-%d')}",
            "sources: benchmarks/proofs_chance.py src/eutree/proof src/eutree_lab/plants",
            "---",
            "",
            "# Proofs about chance",
            "",
            f"Made by `{command}`.",
            "The property is how often a tree succeeds in 2-Evasion, over all starts and all",
            f"noise. Beside the bounds are {episodes:,} real episodes; *short* is by how many",
            "points the lower bound stays below them, *loses* how much less often than the best",
            "policy there is the tree succeeds at most, whatever that policy sees.",
            "",
            f"Of {len(rows)} trees {within[0]} have a lower bound within 2 points of what is",
            f"sampled, {within[1]} within 5; {sum(holds == 0 for _, holds in offs)} samples "
            "contradict their",
            f"bounds. Memory at most: {memory:.0f} MB.",
            "",
            "| seed | tree | leaves | at least | at most | sampled | short | loses | cells "
            "| CPU s |",
            "|---|---|---|---|---|---|---|---|---|---|",
            *rows,
            "",
            "The trees that are far apart look at both opponents before the first crossing: then",
            "both are carried at once, and the cells that fit are too coarse for a bound of use.",
            "Their certificate is undecided, and a statistical one (`--sampled`) says more.",
            "",
        ]
    )


def main() -> None:
    """Prove and sample the trees of some seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--episodes", type=int, default=100_000)
    parser.add_argument("--runs", type=Path, default=Path("runs/proofs-chance"))
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    rows, offs = [], []
    for seed in range(options.seeds):
        for name, file in trees_of(seed, options.runs).items():
            policy = TreePolicy.load(file)
            if not policy.features.is_identity:
                continue
            row, off = row_of(name, seed, policy, options.episodes)
            rows.append(row)
            offs.append(off)
            print(row, flush=True)
    command = f"python benchmarks/proofs_chance.py --seeds {options.seeds}"
    text = page(rows, offs, command, options.episodes)
    (options.out / "proofs-chance.md").write_text(text)


if __name__ == "__main__":
    main()
