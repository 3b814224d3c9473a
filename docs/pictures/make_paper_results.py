"""Write docs/results/paper.md and its figures from a folder of results.

    python docs/pictures/make_paper_results.py --results results

Runs that the folder lacks are done first (about an hour on one core for all of them).
"""

import argparse
import shutil
from pathlib import Path

from eutree.experiments.experiment import FULL
from eutree.experiments.registry import EXPERIMENTS
from eutree.experiments.reproduce import claims_to_markdown, reproduce

DOCS = Path(__file__).resolve().parents[1]
READINGS = ("paper", "paper-d")
PRESETS = {
    "figure-2": (*READINGS, "default"),
    "figure-3": (*READINGS, "default"),
    "table-2": (*READINGS, "default"),
    "figure-4a": ("paper",),
    "figure-4b": ("paper",),
    "figure-5": ("paper",),
    "expert": ("paper",),
    "compression": (*READINGS, "default"),
}

INTRODUCTION = """# The paper's claims, with a verdict each

{counts}

15 runs of 400 episodes of each learner, 15 demonstrations of the scripted gate rule for each run,
100 evaluation episodes every 20 episodes; intervals are 95 % bootstrap intervals over runs. `paper`
and `paper-d` are the two readings of the paper's split rule, `default` is the learner that we
recommend ([the paper preset](../decisions/paper-preset.md),
[how the default learner works](../learning.md), [protocol](../reproducing.md)). Figures 4
and 5 have not been run with the `default` preset at full scale; [other cases of the default
learner](default-learner.md) are on a page of their own.

Made by `python docs/pictures/make_paper_results.py --results results`, which is `eutree reproduce`
for each experiment.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"))
    folder = parser.parse_args().results
    figures = DOCS / "results" / "figures"
    figures.mkdir(exist_ok=True)
    sections, verdicts = [], []
    for name, presets in PRESETS.items():
        experiment = EXPERIMENTS[name]
        found = reproduce([experiment], folder, scale=FULL, presets=presets)
        verdicts += [(claim.preset, claim.holds) for claim in found.claims]
        section = f"## {experiment.title}\n\n"
        if experiment.draw is not None:
            shutil.copy(folder / f"{name}.svg", figures / f"{name}.svg")
            section += f"![{experiment.title}](figures/{name}.svg)\n\n"
        sections.append(section + claims_to_markdown(found.claims))
    counts = []
    for preset in dict.fromkeys(preset for preset, _ in verdicts):
        mine = [holds for p, holds in verdicts if p == preset]
        listing = ", ".join(f"{mine.count(v)} {v}" for v in dict.fromkeys(mine))
        counts.append(f"`{preset}`: {listing}.")
    text = INTRODUCTION.format(counts=" ".join(counts)) + "\n" + "\n".join(sections)
    (DOCS / "results" / "paper.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
