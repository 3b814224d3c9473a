"""Write docs/results/paper.md and its figures from a folder of results.

    python docs/pictures/make_paper_results.py --results results [--only figure-2 table-2]

Runs that the folder lacks are done first (half an hour on one core for all of them). With
``--only`` the other sections of the page stay as they are. What no setting reaches is read from
docs/results/search.csv.
"""

import argparse
import csv
import math
import shutil
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from textwrap import wrap

from eutree_lab.paper.claims import FAILS, HOLDS, OPEN
from eutree_lab.paper.experiment import FULL
from eutree_lab.paper.reproduce import (
    EXPERIMENTS,
    claims_to_markdown,
    number_text,
    reproduce,
)
from eutree_lab.paper.results import Results

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the paper's numbers
from benchmarks.paper_numbers import NUMBERS

DOCS = Path(__file__).resolve().parents[1]
VERDICTS = (HOLDS, FAILS, OPEN)
PRESETS = dict.fromkeys(
    ("figure-2", "figure-3", "table-2", "figure-4a", "figure-4b", "figure-5", "expert",
     "compression"),
    ("paper",),
)  # fmt: skip
# Seeds that nothing was chosen on: the search has those from 7000, sensitivity those from 1000,
# and the first domain was judged on those from 0.
JUDGED = replace(FULL, first_seed=2006)

CONSTANTS = (
    "Lengths, speeds and rewards are those that the paper states, at every setting. Of what it "
    "does not state, the first domain had opponents anywhere on their paths at the start, a "
    "collision within 2 m and noise of 2 %; the one found has them at an end of their paths, 1 m "
    "and 5 %, the same step of 1 s, and demonstrations that take 5.3 minutes for 15 trials (the "
    "paper: approximately five)."
)

INTRODUCTION = """# The paper's claims, with a verdict each

{counts}

15 runs of 400 episodes of each learner on seeds from 2006 on, 15 demonstrations of the scripted
gate rule for each run, 100 evaluation episodes every 20 episodes; intervals are 95 % bootstrap
intervals over runs. The expert tree is shown, and the EU-Tree learns, at the paper's
21 opponent speeds. `paper` is the reading of the paper and `eutree/PaperEvasion2-v0` the
domain that [the search](search.md) found ([the decision](../decisions/paper-preset.md),
[what it took](../reproducing-2006.md), [protocol](../reproducing.md)). What was found before, in
`eutree/Evasion2-v0` and with three presets, is on [a page of its own](paper-first-domain.md).
`paper-points.csv` holds every evaluation of every run of Figures 2 and 3.

The rule for a final policy is part of the reading: "95 % twice" here, the last policy on the page
of the first domain. So part of the difference between the two pages is that rule, and not the
domain.

Made by `python docs/pictures/make_paper_results.py --results results`, which is `eutree reproduce`
for each experiment.
"""


UNTOLD = "What would tell the rest"
UNTOLD_TEXT = """If our number stays what it is and its interval shrinks with the root of the
runs. Where our number is just what decides, more runs tell nothing: the expert tree is as good at
one speed as at another here, so that learning time has nothing to follow."""


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
    if set(options.only) == set(PRESETS):
        text += "\n" + _untold(options.results)
    elif UNTOLD in sections:
        text += f"\n## {UNTOLD}\n\n{sections[UNTOLD]}\n"
    page.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    points = DOCS / "results" / "paper-points.csv"
    points.write_text(_points(options.results, ("figure-2", "figure-3")), encoding="utf-8")


def _section(name: str, folder: Path) -> tuple[str, str]:
    """Return the title and the text of one experiment's section; copy its figure."""
    experiment = EXPERIMENTS[name]
    found = reproduce([experiment], folder, scale=JUDGED, presets=PRESETS[name])
    picture = ""
    if experiment.draw is not None:
        figures = DOCS / "results" / "figures"
        figures.mkdir(exist_ok=True)
        shutil.copy(folder / f"{name}.svg", figures / f"{name}.svg")
        picture = f"![{experiment.title}](figures/{name}.svg)\n\n"
    return experiment.title, picture + claims_to_markdown(found.claims).rstrip("\n")


def _untold(folder: Path) -> str:
    """Return what would tell the claims that cannot be told."""
    rows = []
    for name in PRESETS:
        found = reproduce([EXPERIMENTS[name]], folder, scale=JUDGED, presets=PRESETS[name])
        for claim in found.claims:
            if claim.holds != OPEN:
                continue
            more = "no number of runs" if claim.times is None else (
                f"{math.ceil(claim.times * JUDGED.runs)} runs"
            )  # fmt: skip
            leans = HOLDS if claim.is_inside else FAILS
            would = "-" if claim.times is None else leans
            rows.append(f"| `{claim.id}` | {number_text(claim)} | {more} | {would} |")
    head = "| claim | ours [95 % interval] | told by, about | it would then |\n|---|---|---|---|\n"
    return f"## {UNTOLD}\n\n{UNTOLD_TEXT}\n\n{head}" + "\n".join(rows) + "\n"


def _sections(page: str) -> list[tuple[str, str]]:
    """Return the titles and texts of a page's sections."""
    parts = page.split("\n## ")[1:]
    return [(title, text.strip("\n")) for title, _, text in (p.partition("\n") for p in parts)]


def _counts(body: str) -> str:
    """Return the first paragraph: how many claims have which verdict, and what none reaches."""
    rows = [line.split(" | ") for line in body.splitlines() if line.startswith("| `")]
    found = Counter(row[5].strip("*") for row in rows)
    table = (DOCS / "results" / "search.csv").read_text(encoding="utf-8")
    tried = list(csv.DictReader(table.splitlines()))
    told = {n: [float(row[n.name]) for row in tried if row[n.name]] for n in NUMBERS}
    never = [n for n, values in told.items() if values and all(n.missed_by(v) for v in values)]
    names = "; ".join(f"{n.name} ({n.paper}), told by {len(told[n])}" for n in never)
    under_none = f"Under none of them do these agree: {names}." if never else (
        "There is none of its numbers that agrees under no setting."
    )  # fmt: skip
    text = (
        f"**With one reading and in one domain {found[HOLDS]} of {len(rows)} claims hold, "
        f"{found[FAILS]} do not hold and {found[OPEN]} cannot be told.** {len(tried)} settings of "
        f"what the paper leaves open were tried. {under_none} {CONSTANTS}"
    )
    return "\n".join(wrap(text, 100))


def _points(folder: Path, names: tuple[str, ...]) -> str:
    """Return every evaluation of every run, a row each."""
    lines = ["environment,learner,preset,seed,episode,success,mean_return,n_leaves"]
    specs = [s for n in names for p in PRESETS[n] for s in EXPERIMENTS[n].specs(JUDGED, p)]
    for record in Results(folder).load(dict.fromkeys(specs)):
        spec = record.spec
        run = f"{spec.environment},{spec.learner},{spec.preset},{spec.seed}"
        lines += [
            f"{run},{p.episode},{p.success:g},{p.mean_return:g},{p.n_leaves}" for p in record.curve
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
