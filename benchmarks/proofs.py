"""Prove the trees of MountainCar's table, and sample the same trees beside.

Run: python benchmarks/proofs.py [--first 4] [--seeds 10] [--episodes 100000] [--runs FOLDER]
     [--out docs/results]

The trees are those of ``benchmarks/other_tasks.py MountainCar``: of each seed C4.5's tree of
fifteen demonstrations, the learned tree, and the one that was raced as well. They are made once and
kept in the folder of the runs. Every tree is proven or refuted over all starts; then its share of
the episodes is played by Gymnasium from random starts, each of which must end at the step that the
piece of its start is certified to end at, and must be in the box of that piece at every step.
"""

import argparse
import resource
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import gymnasium
import numpy as np

import eutree
from carried import boxes_along
from eutree.envs.experts import EXPERTS
from eutree.policies import TreePolicy
from eutree.proof import Certificate, Plant, Trajectory, plant_of, prove, replay
from eutree.proof.certificate import NEVER
from eutree.proof.reach import Acting
from eutree.schema import EnvironmentSpec
from other_tasks import DEMONSTRATIONS, TASKS, learned

WAYS = ("c45", "learned", "raced")
NAMES = {"c45": "C4.5 of demonstrations", "learned": "learned", "raced": "learned, raced"}
TASK = TASKS["MountainCar"]


def trees_of(seed: int, folder: Path) -> dict[str, TreePolicy]:
    """Return the trees of a seed, made now where the folder lacks them."""
    files = {way: folder / f"MountainCar-{seed}-{way}.json" for way in WAYS}
    if not all(file.exists() for file in files.values()):
        folder.mkdir(parents=True, exist_ok=True)
        env = gymnasium.make(TASK.env)
        shown = eutree.record(
            env, EXPERTS[TASK.env][TASK.expert], episodes=DEMONSTRATIONS, seed=seed
        )
        eutree.fit_expert_tree(shown).save(files["c45"])
        found = learned(TASK, env, shown, seed)
        found["learned"][0].save(files["learned"])
        found["learned, raced"][0].save(files["raced"])
    return {way: TreePolicy.load(file) for way, file in files.items()}


@dataclass(frozen=True)
class Sample:
    """What real episodes from random starts came to, beside what is certified of them."""

    episodes: int
    mean: float
    most: int
    wrong: int  # episodes that end at a step that is not certified
    states: int  # of which a box is known
    outside: int  # that lie outside of it
    per_step: float  # s of the processor for a step of Gymnasium


def sampled(
    certificate: Certificate, policy: TreePolicy, plant: Plant, starts: np.ndarray
) -> Sample:
    """Return how real episodes compare with what is certified of their starts."""
    pieces = certificate.pieces
    order = np.argsort(pieces.low[:, 0])
    place = order[np.searchsorted(pieces.low[order, 0], starts, side="right") - 1]
    env, begin = plant.make(), time.process_time()
    paths = [replay(plant, policy, np.array([one, 0.0]), 200, env=env) for one in starts]
    seconds = time.process_time() - begin
    lengths = np.array([len(path.states) - 1 for path in paths])
    ends = np.array([path.is_over for path in paths])
    first, last = pieces.first[place], pieces.last[place]
    wrong = ~((first <= np.where(ends, lengths, NEVER)) & (np.where(ends, lengths, NEVER) <= last))
    states, outside = in_boxes(policy, plant, (pieces.low[place], pieces.high[place]), paths)
    per_step = seconds / lengths.sum()
    return Sample(
        len(paths), -lengths.mean(), lengths.max(), int(wrong.sum()), states, outside, per_step
    )


def in_boxes(
    policy: TreePolicy,
    plant: Plant,
    pieces: tuple[np.ndarray, np.ndarray],
    paths: list[Trajectory],
) -> tuple[int, int]:
    """Return how many real states have a box at their step, and how many lie outside of it."""
    states = np.full((len(paths), 201, len(plant.state)), np.nan)
    for row, path in zip(states, paths, strict=True):
        row[: len(path.states)] = path.states
    known = outside = 0
    boxes = boxes_along(Acting(policy, plant), plant, pieces, 200)
    for step, (low, high) in enumerate(boxes, start=1):
        there = states[:, step]
        counts = np.isfinite(low).all(axis=1) & np.isfinite(there).all(axis=1)
        inside = ((low <= there) & (there <= high)).all(axis=1)
        known += int(counts.sum())
        outside += int((counts & ~inside).sum())
    return known, outside


def row_of(
    name: str, seed: int, policy: TreePolicy, plant: Plant, episodes: int
) -> tuple[str, Sample, Certificate]:
    """Return the row of a tree, what its episodes came to, and its certificate."""
    begin = time.process_time()
    found = prove(policy, plant, "arrives")
    seconds = time.process_time() - begin
    generator = np.random.default_rng(seed)
    sample = sampled(found, policy, plant, generator.uniform(-0.6, -0.4, episodes))
    ratio = seconds / found.work["box_steps"] / sample.per_step
    of_piece = seconds / found.work["pieces"] / sample.per_step
    low, high = found.bounds["mean_return"]
    steps = found.bounds["steps"]
    not_from = "" if found.counterexample is None else f"{found.counterexample['position']:.6f}"
    return (
        (
            f"| {seed} | {name} | {policy.n_leaves} | {found.verdict} | {(low + high) / 2:.5f} ± "
            f"{(high - low) / 2:.1g} | {steps[0]:.0f} to {steps[1]:.0f} | "
            f"{found.worst_start['position']:.5f} | {not_from} | {found.work['pieces']:,} | "
            f"{found.work['box_steps']:,} | {seconds:.2f} | {ratio:.2f} | "
            f"{of_piece:.0f} | {sample.mean:.2f} | {sample.most} |"
        ),
        sample,
        found,
    )


def page(rows: list[str], verdicts: list[str], samples: list[Sample], command: str) -> str:
    """Return the page of results."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    refuted = verdicts.count("refuted")
    episodes, wrong, states, outside = (
        sum(getattr(one, name) for one in samples)
        for name in ("episodes", "wrong", "states", "outside")
    )
    return "\n".join(
        [
            "---",
            f"command: {command}",
            f"commit: {commit}",
            f"date: {time.strftime('%Y-%m-%d')}",
            "sources: benchmarks/proofs.py src/eutree/proof",
            "---",
            "",
            "# Proofs",
            "",
            f"Made by `{command}`.",
            "The property is that the car of MountainCar-v0 *arrives*, from every start that",
            "Gymnasium draws, within its 200 steps. The mean return is the one over all starts and",
            "not over a sample; *steps* bound every start that arrives, and *fails at* is a start",
            "from which Gymnasium itself did not arrive.",
            "",
            f"Of {len(rows)} trees {verdicts.count('proven')} are proven and {refuted} refuted. "
            f"Of {episodes:,} real episodes from random starts",
            f"{wrong} ended at a step that was not certified, and of their {states:,} states that",
            f"have a box at their step {outside} lay outside. Memory at most: {memory:.0f} MB.",
            "*A step* is the time for a step of a box, all of the proof included, as a ratio to a",
            "step of Gymnasium with the policy in the same run; *a piece* the time for a piece, in",
            "such steps: what an episode or two take.",
            "",
            "| seed | tree | leaves | arrives | mean return | steps | worst start | fails at "
            "| pieces | box steps | CPU s | a step | a piece | sampled mean | sampled worst |",
            "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
            *rows,
            "",
            "A refuted tree may be among the best by its mean: the starts from which it fails are",
            "a few in a thousand, so a sample of 200 episodes seldom holds one.",
            "",
            "## The starts of others",
            "",
            "VeriTree (Schilling, Lukina, Demirović, Larsen, NeurIPS 2023) proves given trees with",
            "Taylor models. Its start sets are as the project's notes give them from its paper; it",
            "was not run here.",
            "",
            "| task | VeriTree | here |",
            "|---|---|---|",
            "| MountainCar | 30 % of Gymnasium's starts | all of them, and the share that fails |",
            "| CartPole | for ever, without the cart's position | 500 steps with it, "
            "[apart](proofs-cart-pole.md) |",
            "| Acrobot | boxes of width 0.001 | statistical certificates alone |",
            "| N-Evasion | none | all starts and all noise, [apart](proofs-chance.md) |",
            "",
        ]
    )


def main() -> None:
    """Prove and sample the trees of some seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=4)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--episodes", type=int, default=100_000)
    parser.add_argument("--runs", type=Path, default=Path("runs/proofs"))
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    plant = plant_of(EnvironmentSpec(TASK.env))
    seeds = range(options.first, options.first + options.seeds)
    each = options.episodes // (len(seeds) * len(WAYS))
    rows, verdicts, samples = [], [], []
    for seed in seeds:
        for way, policy in trees_of(seed, options.runs).items():
            row, sample, found = row_of(NAMES[way], seed, policy, plant, each)
            rows.append(row)
            verdicts.append(found.verdict)
            samples.append(sample)
            print(row, flush=True)
    command = f"python benchmarks/proofs.py --first {options.first} --seeds {options.seeds}"
    text = page(rows, verdicts, samples, command)
    (options.out / "proofs.md").write_text(text)


if __name__ == "__main__":
    main()
