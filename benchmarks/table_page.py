"""Make the page of the table, docs/results/table.md, and a picture for each task.

Run: python -m benchmarks.table_page [--since COMMIT]

With ``--since`` it makes nothing: it prints the cells that were run again since a commit, what they
were and are, and what the same seeds gained.
What ``benchmarks/table.py`` measured is in docs/results/table/, what is known from elsewhere in
docs/results/elsewhere.csv. A picture has return over leaves: a line for each budget and rival that
was run here, with intervals over the runs, or small dots for them where they are fewer than five;
a mark for each tree of others; a policy that has no leaves is a dotted line. What is far below all
own trees is on the page alone.
"""

import argparse
import csv
import re
import subprocess
import textwrap
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.table import LEAVES, OURS, ROOT, ROWS, SEEDS, rows_of

from eutree.evaluation import mean_interval

Rows = Sequence[dict[str, str]]

ENOUGH = 0.9  # a cell whose runs used a smaller share of their steps says so
FEW = 5  # seeds: the interval of fewer is as wide as the picture, and stands on the page alone
BELOW = 0.5  # of the height of all own means: so far below them others are drawn
FAR = 4.0  # of the best return: so far below it, where nothing was run here
COLOURS = {"eutree": "Blues", "derived": "Purples", "sums": "RdPu",
           "dagger": "Oranges", "viper": "Greens",
           "network": "Greys"}  # fmt: skip
MARKS = "xD^sv*P<>p"


def summary(rows: Rows) -> str:
    """Return a cell of the table: mean, its interval over seeds, the worst seed, the leaves."""
    returns = [float(row["return"]) for row in rows]
    low, high = mean_interval(returns)
    has = np.mean([float(row["has_leaves"]) for row in rows])
    size = f"; {has:.1f} leaves" if has else ""
    used = np.mean([float(row["used"]) for row in rows])
    left = f", {used:,.0f} steps used" if used < ENOUGH * float(rows[0]["steps"]) else ""
    digits = 1 if max(map(abs, returns)) >= 1.0 else 2
    said = [f"{one:.{digits}f}" for one in (np.mean(returns), low, high, min(returns))]
    spread = f" [{said[1]}, {said[2]}], worst {said[3]}" if len(rows) > 1 else ""
    shares = [float(row["success"]) for row in rows if row["success"]]
    well = f", {np.mean(shares):.1%} succeed" if shares else ""
    few = f" ({len(rows)} seed{'s' * (len(rows) > 1)})" if len(rows) < SEEDS else ""
    return f"{said[0]}{spread}{size}{well}{left}{few}"


def tasks(folder: Path) -> dict[str, tuple[Rows, Rows]]:
    """Return the rows of each task: those that were run here, and those known from elsewhere."""
    others = rows_of(folder.parent / "elsewhere.csv")
    own = [rows for path in sorted(folder.glob("*.csv")) if (rows := rows_of(path))]
    measured = {rows[0]["task"]: rows for rows in own}
    names = sorted({*measured, *(row["task"] for row in others)})
    return {
        name: (measured.get(name, []), [row for row in others if row["task"] == name])
        for name in names
    }


def page(folder: Path) -> str:
    """Return the page of all rows that are stored, and of those known from elsewhere."""
    lines = [HEAD]
    for task, (rows, others) in tasks(folder).items():
        lines += ["", f"## {task}", "", f"![Return at each size]({picture(task)})"]
        lines += of_task(rows) if rows else []
        lines += elsewhere(others) if others else []
    return "\n".join([*lines, "", AIMS]) + "\n"


def picture(task: str) -> str:
    """Return the name of a task's picture."""
    return f"table-{task.replace('/', '-')}.svg"


def of_task(rows: Rows) -> list[str]:
    """Return the table of a task's own rows."""
    budgets = sorted({int(row["steps"]) for row in rows})
    lines = ["", f"| who, at most | {' | '.join(f'{b:,} steps' for b in budgets)} |"]
    lines.append("|---" * (len(budgets) + 1) + "|")
    for who, leaves in sorted({(row["who"], int(row["leaves"])) for row in rows}):
        cells = []
        for budget in budgets:
            here = [
                row for row in rows
                if (row["who"], int(row["leaves"]), int(row["steps"])) == (who, leaves, budget)
            ]  # fmt: skip
            cells.append(summary(here) if here else "")
        name = who if not leaves else f"{who}, {leaves} leaves"
        lines.append(f"| {name} | {' | '.join(cells)} |")
    said = [cost([row for row in rows if row["who"] == who]) for who in OURS]
    said.append(f"Sources: {', '.join(sorted({row['commit'] for row in rows}))}.")
    return [*lines, "", *textwrap.wrap(" ".join(filter(None, said)), 100)]


def cost(runs: Rows) -> str:
    """Return what somebody's runs cost, in a sentence; nothing of no runs."""
    if not runs:
        return ""
    seconds, peak = ([float(row[name]) for row in runs] for name in ("cpu_s", "peak_mb"))
    return (
        f"A run of {runs[0]['who']} took {np.mean(seconds):.0f} CPU seconds on average, "
        f"{max(seconds):.0f} at most, and {max(peak):.0f} MB at its peak."
    )


def elsewhere(rows: Rows) -> list[str]:
    """Return the table of what is known of a task from elsewhere."""
    titles = ("who", "leaves", "steps", "return", "known")
    lines = ["", f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    return [*lines, *(f"| {' | '.join(row[title] for title in titles)} |" for row in rows)]


def draw(folder: Path) -> None:
    """Draw the picture of each task."""
    import matplotlib as mpl

    mpl.use("svg")
    import matplotlib.pyplot as plt

    mpl.rcParams["svg.hashsalt"] = "eutree"
    for task, (rows, others) in tasks(folder).items():
        figure, axes = plt.subplots(figsize=(9.0, 4.2), layout="constrained")
        heights = [*lines_of(axes, rows)]
        if heights:
            room = BELOW * max(max(heights) - min(heights), 0.4 * abs(max(heights)))
            least = min(heights) - room
        else:
            best = max(number(row["return"]) for row in others)
            least = best - FAR * abs(best)
        marks_of(axes, others, least=least)
        axes.set_xscale("log", base=2)
        fewest = min(axes.dataLim.x0, 2.0)
        axes.set_xlim(0.9 * fewest, 40)
        ticks = [one for one in (1, 2, *LEAVES) if one >= fewest]
        axes.set_xticks(ticks, [*map(str, ticks)])
        axes.set(xlabel="leaves", ylabel="mean return", title=task)
        axes.grid(alpha=0.3)
        named = zip(*axes.get_legend_handles_labels(), strict=True)
        first = sorted(named, key=lambda one: not one[1].endswith(" steps"))
        figure.legend(*zip(*first, strict=True), loc="outside right upper", fontsize=8,
                      frameon=False)  # fmt: skip
        figure.savefig(folder.parent / picture(task), metadata={"Date": None})
        plt.close(figure)


def lines_of(axes: Any, rows: Rows) -> Iterator[float]:
    """Draw what was run here; yield the heights that have to be seen."""
    from matplotlib import colormaps

    budgets = sorted({int(row["steps"]) for row in rows})
    for who, steps in sorted({(row["who"], int(row["steps"])) for row in rows}):
        here = [row for row in rows if (row["who"], int(row["steps"])) == (who, steps)]
        sizes = sorted({int(row["leaves"]) for row in here})
        cells = [[row for row in here if int(row["leaves"]) == size] for size in sizes]
        cells.sort(key=lambda cell: np.mean([float(row["has_leaves"]) for row in cell]))
        returns = [[float(row["return"]) for row in cell] for cell in cells]
        means = [float(np.mean(one)) for one in returns]
        shade = 0.9 - 0.2 * (len(budgets) - 1 - budgets.index(steps))
        colour = colormaps[COLOURS[who]](shade)
        label = f"{who}, {steps:,} steps"
        yield from means
        if who == "network":
            axes.axhline(means[0], linestyle=":", color=colour, label=label)
            continue
        bounds = [mean_interval(one) if len(one) >= FEW else (m, m)
                  for one, m in zip(returns, means, strict=True)]  # fmt: skip
        yield from (float(low) for low, _ in bounds)
        has = [np.mean([float(row["has_leaves"]) for row in cell]) for cell in cells]
        axes.errorbar(has, means, yerr=np.abs(np.subtract(bounds, np.array(means)[:, None])).T,
                      marker="o", capsize=3, label=label, color=colour,
                      linestyle="-" if who in OURS else "--")  # fmt: skip
        few = [cell for cell in cells if len(cell) < FEW]
        runs = [(float(row["has_leaves"]), float(row["return"])) for cell in few for row in cell]
        axes.scatter(*np.array(runs).reshape(-1, 2).T, s=9, color=colour, alpha=0.5)


def marks_of(axes: Any, rows: Rows, *, least: float) -> None:
    """Mark the trees of others, and draw a dotted line for what has no leaves."""
    marks, shades = iter(MARKS), count()
    for who in dict.fromkeys(row["who"] for row in rows):
        found = [row for row in rows if row["who"] == who]
        points = [(number(row["leaves"]), number(row["return"])) for row in found]
        seen = [(x, y) for x, y in points if y >= least and not x > LEAVES[-1] + 4]
        trees = [(x, y) for x, y in seen if not np.isnan(x)]
        if trees:
            colour = "tab:blue" if who.startswith(("eutree", "eu-tree", "tree (auto)")) else "0.25"
            axes.scatter(*zip(*trees, strict=True), marker=next(marks), s=36, color=colour,
                         label=plain(who), zorder=3)  # fmt: skip
        elif seen:
            style = ((0, (1, 2)), (0, (5, 2)), (0, (3, 1, 1, 1)), (0, (8, 3)))[next(shades) % 4]
            axes.axhline(seen[0][1], linestyle=style, color="0.55", label=plain(who))


def plain(who: str) -> str:
    """Return a name for the legend: without links, on lines that are not long."""
    return textwrap.fill(re.sub(r":? ?\(?\[runs\]\([^)]*\)\)?", "", who), 34)


def number(text: str) -> float:
    """Return the number that a text begins with, or NaN."""
    try:
        return float(text.partition(" ")[0].rstrip(":"))
    except ValueError:
        return float("nan")


def rows_at(commit: str, path: Path) -> Rows:
    """Return the rows of a file as a commit has it; none where it has no such file."""
    name = f"{commit}:{path.relative_to(ROOT)}"
    shown = subprocess.run(["git", "show", name], cwd=ROOT, capture_output=True, text=True)
    return list(csv.DictReader(shown.stdout.splitlines()))


def compared(now: Rows, then: Rows) -> Iterator[str]:
    """Yield a line for each cell of ours that two or more seeds ran again: before, now, gain."""
    places = ("who", "task", "steps", "leaves", "seed")
    mine, other = (
        {tuple(row[place] for place in places): row for row in rows if row["who"] in OURS}
        for rows in (now, then)
    )
    again = [key for key in mine if key in other and mine[key]["commit"] != other[key]["commit"]]
    for cell in dict.fromkeys(key[:-1] for key in again):
        keys = [key for key in again if key[:-1] == cell]
        if len(keys) < 2:
            continue
        gains = [float(mine[key]["return"]) - float(other[key]["return"]) for key in keys]
        spent = [np.mean([float(of[key]["cpu_s"]) for key in keys]) for of in (other, mine)]
        who, task, steps, leaves = cell
        name = task if who == OURS[0] else f"{task}, {who}"
        yield (
            f"| {name}, {int(steps):,} | {leaves} | {summary([other[key] for key in keys])} "
            f"| {summary([mine[key] for key in keys])} | {np.mean(gains):.1f} "
            f"{mean_interval(gains):.1f} | {spent[0]:.0f}, {spent[1]:.0f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--since", metavar="COMMIT")
    if commit := parser.parse_args().since:
        for path in sorted(ROWS.glob("*.csv")):
            for line in compared(rows_of(path), rows_at(commit, path)):
                print(line)
        return
    draw(ROWS)
    (ROWS.parent / "table.md").write_text(page(ROWS))


HEAD = """\
# Return at size at counted steps

Each cell: mean return of ten runs (200 fresh episodes each), 95 % interval over the runs, worst
run, mean number of leaves, and the share of episodes that succeed where the task has a success.
Every environment step is counted: demonstrations, learning, races; of `dagger` and `viper` those of
their network too. Made by `python benchmarks/table.py TASK` for each task and `python -m
benchmarks.table_page`; every run is a row in `docs/results/table/`. The settings are those of
`eutree learn --settings zoo:TASK` and were chosen on seeds from 1000 on; the runs here have the
seeds from 20,000 on. A cell that was made of fewer than ten runs says so; an empty one was not run
yet. Of the tasks that plan, runs of 500,000 steps and more from before 3aeda195 did not [begin
again](../decisions/racing.md) in their races, rows from before e703d358 did not cut trees together
there, and in rows from before fa6bc79d models proposed [once](../decisions/what-was-shown.md) where
nothing of theirs won; Acrobot's rows from before it had a [teacher of one
value](../decisions/distilled-dqn.md) that learned from its own steps alone; rows of Acrobot,
LunarLander, Pendulum and two tanks from before 5e259719 pruned all recipes of large trees alike. Of
these four tasks, rows of 4, 8 and 16 leaves from before 5e6b43bd were pruned [from smaller
trees](../decisions/distilled-dqn.md), runs of 10,000 steps from before aab6b53d raced [more
challengers than they had episodes for](../decisions/distilled-dqn.md), and in rows from before
afac2cde no tree [climbed on](../decisions/distilled-dqn.md) after it was pruned.

`derived` is eutree with the [derived features](../derived-features.md) that the settings
`zoo:TASK-derived` declare, which somebody who knows the task wrote down; its sizes are beside the
others', which have the raw numbers alone (`--set sums=0`). `sums` is eutree with `--set sums=3`:
trees may ask for [weighted sums](../small-trees.md#sums-of-features) that the run finds in the
labels of its network, too. Nobody declares anything there. Acrobot's rows from before 993eb04f took
no sum that did not save two standard errors, and so went without some good ones. In rows of
`derived` and `sums` from before f15abf13 world models
[predicted](../decisions/imagined-formulas.md) what is derived, and in Acrobot's and Pendulum's from
before 299ef6e7 imagined angles did not stay angles.

`dagger` and `viper` are CART by DAgger and VIPER from a DQN of Stable-Baselines3, with its zoo's
settings and four fifths of the steps; `network` is that DQN with all of them and no tree at all. A
task that its zoo does not know has Acrobot's settings there, on the same grid of actions as ours.
With none of that zoo's three settings does it learn more of *N*-Evasion in 50,000 steps than to do
the same everywhere (2-Evasion, seed 1000: 43.0, with MountainCar's -78.5), nor do its copies. What
they gather is planned for episodes of full length, so where episodes are short steps are left.
The share was chosen on the seeds 1000 and 1001 of CartPole, 50,000 steps, `dagger` with 8 leaves:
437.7 and 454.4 with four fifths, 254.0 and 456.7 with half. Copies of a network that learned to its
end, in more steps, are in the rows from elsewhere.

Each size is a run of its own. What runs of one seed have in common, up to where their sizes begin
to matter, is learned once, to the same bytes, and each row counts its CPU seconds; rows of a8d019e5
and 2c011bdf are of vectors of [512 bits](../decisions/distilled-dqn.md), with the same results. The
front of a single run has every size too, but pays for it: it plays each of its trees from 60 starts
or more, by default two steps for each step of the run, and within 100,000 steps of MountainCar
there are enough for two trees.

`Cologne1-v0` is [the light](real-tasks.md), in half hours with demand drawn for each; it does not
always repeat an episode, so its runs can be had again only on the mean. Runs of whole hours and
with rules above the trees are on the page that is linked.

Below each task's own rows: *measured*, with the authors' code on fresh seeds (Gymnasium 1.4, two
cores; these programs are not part of this repository); *published*, by them; *here*, by another
command of this repository, on the page that is linked."""


AIMS = """\
## Aims

| reached | |
|---|---|
| CartPole 500 with 4 leaves in 50 k, worst 499 | 499.96, nine of the ten runs 500.0 |
| 4-Evasion: 92 %, return 75 with 32 leaves | 93.3 %, 77.2 in 500 k: long races [begin \
again](../decisions/racing.md) from trees of good episodes |
| 3-Evasion: 98.5 %, return 90 with 32 leaves | 99.2 %, 90.4 with 16 leaves in 100 k: trees [cut \
together](../decisions/racing.md); 98.9 %, 90.8 with 32 in 500 k |
| two tanks -165 | -164.1 with 16 leaves, -159.0 with 32, in 500 k; -159.7 and -156.0 in a million |
| LunarLander 160 with 20 leaves, 200 with 34, 500 k; 230 with 34, 1 M | 229.7 with at most 16 \
leaves in 500 k, 242.1 with 8, 259.9 with 32, by two [derived \
features](../derived-features.md) (*derived*); by sums that the run finds (*sums*) 218.0 with 32 \
and 185.3 with 16 in 500 k, 131.6 with 4; by raw numbers missed |

| missed | reached | tried |
|---|---|---|
| MountainCar -98.5 with 5 leaves | -98.7 in 500 k, ten runs; -98.6 in a million; with at \
most 8 -98.0 | [searches with the true dynamics](../decisions/racing.md) end at -98.65 with 5 \
leaves, nine of ten: no tree that earns -98.5 is known; the tree of 8 copied by DAgger; [sets of \
actions](../decisions/labels-as-sets.md) as labels: -101.9 |
| Acrobot -80 with 8 leaves, 100 k | -83.3, the best run -81.3; with 16 leaves -84.0; in 500 k \
-82.6 with 8 | [a teacher that learns on, by quantiles, and ten prunings for six that \
race](../decisions/distilled-dqn.md): 3.8 more; now its copies of 8 leaves lose; prunings of large \
trees: no change; sets of actions: no swing |
| LunarLander 200 with 34, 160 with 20, 500 k, by raw numbers | 177.1 with 32, 132.8 with 16 | \
[most prunings of the recipe that the model scores best](../decisions/distilled-dqn.md): 31.8 more \
with 32; [prunings of large trees](../decisions/distilled-dqn.md): 14.9 [-9.2, 39.0] more with 16; \
better copies of the teacher, revisions of the policy, more looks before a cut: no gain; \
[sums](../small-trees.md#sums-of-features) of features in place of raw numbers |
| LunarLander 230 with 34, 1 M, by raw numbers | 173.8 with 32, five runs | twice the steps of \
races |"""


if __name__ == "__main__":
    main()
