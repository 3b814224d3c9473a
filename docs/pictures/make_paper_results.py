"""Write docs/results/paper.md and its figures from a folder of results.

    python docs/pictures/make_paper_results.py --results results [--only figure-2 table-2]

Runs that the folder lacks are done first (about an hour on one core for all of them). With
``--only`` the other sections of the page stay as they are.
"""

import argparse
import shutil
from collections import Counter
from pathlib import Path

from eutree.experiments.claims import FAILS, HOLDS, OPEN
from eutree.experiments.experiment import FULL
from eutree.experiments.registry import EXPERIMENTS
from eutree.experiments.reproduce import claims_to_markdown, reproduce
from eutree.experiments.results import Results

DOCS = Path(__file__).resolve().parents[1]
VERDICTS = (HOLDS, FAILS, OPEN)
READINGS = ("paper", "paper-d")
PRESETS = {
    "figure-2": (*READINGS, "default"),
    "figure-3": (*READINGS, "default"),
    "table-2": (*READINGS, "default"),
    "figure-4a": ("paper",),
    "figure-4b": ("paper", "default"),
    "figure-5": ("paper", "default"),
    "expert": ("paper",),
    "compression": (*READINGS, "default"),
}

INTRODUCTION = """# The paper's claims, with a verdict each

{counts}

15 runs of 400 episodes of each learner, 15 demonstrations of the scripted gate rule for each run,
100 evaluation episodes every 20 episodes; intervals are 95 % bootstrap intervals over runs. `paper`
and `paper-d` are the two readings of the paper's split rule, `default` is the learner that we
recommend ([the paper preset](../decisions/paper-preset.md),
[how the default learner works](../learning.md), [protocol](../reproducing.md)). How the `default`
preset does at each opponent speed, beside value iteration on a grid, is on
[a page of its own](speeds.md), and so are [other cases](default-learner.md). `paper-points.csv`
holds every evaluation of every run of Figures 2 and 3.

Made by `python docs/pictures/make_paper_results.py --results results`, which is `eutree reproduce`
for each experiment.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--only", nargs="+", choices=list(PRESETS), default=list(PRESETS))
    options = parser.parse_args()
    page = DOCS / "results" / "paper.md"
    sections = dict(_sections(page.read_text(encoding="utf-8"))) if page.exists() else {}
    for name in options.only:
        title, text = _section(name, options.results)
        sections[title] = text
    order = [EXPERIMENTS[name].title for name in PRESETS]
    body = "\n".join(f"## {title}\n\n{sections[title]}\n" for title in order if title in sections)
    text = INTRODUCTION.format(counts=_counts(body)) + "\n" + body
    page.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    points = DOCS / "results" / "paper-points.csv"
    points.write_text(_points(options.results, ("figure-2", "figure-3")), encoding="utf-8")


def _section(name: str, folder: Path) -> tuple[str, str]:
    """Return the title and the text of one experiment's section; copy its figure."""
    experiment = EXPERIMENTS[name]
    found = reproduce([experiment], folder, scale=FULL, presets=PRESETS[name])
    picture = ""
    if experiment.draw is not None:
        figures = DOCS / "results" / "figures"
        figures.mkdir(exist_ok=True)
        shutil.copy(folder / f"{name}.svg", figures / f"{name}.svg")
        picture = f"![{experiment.title}](figures/{name}.svg)\n\n"
    return experiment.title, picture + claims_to_markdown(found.claims).rstrip("\n")


def _sections(page: str) -> list[tuple[str, str]]:
    """Return the titles and texts of a page's sections."""
    parts = page.split("\n## ")[1:]
    return [(title, text.strip("\n")) for title, _, text in (p.partition("\n") for p in parts)]


def _counts(body: str) -> str:
    """Return how many claims have which verdict, a row each preset."""
    rows = [line.split(" | ") for line in body.splitlines() if line.startswith("| `")]
    found = Counter((row[3], row[5].strip("*")) for row in rows)
    lines = [f"| preset | {' | '.join(VERDICTS)} |", "|---" * (len(VERDICTS) + 1) + "|"]
    for preset in dict.fromkeys(preset for preset, _ in found):
        numbers = " | ".join(str(found[preset, verdict]) for verdict in VERDICTS)
        lines.append(f"| `{preset}` | {numbers} |")
    return "\n".join(lines)


def _points(folder: Path, names: tuple[str, ...]) -> str:
    """Return every evaluation of every run, a row each."""
    lines = ["environment,learner,preset,seed,episode,success,mean_return,n_leaves"]
    specs = [s for n in names for p in PRESETS[n] for s in EXPERIMENTS[n].specs(FULL, p)]
    for record in Results(folder).load(dict.fromkeys(specs)):
        spec = record.spec
        run = f"{spec.environment},{spec.learner},{spec.preset},{spec.seed}"
        lines += [
            f"{run},{p.episode},{p.success:g},{p.mean_return:g},{p.n_leaves}" for p in record.curve
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
