"""How often what is said of a tree that was learned from a log is wrong.

A log of short episodes: two features, new at every step, two actions; whoever acted did as the tree
of ``fit`` does, half of the actions at random. The tree in question acts otherwise in a quarter of
all steps, and what it earns more there is known. A claim is wrong if the lower bound of a tree that
is believed is above the truth. Beside it the rule that was used before: Student's bound of single
deviations. Then long episodes, of a room that cools, in which single deviations speak.

Run: python benchmarks/offline_claims.py [--logs 400] [--out docs/results]
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.evaluation.evaluation import mean_interval
from eutree.evaluation.off_policy import Judge, hold_out
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.worlds import room_episode  # noqa: E402

Draw = Callable[[np.random.Generator, int], Floats]
TWO = Schema.anonymous(2, 2)


def step_at(threshold: float, low: int, high: int) -> TreePolicy:
    """Return the tree that takes ``low`` up to a threshold of the first feature, else ``high``."""
    tree = DecisionTree.single_leaf(2).split(0, 0, threshold)
    return TreePolicy(tree=tree, actions=np.array([low, high]), schema=TWO)


FIT, OTHER = step_at(0.5, 0, 1), step_at(0.25, 0, 1)


def normal(generator: np.random.Generator, n: int) -> Floats:
    return generator.standard_normal(n)


def skewed(generator: np.random.Generator, n: int) -> Floats:
    return 1.0 - generator.exponential(1.0, n)


def rare(generator: np.random.Generator, n: int) -> Floats:
    return 0.236 - 59.0 * (generator.random(n) < 0.004)


# Noise of rewards, and how much more the other action earns where the trees differ.
LIMITS = {normal: (-4.0, 6.0), skewed: (-7.0, 3.0), rare: (-60.0, 2.0)}  # of a reward
WORLDS: dict[str, tuple[Draw, float]] = {
    "normal, no difference": (normal, 0.0),
    "normal, worse": (normal, -0.5),
    "normal, better": (normal, 2.0),
    "skewed, no difference": (skewed, 0.0),
    "skewed, worse": (skewed, -0.5),
    "skewed, better": (skewed, 2.0),
    "rare losses, no difference": (rare, 0.0),
    "rare losses, worse": (rare, -0.136),
    "rare losses, better": (rare, 0.5),
}


def episode(generator: np.random.Generator, draw: Draw, gain: float, steps: int) -> Episode:
    """Return an episode; rare losses come where the other action is taken, and nowhere else."""
    seen = generator.random((steps + 1, 2))
    own = (seen[:-1, 0] > 0.5).astype(np.int64)
    actions = np.where(generator.random(steps) < 0.5, generator.integers(0, 2, steps), own)
    departs = (actions == 1) & (seen[:-1, 0] > 0.25) & (seen[:-1, 0] <= 0.5)
    noise = draw(generator, steps)
    rewards = np.where(departs, gain + noise, 0.0 if draw is rare else noise)
    return Episode(seen, actions, np.clip(rewards, *LIMITS[draw]), terminated=True, truncated=False)


def lower_bounds(
    known: tuple[Episode, ...], held_out: tuple[Episode, ...], limits: tuple[float, float]
) -> list[float]:
    """Return the bound of a tree that is believed, by each rule; minus infinity where it is not."""
    judge = Judge(
        other=FIT, known=known, held_out=held_out, discount=0.99,
        generator=np.random.default_rng(0), return_range=limits,
    )  # fmt: skip
    unknown = replace(judge, return_range=None)
    vars(unknown)["_log"] = judge._log  # fitted once
    found = [each.of(OTHER) for each in (judge, unknown)]
    old = judge._log.gains(OTHER, FIT, held_out, limits, most_weight=0.0).values
    return [
        *(one.low if one.believed else -np.inf for one in found),
        float(mean_interval(old, confidence=0.9).low),
    ]


Row = list[tuple[float, float]]  # of each rule: share of logs with a wrong claim, and believed


def shares(lows: Floats, truth: float) -> Row:
    """Return the shares of logs, from the lower bounds of each rule, shape [logs, rules]."""
    believed = lows > 0.0
    wrong = believed & (lows > truth)
    return list(zip(wrong.mean(axis=0).tolist(), believed.mean(axis=0).tolist(), strict=True))


def claims(world: str, *, steps: int, episodes: int, logs: int) -> Row:
    """Return how the rules do on short episodes: range known, range seen, Student."""
    draw, gain = WORLDS[world]
    limits = (steps * LIMITS[draw][0], steps * LIMITS[draw][1])
    lows = np.empty((logs, 3))
    for number in range(logs):
        generator = np.random.default_rng(number)
        recorded = [episode(generator, draw, gain, steps) for _ in range(episodes)]
        lows[number] = lower_bounds(*hold_out(recorded, generator), limits)
    return shares(lows, steps * 0.25 * gain)


def heats_below(threshold: float) -> TreePolicy:
    return step_at(threshold, 1, 0)


def room_claims(threshold: float, *, episodes: int, logs: int) -> tuple[float, Row]:
    """Return the true gain of heating below another threshold than 22 degrees, and the shares."""
    other, operator = heats_below(threshold), heats_below(22.0)
    generator = np.random.default_rng(0)
    means = [
        np.mean([room_episode(generator, tree.act, random=0.0).undiscounted_return
                 for _ in range(400)])
        for tree in (other, operator)
    ]  # fmt: skip
    lows = np.empty((logs, 1))
    for number in range(logs):
        generator = np.random.default_rng(number)
        log = [room_episode(generator, operator.act, random=0.1) for _ in range(episodes)]
        known, held_out = hold_out(log, generator)
        found = Judge(
            other=operator, known=known, held_out=held_out, discount=0.99, generator=generator
        ).of(other)
        lows[number] = found.low if found.believed else -np.inf
    truth = float(means[0] - means[1])
    return truth, shares(lows, truth)


def report(lines: list[str], options: argparse.Namespace) -> str:
    """Return the page."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip
    today = time.strftime("%Y-%m-%d", time.gmtime())
    return f"""---
command: python benchmarks/offline_claims.py
commit: {commit}
date: {today}
sources: benchmarks/offline_claims.py src/eutree/evaluation src/eutree/contests
---

# How often what is said of a tree learned from a log is wrong

Made by `python benchmarks/offline_claims.py` on {today}; log k is made by the generator seeded
with k. In each log a tree is compared with the one that whoever acted follows; half of the actions
were taken at random (in the room a tenth). A claim is *wrong* if the tree is believed to be the
better and the lower bound said of it is above what it gains in truth. {options.logs} logs each of
300 episodes, a third of them held out, {options.logs // 4} of 900, {options.logs // 8} of 2,400.

{chr(10).join(lines)}

* *Range known*: no claim is wrong. The price is power: with three such actions in a row an episode
  weighs 64, and the range alone bounds its return, so nothing is believed of three steps.
* *Range seen*: the sentence has its condition, "if no episode returns less than ...", and nothing
  is believed of a tree that the log has followed at fewer than 300 steps at which the two differ:
  that is why the shorter logs show nothing. Of longer ones, in which no loss has been seen, some
  are wrong under rare losses, as the condition says.
* *Student*, of single deviations, is the rule that was used until November 2026.
"""


def main() -> None:
    """Print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=400)
    parser.add_argument("--rooms", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    lines = [
        "| differences | steps | episodes | gain | wrong, range known | believed "
        "| wrong, range seen | believed | wrong, Student | believed |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    cases = [
        (world, steps, 900, options.logs // 4)
        if world.endswith("better")
        else (world, steps, 300, options.logs)
        for world in WORLDS
        for steps in (1, 3)
    ]
    cases.append(("rare losses, worse", 3, 2400, options.logs // 8))
    for world, steps, episodes, logs in cases:
        found = claims(world, steps=steps, episodes=episodes, logs=logs)
        cells = [f"{share:.3f}" for pair in found for share in pair]
        truth = steps * 0.25 * WORLDS[world][1]
        lines.append(f"| {world} | {steps} | {episodes} | {truth:.3g} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    lines += [
        "",
        f"A room that cools, 60 steps an episode, {options.rooms} logs each: single deviations and "
        "a world model speak, and the sentence says so.",
        "",
        "| heats below | episodes | gain | wrong | believed |",
        "|---|---|---|---|---|",
    ]
    for threshold in (25.0, 22.5, 20.5, 15.0):
        truth, ((wrong, believed),) = room_claims(threshold, episodes=360, logs=options.rooms)
        lines.append(f"| {threshold:g} | 360 | {truth:.1f} | {wrong:.3f} | {believed:.3f} |")
        print(lines[-1], flush=True)
    (options.out / "offline-claims.md").write_text(report(lines, options), encoding="utf-8")


if __name__ == "__main__":
    main()
