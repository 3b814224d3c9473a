"""Close the loop of a proof: prove, begin where it fails, learn, prove again.

Run: python benchmarks/proof_loop.py [--first 300] [--seeds 2] [--leaves 5 4] [--rounds 6]
     [--steps 30000] [--out docs/results]

A small tree is to take the car of MountainCar up within 110 steps from *every* start. It is learned
from fifteen demonstrations of a controller that takes up to 185, in 100 episodes and a race of so
many steps, and proven. As long as the proof fails, a round follows: the tree races on for as many
steps, half of its episodes begin in the boxes of all certificates so far, and what comes of it is
proven in turn; it takes the tree's place if fewer starts fail. Beside it, from the same tree, stand
rounds of as many steps and the same seeds whose episodes all begin as Gymnasium draws them.
"""

import argparse
import subprocess
import time
from pathlib import Path

import gymnasium

import eutree
from eutree.envs.experts import EXPERTS
from eutree.proof import Certificate, plant_of, prove
from eutree.schema import EnvironmentSpec

TASK, QUESTION = "MountainCar-v0", "arrives within 110 steps"
WAYS = ("of the certificates", "anywhere")


def failing(certificate: Certificate) -> float:
    """Return the share of the starts from which the property is not proven."""
    starts = certificate.starts
    return 0.0 if starts is None else float((starts.high - starts.low)[:, 0].sum() / 0.2)


class Loop:
    """Rounds of learning and proving.

    Args:
        seed: Seed of the demonstrations and of all learning.
        leaves: Most leaves of the tree.
        steps: Steps of each race.
    """

    def __init__(self, seed: int, leaves: int, steps: int) -> None:
        self._env = gymnasium.make(TASK)
        self._plant = plant_of(EnvironmentSpec(TASK))
        self._seed, self._leaves, self._steps = seed, leaves, steps
        shows = EXPERTS[TASK]["push"]
        self._shown = eutree.record(self._env, shows, episodes=15, seed=seed)
        self.first = self._learned(seed, episodes=100)

    def _learned(self, seed: int, **options: object) -> eutree.TreePolicy:
        return eutree.learn(
            self._env, demonstrations=self._shown, race_steps=self._steps,
            max_leaves=self._leaves, judge_episodes=0, evaluate_every=100, evaluation_episodes=1,
            seed=seed, **options,
        ).policy  # fmt: skip

    def run(self, rounds: int, *, from_certificates: bool) -> list[Certificate]:
        """Return the certificates of the tree after 0, 1, 2 ... rounds, until one is proven."""
        tree, found = self.first, [prove(self.first, self._plant, QUESTION)]
        failed = found.copy()
        while not found[-1].proven and len(found) <= rounds:
            learned = self._learned(
                1000 * self._seed + len(found),
                episodes=0,
                expert=tree,
                start="tree+demos",
                starts=failed if from_certificates else (),
            )
            failed.append(prove(learned, self._plant, QUESTION))
            better = failing(failed[-1]) < failing(found[-1])
            tree, now = (learned, failed[-1]) if better else (tree, found[-1])
            found.append(now)
        return found


def row_of(seed: int, leaves: int, way: str, found: list[Certificate], seconds: float) -> str:
    """Return a row of the table."""
    rounds = str(len(found) - 1) if found[-1].proven else f"not in {len(found) - 1}"
    shares = ", ".join(f"{100 * failing(one):.3g}" for one in found)
    most = f"{found[-1].bounds['steps'][1]:.0f}" if found[-1].proven else ""
    return f"| {seed} | {leaves} | {way} | {rounds} | {shares} | {most} | {seconds:.0f} |"


def page(rows: list[str], command: str) -> str:
    """Return the page of results."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    return "\n".join(
        [
            "---",
            f"command: {command}",
            f"commit: {commit}",
            f"date: {time.strftime('%Y-%m-%d')}",
            "sources: benchmarks/proof_loop.py src/eutree/proof",
            "---",
            "",
            "# Rounds until a proof stands",
            "",
            f"Made by `{command}`.",
            "The property: from every start of MountainCar-v0 the car *arrives within 110 steps*.",
            "A round is a race of 30,000 steps and a proof. Half of its episodes begin in the",
            "boxes in which the proofs so far failed, or all of them *anywhere*, from the same",
            "tree and with the same seeds. *Fails at* is the share of all starts from which the",
            "tree is not proven, in percent, before the first round and after each.",
            "",
            "| seed | leaves | episodes begin | rounds | fails at % | proven within | CPU s |",
            "|---|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


def main() -> None:
    """Run both kinds of rounds for some seeds and numbers of leaves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=300)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--leaves", type=int, nargs="+", default=[5, 4])
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--steps", type=int, default=30_000)
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    command = f"python benchmarks/proof_loop.py --first {options.first} --seeds {options.seeds}"
    rows = []
    for seed in range(options.first, options.first + options.seeds):
        for leaves in options.leaves:
            loop = Loop(seed, leaves, options.steps)
            for way in WAYS:
                begin = time.process_time()
                found = loop.run(options.rounds, from_certificates=way == WAYS[0])
                rows.append(row_of(seed, leaves, way, found, time.process_time() - begin))
                print(rows[-1], flush=True)
            (options.out / "proofs-loop.md").write_text(page(rows, command))


if __name__ == "__main__":
    main()
