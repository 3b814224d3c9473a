"""Prove or refute that learned trees never let two tanks run over.

Run: python benchmarks/proofs_of_tanks.py --trees FOLDER [--first 10] [--seeds 10]
     [--out docs/results]

The trees are those of ``benchmarks/small_trees.py TwoTanks``: files ``TwoTanks-SEED.json`` in the
folder. What is not there is learned first. The property is the plant's own: both levels stay below
the brim for ever, whatever demand and set point do within their ranges at every step.
"""

import argparse
import resource
import subprocess
import time
from pathlib import Path

from eutree.policies import TreePolicy
from eutree.proof import Certificate, plant_of, prove
from eutree.schema import EnvironmentSpec
from small_trees import TASKS, Measurement

TEXT = """# Proofs about two tanks

Made by `{command}`.
The property: from every start *no tank of TwoTanks-v0 ever runs over*, while demand and set point
may be anything in their ranges at every step, as adverse as can be. The trees are the learned ones
of [the table](small-trees-TwoTanks.md), made again from the same seeds.

Of {n} trees {proven} are proven, {refuted} refuted and {undecided} undecided. A refuted tree
ran over in the real environment, given demands and set points that a search had found.
Memory at most: {memory:.0f} MB.

| seed | leaves | never runs over | what stops it | cells | box steps | CPU s |
|---|---|---|---|---|---|---|
{rows}

A refutation needs set points that move at every step; the environment draws a new one in a hundred
steps, so its own episodes hardly ever show it. Where a tree is undecided, the box is the first one
from which cells of this size allow a tank to run over; no real run from there is known.
"""


def tree_of(seed: int, folder: Path) -> TreePolicy:
    """Return the learned tree of a seed, made now where the folder lacks it."""
    file = folder / f"TwoTanks-{seed}.json"
    if not file.exists():
        run = folder / f"run-TwoTanks-{seed}"
        measurement = Measurement(TASKS["TwoTanks"], seed, run)
        measurement.learned()
        (run / "policy.json").rename(file)
    return TreePolicy.load(file)


def reason(found: Certificate) -> str:
    """Return what stops a proof."""
    if found.counterexample is not None:
        run = found.counterexample
        tank = run["runs_over"].partition("_")[0]
        return f"{tank} tank after {run['steps']} steps"
    return found.sentence.partition("in the box of ")[2]


def main() -> None:
    """Prove the trees of some seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trees", type=Path, required=True)
    parser.add_argument("--first", type=int, default=10)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    plant = plant_of(EnvironmentSpec("TwoTanks-v0"))
    rows, verdicts = [], []
    for seed in range(options.first, options.first + options.seeds):
        policy = tree_of(seed, options.trees)
        begin = time.process_time()
        found = prove(policy, plant)
        seconds = time.process_time() - begin
        verdicts.append(found.verdict)
        rows.append(
            f"| {seed} | {policy.n_leaves} | {found.verdict} | {reason(found)} | "
            f"{found.work['cells']:,.0f} | {found.work['box_steps']:,.0f} | {seconds:.0f} |"
        )
        print(rows[-1], flush=True)
    command = (
        f"python benchmarks/proofs_of_tanks.py --trees FOLDER --first {options.first} "
        f"--seeds {options.seeds}"
    )
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    head = f"---\ncommand: {command}\ncommit: {commit}\ndate: {time.strftime('%Y-%m-%d')}\n"
    head += (
        "sources: benchmarks/proofs_of_tanks.py src/eutree/proof examples/two_tanks_plant\n---\n\n"
    )
    text = TEXT.format(
        command=command, n=len(rows), rows="\n".join(rows),
        memory=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        **{name: verdicts.count(name) for name in ("proven", "refuted", "undecided")},
    )  # fmt: skip
    (options.out / "proofs-two-tanks.md").write_text(head + text)


if __name__ == "__main__":
    main()
