"""Draw the learning curves of docs/reproducing-2006.md from the tables beside the verdicts.

    python docs/pictures/make_reproducing_2006.py

The other figure of that page is the search's: docs/pictures/make_search.py.
"""

import csv
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eutree_lab.paper import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = Path(__file__).resolve().parents[1] / "results"
PANELS = {
    "first constants, untried actions worth 0": "paper-first-domain-points.csv",
    "the constants and the reading found": "paper-points.csv",
}

Curves = dict[str, dict[str, dict[int, float]]]  # learner, seed, episode: success


def curves(path: Path) -> Curves:
    """Return the success of every run of the preset ``paper`` in 2-Evasion."""
    found: Curves = defaultdict(lambda: defaultdict(dict))
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["preset"] == "paper" and "Evasion2" in row["environment"]:
                found[row["learner"]][row["seed"]][int(row["episode"])] = float(row["success"])
    return found


def figure() -> "Figure":
    """Return the two panels side by side."""
    whole = drawing.blank("2-Evasion, 15 runs each, mean and 95 % interval", (9.0, 3.4))
    axes = whole.subplots(1, len(PANELS), sharey=True)
    for axis, (title, name) in zip(axes, PANELS.items(), strict=True):
        for learner, runs in curves(RESULTS / name).items():
            episodes = sorted(next(iter(runs.values())))
            success = np.array([[100 * run[e] for e in episodes] for run in runs.values()])
            drawing.curve(axis, episodes, success, drawing.LABELS[learner])
        axis.set_title(title, fontsize=10)
        drawing.clear(axis)
        drawing.label(axis, "Episodes", "Success (%)", limits=(-2, 102))
    return whole


def main() -> None:
    (svg,) = drawing.drawn("reproducing-2006", figure, "svg")
    (RESULTS / "figures" / "reproducing-2006.svg").write_bytes(svg)


if __name__ == "__main__":
    main()
