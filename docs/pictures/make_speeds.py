"""Write docs/results/speeds.md: the default learner at 21 opponent speeds.

eutree reproduce figure-5 --preset default --out results
python docs/pictures/make_speeds.py --results results
"""

import argparse
import shutil
from pathlib import Path

from eutree.evaluation.bootstrap import bootstrap
from eutree.experiments.experiment import FULL, by_learner, by_speed
from eutree.experiments.registry import EXPERIMENTS
from eutree.experiments.reproduce import claims_to_markdown, reproduce
from eutree.experiments.results import Results

DOCS = Path(__file__).resolve().parents[1]
NAMES = ("figure-4b", "figure-5")

INTRODUCTION = """# The default learner at other opponent speeds

Figures 4(b) and 5 of the paper with the `default` preset: 15 demonstrations at 3.2 m/s, then 400
episodes at each of 21 speeds, 15 runs each; 1,000 fresh episodes at the end; 95 % bootstrap
intervals over runs. Made by `eutree reproduce figure-5 --preset default --out results` and
`python docs/pictures/make_speeds.py --results results`.

"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"))
    folder = parser.parse_args().results
    text = INTRODUCTION
    for name in NAMES:
        experiment = EXPERIMENTS[name]
        found = reproduce([experiment], folder, scale=FULL, presets=("default",))
        shutil.copy(folder / f"{name}.svg", DOCS / "results" / "figures" / f"{name}-default.svg")
        text += f"## {experiment.title}\n\n![{experiment.title}](figures/{name}-default.svg)\n\n"
        text += claims_to_markdown(found.claims) + "\n"
    (DOCS / "results" / "speeds.md").write_text(text + table(folder), encoding="utf-8")


def table(folder: Path) -> str:
    """Return what is reached at each speed, a row each."""
    lines = [
        "## At each speed",
        "",
        "| m/s | expert tree: success % | learned: success % | return | leaves |",
        "|---|---|---|---|---|",
    ]
    records = Results(folder).load(EXPERIMENTS["figure-5"].specs(FULL, "default"))
    for speed, runs in by_speed(by_learner(records)["eu-tree"]).items():
        columns = [
            [100 * run.expert.success for run in runs if run.expert is not None],
            [100 * run.final.success for run in runs],
            [run.final.mean_return for run in runs],
            [run.final.n_leaves for run in runs],
        ]
        cells = []
        for values in columns:
            found = bootstrap(values)
            low, high = found.interval
            cells.append(f"{found.value:.1f} [{low:.1f}, {high:.1f}]")
        lines.append(f"| {speed:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
