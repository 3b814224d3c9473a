"""Renew the tables and figures of docs/results/framework.md from a folder of results.

    python docs/pictures/make_framework.py --results results [--runs 15] [--seed 100]

Nothing is run: ``eutree reproduce framework`` does that. Seeds that lack a run are left out. The
sections without tables are written by hand and stay as they are.
"""

import argparse
import shutil
from pathlib import Path

from eutree_lab.framework.report import FrameworkResults, report
from eutree_lab.framework.runs import TASKS, specs
from eutree_lab.framework.verdicts import EXPECTATIONS

PAGE = Path(__file__).resolve().parents[1] / "results" / "framework.md"
HEAD = (
    "| task | demonstrator | poor: late by | demonstrations | episodes | update every | "
    "evaluated every | on | final |\n|---|---|---|---|---|---|---|---|---|"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--seed", type=int, default=100)
    options = parser.parse_args()
    sections = {"The tasks": tasks(), "What was expected": expectations_to_markdown() + "\n"}
    if options.results is not None:
        wanted = specs(runs=options.runs, first_seed=options.seed)
        folder = report(wanted, FrameworkResults(options.results)).folder
        sections |= divided((folder / "framework.md").read_text(encoding="utf-8"))
        for picture in folder.glob("framework-*.svg"):
            shutil.copy(picture, PAGE.parent / "figures" / picture.name)
    beginning, _, _ = (text := PAGE.read_text(encoding="utf-8")).partition("\n## ")
    page = divided(text) | sections
    parts = [beginning.rstrip("\n"), *(f"## {title}\n\n{s}" for title, s in page.items())]
    PAGE.write_text("\n\n".join(part.rstrip("\n") for part in parts) + "\n", encoding="utf-8")


def expectations_to_markdown() -> str:
    """Return what was expected, as a table."""
    lines = ["| method | sentence | expected | because |", "|---|---|---|---|"]
    lines += [f"| `{e.method}` | {e.sentence} | {e.expected} | {e.reason} |" for e in EXPECTATIONS]
    return "\n".join(lines)


def tasks() -> str:
    """Return the tasks and how much of each is run."""
    rows = [
        f"| {t.title} | `{t.demonstrator}` | {t.delay} steps | {t.demonstrations} | {t.episodes} "
        f"| {t.gathering_episodes} | {t.evaluate_every} | {t.evaluation_episodes} "
        f"| {t.final_episodes} |"
        for t in TASKS.values()
    ]
    return "\n".join([HEAD, *rows])


def divided(text: str) -> dict[str, str]:
    """Return the sections of a page by their titles."""
    _, *parts = ("\n" + text).split("\n## ")
    return {title: body.strip("\n") for title, _, body in (part.partition("\n") for part in parts)}


if __name__ == "__main__":
    main()
