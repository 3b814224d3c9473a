"""Does cutting the seconds that hurt make the tree better? Simulated people, fresh episodes.

    python benchmarks/hurting.py [--folders 20] [--first 1000] [--keep FILE]

Folders are those of ``benchmarks/people.py``; 0 to 999 are for tuning. For each one
``eutree.fitting.hurting.find_hurting`` looks for what to cut or flip. Four trees then play the same
further episodes, of a seed that no choice saw: the tree of C4.5 that the search began with and the
one it ended with, and what ``eutree.fit`` makes of the folder and of what is left of it.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import eutree
from eutree.arrays import Floats
from eutree.fitting.hurting import find_hurting
from people import FIRST_REPORTED, JUDGED, JUDGING_SEED, TASKS, Finished, folder

RESAMPLED = 10_000  # folders drawn again for a range


@dataclass(frozen=True)
class Row:
    """One folder; results are shares of successes."""

    number: int
    style: str
    cut: int
    flipped: int
    steps: int
    before: float
    after: float
    fit_before: float
    fit_after: float
    tried: int
    played: int

    def __str__(self) -> str:
        """Return the row of the table."""
        reached = (self.before, self.after, self.fit_before, self.fit_after)
        counts = (self.cut, self.flipped, self.steps)
        cells = (self.number, self.style, *counts, *(f"{v:.3f}" for v in reached))
        return f"| {' | '.join(map(str, cells))} | {self.tried} | {self.played} |"


HEAD = """| folder | style | cuts | flips | steps | tree | without | `fit` | without | trees | \
episodes |
|---|---|---|---|---|---|---|---|---|---|---|"""


def row(task: str, number: int, judged: int) -> Row:
    """Return what comes of one folder."""
    env, shown = TASKS[task].make(), folder(task, number)
    found = find_hurting(shown, env)
    changed = [one for one in found.hurts if one.after is not None]
    fits = [eutree.fit(each, env).policy for each in (shown, found.edited)]
    reached = []
    for tree in (found.before, found.after, *fits):
        played = eutree.evaluate(tree, env, episodes=judged, seed=JUDGING_SEED)
        reached.append(float(played.success_rate or 0.0))
    return Row(
        number,
        shown.expert.removeprefix("by "),
        sum(one.what == "cut" for one in changed),
        sum(one.what == "flip" for one in changed),
        sum(part.stop - part.start for one in changed for part in one.segments),
        *reached,
        found.tried,
        found.episodes_played,
    )


def summary(rows: Sequence[Row]) -> str:
    """Return the mean gains with their ranges, of folders drawn again."""
    lines = []
    pairs = {
        "the tree": np.array([one.after - one.before for one in rows]),
        "`fit`": np.array([one.fit_after - one.fit_before for one in rows]),
        "the tree, where something was named": np.array(
            [one.after - one.before for one in rows if one.cut + one.flipped]
        ),
        "`fit`, where something was named": np.array(
            [one.fit_after - one.fit_before for one in rows if one.cut + one.flipped]
        ),
    }
    for name, gains in pairs.items():
        low, high = _range(gains)
        lines.append(
            f"| {name} | {gains.size} | {100 * gains.mean():+.1f} | {100 * low:+.1f} to "
            f"{100 * high:+.1f} | {(gains > 0).sum()} | {(gains < 0).sum()} | "
            f"{100 * gains.min():+.1f} |"
        )
    head = "| gain of | folders | mean, points | 95 % range | better | worse | worst |"
    return "\n".join([head, "|" + "---|" * 7, *lines])


def _range(gains: Floats) -> tuple[float, float]:
    drawn = np.random.default_rng(0).choice(gains, (RESAMPLED, gains.size)).mean(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=TASKS, default="evasion")
    parser.add_argument("--folders", type=int, default=20)
    parser.add_argument("--first", type=int, default=FIRST_REPORTED)
    parser.add_argument("--judged", type=int, default=JUDGED)
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    finished, rows = Finished(arguments.keep), []
    print(HEAD)
    for number in range(arguments.first, arguments.first + arguments.folders):
        known = finished.get(number)
        found = Row(**known) if known else row(arguments.task, number, arguments.judged)
        if known is None and arguments.keep is not None:
            with arguments.keep.open("a") as file:
                file.write(json.dumps(asdict(found)) + "\n")
        rows.append(found)
        print(found, flush=True)
    print(f"\n{summary(rows)}")


if __name__ == "__main__":
    main()
