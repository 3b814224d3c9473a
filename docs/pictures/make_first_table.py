"""Write docs/results/first-table.md, the README's first table: what a reader would end with.

Of every run of Figure 2 the last frozen evaluation, of the policy after 400 episodes, in place of
the best of all evaluations: the best of many is better the more an evaluation varies.

    python docs/pictures/make_first_table.py
"""

import csv
from pathlib import Path

import numpy as np

from eutree.evaluation import mean_interval

RESULTS = Path(__file__).resolve().parents[1] / "results"
ENVIRONMENT = "eutree/Evasion2-v0"
LAST = "400"
ROWS = {  # learner, preset and episode of each row
    "expert tree of the demonstrations": ("eu-tree", "paper-d", "0"),
    "C. U-Tree, read literally (`paper-d`)": ("c-u-tree", "paper-d", LAST),
    "EU-Tree, read literally (`paper-d`)": ("eu-tree", "paper-d", LAST),
    "C. U-Tree, `default`": ("c-u-tree", "default", LAST),
    "EU-Tree, `default`": ("eu-tree", "default", LAST),
}
PAGE = """# The first table: what a reader ends with

Made by `python docs/pictures/make_first_table.py` from the runs of
[Figure 2](paper-first-domain.md) in `paper-first-domain-points.csv`: {n} runs, 400 episodes in
2-Evasion, 15 demonstrations of the gate rule (the C. U-Tree begins from nothing). Each run's last
policy plays 100 frozen episodes that it did not learn from, the same for all learners of a seed;
means with 95 % intervals over runs. No policy is chosen by its results. What the default EU-Tree of
today makes of them is on [its own page](default-learner.md): 99.4 %, 92.6 and 13.4 leaves.

| | success % | reward | leaves |
|---|---|---|---|
"""


def main() -> None:
    with (RESULTS / "paper-first-domain-points.csv").open(newline="") as file:
        points = [row for row in csv.DictReader(file) if row["environment"] == ENVIRONMENT]
    lines, counts = [], set()
    for title, key in ROWS.items():
        found = [p for p in points if (p["learner"], p["preset"], p["episode"]) == key]
        counts.add(len(found))
        columns = ([scale * float(p[name]) for p in found] for name, scale in
                   (("success", 100), ("mean_return", 1), ("n_leaves", 1)))  # fmt: skip
        lines.append(f"| {title} | {' | '.join(map(_mean, columns))} |\n")
    (n,) = counts
    (RESULTS / "first-table.md").write_text(PAGE.format(n=n) + "".join(lines))


def _mean(values: list[float]) -> str:
    low, high = mean_interval(values)
    return f"{np.mean(values):.1f} [{low:.1f}, {high:.1f}]"


if __name__ == "__main__":
    main()
