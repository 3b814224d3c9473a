"""How much each choice that the paper leaves open matters: one changed at a time.

    python benchmarks/paper_sensitivity.py --runs 5 --episodes 400

Seeds start at 1000, apart from those of the reported experiments.
"""

import argparse
from dataclasses import replace
from statistics import fmean

import gymnasium

import eutree
from eutree.evaluation.evaluation import mean_interval
from eutree.learners import PAPER, UTreeMethod
from eutree.splitting import KolmogorovSmirnov
from eutree_lab.paper.runs import STARTS

FIRST_SEED = 1000


def pooled(**changes: object) -> KolmogorovSmirnov:
    return replace(PAPER.splitter, **changes)


VARIANTS: dict[str, tuple[str, UTreeMethod]] = {
    "preset paper": ("", PAPER),
    "gamma 0.9": ("0.99", replace(PAPER, discount=0.9)),
    "gamma 0.999": ("0.99", replace(PAPER, discount=0.999)),
    "gamma 1": ("0.99", replace(PAPER, discount=1.0)),
    "epsilon 0.05": ("0.1", replace(PAPER, exploration=0.05)),
    "epsilon 0.2": ("0.1", replace(PAPER, exploration=0.2)),
    "epsilon 0.4": ("0.1", replace(PAPER, exploration=0.4)),
    "gathering 10 episodes": ("20", replace(PAPER, gathering_episodes=10)),
    "gathering 40 episodes": ("20", replace(PAPER, gathering_episodes=40)),
    "minimum leaf 5": ("1", replace(PAPER, splitter=pooled(min_leaf=5))),
    "minimum leaf 10": ("1", replace(PAPER, splitter=pooled(min_leaf=10))),
    "tests per action": ("pooled", replace(PAPER, splitter=pooled(compare="action"))),
    "per action, minimum leaf 10": (
        "pooled, 1",
        replace(PAPER, splitter=pooled(compare="action", min_leaf=10)),
    ),
    "largest D": ("lowest p", replace(PAPER, splitter=pooled(score="distance"))),
    "largest D, 10 % a side": (
        "lowest p",
        replace(PAPER, splitter=pooled(score="distance", min_share=0.1)),
    ),
    "untried actions worth 0": ("left out", replace(PAPER, untried_value=0.0)),
}
TIME_STEPS = (0.5, 2.0)


def measure(method: UTreeMethod, learner: str, runs: int, episodes: int, time_step: float) -> str:
    """Return success along the way and at the end, return and leaves at the end."""
    env = gymnasium.make("eutree/Evasion2-v0", time_step=time_step)
    along, success, returns, leaves = [], [], [], []
    for seed in range(FIRST_SEED, FIRST_SEED + runs):
        demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=seed)
        result = eutree.learn(
            env,
            demonstrations=demos if learner == "eu-tree" else None,
            start=STARTS[learner],
            method=method,
            episodes=episodes,
            seed=seed,
            evaluate_every=20,
        )
        along.append(fmean(point.success_rate for point in result.curve[1:]))
        success.append(result.curve[-1].success_rate)
        returns.append(result.curve[-1].mean_return)
        leaves.append(result.policy.n_leaves)
    low, high = mean_interval(along)
    return (
        f"{fmean(along):.1%} [{low:.1%}, {high:.1%}] | {fmean(success):.1%} | "
        f"{fmean(returns):.1f} | {fmean(leaves):.0f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=400)
    arguments = parser.parse_args()
    print("# What the paper leaves open: sensitivity of the `paper` preset\n")
    print(
        f"2-Evasion, {arguments.runs} runs of {arguments.episodes} episodes, seeds from "
        f"{FIRST_SEED}. Made by `python benchmarks/paper_sensitivity.py --runs {arguments.runs} "
        f"--episodes {arguments.episodes}`.\n"
    )
    print("| changed | preset has | learner | success along the curve [95 %] | at the end "
          "| return at the end | leaves |")  # fmt: skip
    print("|---|---|---|---|---|---|---|")
    cases = [(name, had, settings, 1.0) for name, (had, settings) in VARIANTS.items()]
    cases += [(f"time step {step} s", "1 s", PAPER, step) for step in TIME_STEPS]
    for name, had, settings, step in cases:
        for learner in ("c-u-tree", "eu-tree"):
            row = measure(settings, learner, arguments.runs, arguments.episodes, step)
            print(f"| {name} | {had} | {learner} | {row} |", flush=True)


if __name__ == "__main__":
    main()
