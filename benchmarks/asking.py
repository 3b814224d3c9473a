"""What asking is worth: 2-Evasion learned alone, with stretches shown, and with more shown before.

    python benchmarks/asking.py [--preset default] [--demonstrations 3] [--seeds 15] [--keep FILE]

The gate demonstrator answers at most 15 requests of at most 20 steps where the learner is unsure.
Three controls: nobody is asked; the same budget without a criterion, asked in each of the first 15
episodes; and as many steps recorded in advance, in whole episodes, as the same seed's learner asked
for. Means over seeds with 95 % intervals; the differences are those of the same seeds. ``--keep``
names a file of finished runs: a benchmark that is started again goes on from there.
"""

import argparse
import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.evaluation import mean_interval
from eutree.learners.confidence import Confidence
from eutree.training import Asking

AT = (40, 100, 200)
NEVER_SURE = Confidence(min_tried=10**9)
NOBODY, UNSURE, ALWAYS, BEFORE = "nobody", "where unsure", "always", "recorded in advance"


@dataclass(frozen=True)
class Outcome:
    """One run: who was asked, how many steps were shown, and the returns at ``AT``."""

    seed: int
    asked: str
    shown: int
    returns: list[float]


def learned(
    env: gymnasium.Env[Any, Any], preset: str, demos: eutree.Demonstrations | None, **options: Any
) -> tuple[Any, list[float]]:
    """Return a run's result and the mean returns of its curve at ``AT``."""
    result = eutree.learn(
        env,
        demonstrations=demos,
        method=preset,
        episodes=AT[-1],
        evaluate_every=20,
        evaluation_episodes=200,
        **options,
    )
    curve = {point.episode: point.mean_return for point in result.curve}
    return result, [curve[episode] for episode in AT]


def asked(env: gymnasium.Env[Any, Any], preset: str, n: int, who: str, seed: int) -> Outcome:
    """Learn with somebody to ask, or with nobody, from ``n`` demonstrations."""
    gate = eutree.experts.wait_at_crossing
    demos = eutree.record(env, gate, episodes=n, seed=seed) if n else None
    confidence = NEVER_SURE if who == ALWAYS else Confidence()
    alone = 0 if who == ALWAYS else Asking().alone
    asking = Asking(max_requests=15, alone=alone, confidence=confidence)
    ask = None if who == NOBODY else gate(env)
    result, returns = learned(env, preset, demos, ask=ask, asking=asking, seed=seed)
    before = 0 if demos is None else demos.n_transitions
    shown = int(result.history.demonstrated.sum()) - before
    return Outcome(seed, who, shown, returns)


def recorded(env: gymnasium.Env[Any, Any], preset: str, n: int, steps: int, seed: int) -> Outcome:
    """Learn from ``n`` demonstrations and as many more as have ``steps`` steps together."""
    demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=n + 60, seed=seed)
    lengths = np.array([len(episode) for episode in demos.episodes])
    own = int(lengths[:n].sum())
    more = int(np.searchsorted(np.cumsum(lengths[n:]), steps)) + 1
    chosen = replace(demos, episodes=demos.episodes[: n + more])
    _, returns = learned(env, preset, chosen, seed=seed)
    return Outcome(seed, BEFORE, chosen.n_transitions - own, returns)


def outcomes(arguments: argparse.Namespace) -> list[Outcome]:
    """Return all runs, those of an earlier start from their file."""
    path, known = arguments.keep, list[Outcome]()
    if path is not None and path.exists():
        known = [Outcome(**json.loads(line)) for line in path.read_text().splitlines()]
    found = {(run.seed, run.asked): run for run in known}
    env = gymnasium.make("eutree/Evasion2-v0")
    preset, n = arguments.preset, arguments.demonstrations
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
        for who in (NOBODY, UNSURE, ALWAYS, BEFORE):
            if (seed, who) in found:
                continue
            if who == BEFORE:
                run = recorded(env, preset, n, found[seed, UNSURE].shown, seed)
            else:
                run = asked(env, preset, n, who, seed)
            found[seed, who] = run
            if path is not None:
                with path.open("a") as file:
                    file.write(json.dumps(asdict(run)) + "\n")
    return list(found.values())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", default="default")
    parser.add_argument("--demonstrations", type=int, default=3)
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--keep", type=Path)
    runs = outcomes(parser.parse_args())
    columns = " | ".join(f"return at {episode}" for episode in AT)
    print(f"| asked | steps shown | {columns} |\n|---|---|{'---|' * len(AT)}")
    tables: dict[str, Any] = {}
    for who in (NOBODY, UNSURE, ALWAYS, BEFORE):
        chosen = sorted((run for run in runs if run.asked == who), key=lambda run: run.seed)
        tables[who] = np.array([run.returns for run in chosen])  # [seeds, AT]
        steps = np.mean([run.shown for run in chosen])
        print(f"| {who} | {steps:.0f} | {cells(tables[who])} |")
    for other in (NOBODY, ALWAYS, BEFORE):
        print(f"| where unsure - {other} | | {cells(tables[UNSURE] - tables[other])} |")


def cells(values: np.ndarray) -> str:
    """Return means with intervals, one cell for each column of ``values`` [seeds, AT]."""
    found = []
    for column in values.T:
        low, high = mean_interval(column)
        found.append(f"{column.mean():.1f} ({low:.1f} to {high:.1f})")
    return " | ".join(found)


if __name__ == "__main__":
    main()
