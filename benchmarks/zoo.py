"""Choose the trees of the zoo: of those that the table's runs kept, the best at each size.

Run: python -m benchmarks.zoo FOLDER [--tasks TASK ...] [--episodes 1000]

FOLDER holds the trees of ``python benchmarks/table.py TASK --trees FOLDER``. The three of each task
and size that earned most there play 1,000 fresh episodes. Of those that earn no less than the best
one, as far as its 95 % interval tells, the one is chosen whose worst hundredth of episodes earns
most: a card is for somebody who lets the tree act. 1,000 others, which chose nothing, are what its
card says. A tree that is no better than a smaller one is left out. What
``eutree prove`` says within its usual limits is on the card, where the task has a plant. With
``--tasks`` the trees of other tasks stay; ``benchmarks/zoo_page.py`` renews the page.
"""

import argparse
import json
import math
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.table import OURS, Settings, cell_of, rows_of, tree_of

import eutree
from eutree import zoo
from eutree.evaluation import mean_interval
from eutree.interaction.making import make
from eutree.proof import plant_of, prove
from eutree.schema import EnvironmentSpec

ROOT = Path(__file__).resolve().parents[1]
HOME = ROOT / "src" / "eutree" / "zoo"
SIZES = (4, 8, 16, 32)
CHOOSING, JUDGING = 5_000_000, 7_000_000  # seeds of the episodes that choose, and that judge
EXTRAS = {"LunarLander-v3": "gymnasium[box2d]"}
FINALISTS = 3
WORST = 0.01  # of the episodes, which decide among trees that earn the same


def rows() -> list[dict[str, str]]:
    """Return all rows of the table that are ours."""
    paths = sorted((ROOT / "docs" / "results" / "table").glob("*.csv"))
    return [row for path in paths for row in rows_of(path) if row["who"] in OURS]


def file_of(row: dict[str, str], trees: Path) -> Path:
    return trees / tree_of(cell_of(row))


def returns_of(policy: eutree.TreePolicy, task: str, episodes: int, seed: int) -> Any:
    env = make(EnvironmentSpec(task, Settings.of(task).arguments))
    return eutree.evaluate(policy, env, episodes=episodes, seed=seed)


def best_of(
    candidates: list[dict[str, str]], trees: Path, episodes: int
) -> tuple[dict[str, str], eutree.TreePolicy]:
    """Return the row and the tree that are chosen, by episodes of the choice."""
    order = sorted(candidates, key=lambda row: (-float(row["return"]), int(row["has_leaves"])))
    order = order[:FINALISTS]
    loaded = [(row, eutree.TreePolicy.load(file_of(row, trees))) for row in order]
    played = [returns_of(tree, row["task"], episodes, CHOOSING).returns for row, tree in loaded]
    return loaded[safest(played)]


def safest(played: Sequence[np.ndarray]) -> int:
    """Return whose worst returns are best, of those that earn as much as the best on average."""
    means = [returns.mean() for returns in played]
    low, _ = mean_interval(played[int(np.argmax(means))])
    worst = [np.sort(one)[: math.ceil(WORST * one.size)].mean() for one in played]
    good = [k for k, mean in enumerate(means) if mean >= low]
    return max(good, key=lambda k: (worst[k], means[k]))


def proven(policy: eutree.TreePolicy, task: str) -> str | None:
    """Return what is proven of a tree, in a sentence."""
    plant = plant_of(EnvironmentSpec(task, {}))
    if plant is None:
        return None
    try:
        found = prove(policy, plant)
    except eutree.InvalidArgumentError:  # the tree needs more cells than a proof may have
        return None
    return found.sentence if found.verdict == "proven" else None


def card_of(row: dict[str, str], policy: eutree.TreePolicy, size: int, episodes: int) -> zoo.Card:
    task = row["task"]
    end = returns_of(policy, task, episodes, JUDGING)
    low, high = mean_interval(end.returns)
    who = "" if row["who"] == OURS[0] else f" --who {row['who']}"
    return zoo.Card(
        task=task, most_leaves=size, leaves=policy.n_leaves,
        mean_return=round(float(end.mean_return), 2),
        interval=(round(low, 2), round(high, 2)), worst=round(float(end.returns.min()), 2),
        success=None if end.success_rate is None else round(float(end.success_rate), 4),
        episodes=episodes, steps=int(row["used"]), seed=int(row["seed"]),
        command=f"python benchmarks/table.py {task}{who} --steps {row['steps']} "
        f"--leaves {row['leaves']} --first {row['seed']} --seeds 1",
        commit=row["commit"], date=date.today().isoformat(), extra=EXTRAS.get(task, ""),
        module=zoo.module_of(task),
        proven=proven(policy, task), file=f"{task.replace('/', '-')}-{size}.json",
    )  # fmt: skip


def best_trees(rows: list[dict[str, str]], trees: Path, episodes: int) -> Iterator[zoo.Card]:
    """Yield the cards of the best trees of a task, the smallest size first; the trees are kept."""
    best: zoo.Card | None = None
    for size in SIZES:
        small = [row for row in rows if int(row["has_leaves"]) <= size]
        if not small:
            continue
        row, policy = best_of(small, trees, episodes)
        card = card_of(row, policy, size, episodes)
        if best is not None and card.mean_return <= best.interval[1]:
            continue
        policy.save(HOME / "trees" / card.file)
        best = card
        print(card.name, card.leaves, card.mean_return, card.interval, flush=True)
        yield card


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("trees", type=Path)
    parser.add_argument("--tasks", nargs="+")
    parser.add_argument("--episodes", type=int, default=1000)
    arguments = parser.parse_args()
    kept = [row for row in rows() if file_of(row, arguments.trees).exists()]
    known = {row["task"] for row in kept}
    chosen = set(arguments.tasks or known)
    cards = [card for card in zoo.cards() if card.task not in chosen]
    for card in zoo.cards():
        if card.task in chosen:
            (HOME / "trees" / card.file).unlink(missing_ok=True)
    for task in sorted(chosen & known):
        of_task = [row for row in kept if row["task"] == task]
        cards += best_trees(of_task, arguments.trees, arguments.episodes)
    cards.sort(key=lambda card: (card.task, card.most_leaves))
    text = json.dumps([asdict(one) for one in cards], indent=1, ensure_ascii=False)
    (HOME / "cards.json").write_text(text + "\n")
    subprocess.run(["git", "status", "--short", str(HOME)], cwd=ROOT, check=True)


if __name__ == "__main__":
    main()
