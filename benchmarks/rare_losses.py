"""Measure what a run hands over where losses are rare: is it worse than what it began with?

In each of three steps one action pays 0.9, the other 1.0 but loses much with a small probability,
so that it is the worse one on average. What is observed has nothing to do with it. The expert takes
the first action always; `planning` learns for some episodes. What a policy truly earns follows from
its actions. *Worse*: the policy that is handed over truly earns less than the expert. *Covered*:
the interval of `against_start` holds the true difference of the learned tree and the expert.

Run: python benchmarks/rare_losses.py [--runs 60] [--first 0] [--episodes 120] [--out PAGE]
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.evaluation.evaluation import wilson_interval

STEPS, SAFE, RISKY = 3, 0.9, 1.0
DECLARED = "declared"
KINDS = {DECLARED: None, "seen": None, "seen, 600 pairs": 600}  # of knowing the range: most pairs
KNOWING = 20_000  # observations by which the share of an action is known
HEAD = """# Rare losses: what is handed over

Made by `python benchmarks/rare_losses.py`: {runs} runs of `planning` a row, seeds from {first},
{episodes} episodes each, from 15 demonstrations of the action that pays 0.9 in each of three steps.
The other action pays 1.0, and loses what the row says: on average it is worse. *600 pairs*: with
`judge_episodes=600`. *Worse*: the policy handed over truly earns less than the start. *Learned
worse*: the learned tree does, which is kept beside. *Covered*: the interval of `against_start`
holds the truth, of those runs whose learned tree is not the start. Wilson's 95 % intervals.

| loss | range of returns | worse | learned worse | covered | start handed over |
|---|---|---|---|---|---|
"""


class RareLosses(gymnasium.Env[Any, Any]):
    """Three steps, two actions, of which the second loses much now and then."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (2,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, loss: float, chance: float, *, declares: bool) -> None:
        self._loss, self._chance = loss, chance
        if declares:
            self.return_range = (STEPS * (RISKY - loss), STEPS * RISKY)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self._left = STEPS
        return self._place(), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._left -= 1
        lost = self.np_random.random() < self._chance  # drawn for both, so that pairs are paired
        reward = (RISKY - self._loss * lost) if action else SAFE
        return self._place(), reward, self._left == 0, False, {}

    def _place(self) -> Any:
        return self.np_random.random(2)

    def truth(self, policy: eutree.TreePolicy) -> float:
        """Return what a policy earns in an episode on average."""
        places = np.random.default_rng(0).random((KNOWING, 2))
        risky = float(policy.predict(places)[0].mean())
        return STEPS * (SAFE + risky * (RISKY - self._loss * self._chance - SAFE))


gymnasium.register("RareLosses-v0", RareLosses, max_episode_steps=STEPS)


@dataclass(frozen=True)
class Ended:
    """How a run ended."""

    worse: bool
    learned_worse: bool
    covered: bool | None  # None where the learned tree is the start
    is_start: bool


def run(env: gymnasium.Env[Any, Any], episodes: int, judged: int | None, seed: int) -> Ended:
    """Return how a run ends."""
    shown = eutree.record(env, lambda observation: 0, episodes=15, seed=seed)
    options = {"evaluate_every": episodes, "evaluation_episodes": 2, "method": "planning"}
    result = eutree.learn(
        env, demonstrations=shown, episodes=episodes, judge_episodes=judged, seed=seed, **options
    )
    policies = result.first, result.learned, result.policy
    start, learned, found = (env.unwrapped.truth(one) for one in policies)
    judgement, covered = result.against_start, None
    if judgement is not None and not judgement.is_start:
        low, high = judgement.return_interval
        covered = low <= learned - start <= high
    return Ended(found < start, learned < start, covered, found == start)


def share(counted: list[bool]) -> str:
    """Return a share with its interval."""
    if not counted:
        return "-"
    low, high = wilson_interval(sum(counted), len(counted))
    return f"{sum(counted)} of {len(counted)} [{low:.1%}, {high:.1%}]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=120)
    parser.add_argument("--out", type=Path, help="page to write")
    options = parser.parse_args()
    page = HEAD.format(**vars(options))
    for kind, judged in KINDS.items():
        for loss, chance in ((60.0, 0.004), (30.0, 0.01), (600.0, 0.0004)):
            env = gymnasium.make(
                "RareLosses-v0", loss=loss, chance=chance, declares=kind == DECLARED
            )
            seeds = range(options.first, options.first + options.runs)
            ended = [run(env, options.episodes, judged, seed) for seed in seeds]
            covered = [one.covered for one in ended if one.covered is not None]
            cells = (
                f"{loss - RISKY:g} at {chance:g}",
                kind,
                share([one.worse for one in ended]),
                share([one.learned_worse for one in ended]),
                share(covered),
                str(sum(one.is_start for one in ended)),
            )
            page += f"| {' | '.join(cells)} |\n"
            print(page.splitlines()[-1], flush=True)
    if options.out is not None:
        options.out.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
