"""Write docs/results/speeds.md: the default learner at 21 opponent speeds.

python benchmarks/grid_value_iteration.py --csv docs/results/grid-value-iteration.csv
eutree reproduce figure-5 --preset default --domain Evasion --out results
python docs/pictures/make_speeds.py --results results
"""

import argparse
import csv
import shutil
from dataclasses import replace
from pathlib import Path

from eutree.evaluation.evaluation import Estimate
from eutree_lab.paper.claims import HOLDS, judged
from eutree_lab.paper.experiment import FULL, by_learner, by_speed
from eutree_lab.paper.reproduce import EXPERIMENTS, claims_to_markdown, reproduce
from eutree_lab.paper.results import Results
from eutree_lab.paper.runs import RunRecord
from eutree_lab.statistics import bootstrap

DOCS = Path(__file__).resolve().parents[1]
SCALE = replace(FULL, domain="Evasion")
NAMES = ("figure-4b", "figure-5")

INTRODUCTION = """# The default learner at other opponent speeds

Figures 4(b) and 5 of the paper with the `default` preset: 15 demonstrations at 3.2 m/s, then 400
episodes at each of 21 speeds, 15 runs each; 1,000 fresh episodes at the end; 95\u00a0% bootstrap
intervals over runs. Made by `eutree reproduce figure-5 --preset default --domain Evasion` and
`python docs/pictures/make_speeds.py --results results`.

"""

NO_BREAK = "\u00a0"  # a space at which no line ends
SHARE = 0.96  # of what the grid reaches

GRID = """The bar is what value iteration reaches on a grid of what the learner too can see:
30 x 22 x 22 cells over the positions, their model estimated from {transitions:,} steps of random
play at each speed and solved exactly, its policy evaluated on {episodes:,} fresh episodes (standard
error of its return at most {error:.1f}). It is a bar and not a bound, as it averages within its
cells and over the hidden directions. Made by
`python benchmarks/grid_value_iteration.py --csv docs/results/grid-value-iteration.csv`.

**At {held} of {all} speeds the learner's return is at least {share} % of the grid's**, the whole
interval over its runs counted. The smallest ratio is {least:.3f}, at {where:g} m/s; at {below} of
{all} speeds the learner's return is below the grid's.

"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--grid", type=Path, default=DOCS / "results" / "grid-value-iteration.csv")
    options = parser.parse_args()
    folder = options.results
    text = INTRODUCTION
    for name in NAMES:
        experiment = EXPERIMENTS[name]
        found = reproduce([experiment], folder, scale=SCALE, presets=("default",))
        shutil.copy(folder / f"{name}.svg", DOCS / "results" / "figures" / f"{name}-default.svg")
        text += f"## {experiment.title}\n\n![{experiment.title}](figures/{name}-default.svg)\n\n"
        text += claims_to_markdown(found.claims) + "\n"
    records = Results(folder).load(EXPERIMENTS["figure-5"].specs(SCALE, "default"))
    speeds = by_speed(by_learner(records)["eu-tree"])
    with options.grid.open(encoding="utf-8", newline="") as file:
        grid = {float(row["speed"]): row for row in csv.DictReader(file)}
    text += table(speeds) + "\n" + beside_the_grid(speeds, grid)
    (DOCS / "results" / "speeds.md").write_text(text, encoding="utf-8")


def table(speeds: dict[float, list[RunRecord]]) -> str:
    """Return what is reached at each speed, a row each."""
    lines = [
        "## At each speed",
        "",
        "| m/s | expert tree: success % | learned: success % | return | leaves |",
        "|---|---|---|---|---|",
    ]
    for speed, runs in speeds.items():
        columns = [
            [100 * run.expert.success for run in runs if run.expert is not None],
            [100 * run.final.success for run in runs],
            [run.final.mean_return for run in runs],
            [run.final.n_leaves for run in runs],
        ]
        cells = [_number(bootstrap(values), 1) for values in columns]
        lines.append(f"| {speed:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def beside_the_grid(speeds: dict[float, list[RunRecord]], grid: dict[float, dict[str, str]]) -> str:
    """Return the learner's return beside that of value iteration on a grid, with a verdict."""
    rows, ratios, verdicts = [], {}, []
    for speed, runs in speeds.items():
        reached = float(grid[speed]["return"])
        ratio = bootstrap([run.final.mean_return / reached for run in runs])
        claim = judged("grid", "", paper="", estimate=ratio, low=SHARE, rule="")
        ratios[speed], verdicts = ratio.value, [*verdicts, claim.holds]
        learned = bootstrap([run.final.mean_return for run in runs])
        rows.append(
            f"| {speed:g} | {100 * float(grid[speed]['success']):.1f} | {reached:.1f} "
            f"| {_number(learned, 1)} | {_number(ratio, 3)} | **{claim.holds}** |"
        )
    used = [grid[speed] for speed in speeds]
    where = min(ratios, key=lambda speed: ratios[speed])
    introduction = GRID.format(
        transitions=int(used[0]["transitions"]),
        episodes=int(used[0]["episodes"]),
        error=max(float(row["standard_error"]) for row in used),
        held=verdicts.count(HOLDS),
        all=len(rows),
        share=round(100 * SHARE),
        least=ratios[where],
        where=where,
        below=sum(ratio < 1.0 for ratio in ratios.values()),
    )
    head = [
        "| m/s | grid: success % | grid: return | learned: return | learned / grid "
        f"| at least {SHARE:g} |",
        "|---|---|---|---|---|---|",
    ]
    return (
        "## Beside value iteration on a grid\n\n" + introduction + "\n".join([*head, *rows]) + "\n"
    )


def _number(found: Estimate, digits: int) -> str:
    low, high = found.interval
    text = f"{found.value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
    return text.replace(" ", NO_BREAK)


if __name__ == "__main__":
    main()
