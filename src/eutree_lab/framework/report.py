"""The framework's results on a page: verdicts, a table for each task, learning curves.

A folder of results holds

    runs/               one document a run; finished runs are never done again
    seconds.json        CPU seconds of each run; all else is the same on every machine
    verdicts.json       each expectation, and its verdict
    framework.md        all tables
    framework-*.svg     learning curves of each task
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.files import write_bytes, write_text
from eutree_lab.framework.runs import (
    ARMS,
    EXPERT_ARMS,
    NOTHING,
    POOR,
    TASKS,
    TREE_AND_DEMOS,
    Arm,
    FrameworkRecord,
    FrameworkSpec,
    is_smoke,
    run,
)
from eutree_lab.framework.verdicts import (
    Finding,
    Runs,
    Times,
    by_method,
    halved,
    lead,
    number_text,
    ratio_of_times,
    verdicts,
)
from eutree_lab.paper.claims import SMOKE_RUN
from eutree_lab.paper.drawing import blank, clear, drawn
from eutree_lab.paper.results import RecordFolder

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "nothing": "#0b5fa5",
    "tree": "#2a7f3e",
    "tree+demos": "#a8480c",
    "demos": "#7a4fa3",
    "random-tree": "#8a8a8a",
}


@dataclass(frozen=True, eq=False)
class FrameworkReproduction:
    """Results of the experiment.

    Attributes:
        verdicts: Verdict of the runs on each expectation.
        folder: Where everything was written.
    """

    verdicts: tuple[Finding, ...]
    folder: Path


class FrameworkResults(RecordFolder[FrameworkSpec, FrameworkRecord]):
    """The runs that are done, on disk, and the CPU seconds that each took.

    Args:
        folder: Where; made if it does not exist.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, FrameworkRecord, run)

    def seconds(self) -> dict[str, float]:
        """Return the CPU seconds of the runs, by name."""
        path = self.folder / "seconds.json"
        if not path.exists():
            return {}
        found: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))
        return found

    def keep(self, outcome: tuple[FrameworkRecord, float]) -> FrameworkSpec:
        """Write the record of a run, and the seconds that it took; return its spec."""
        record, spent = outcome
        spec = super().keep(record)
        seconds = self.seconds() | {spec.name: round(spent, 3)}
        write_text(self.folder / "seconds.json", json.dumps(seconds, indent=1) + "\n")
        return spec


def reproduce_framework(
    specs: Sequence[FrameworkSpec],
    folder: str | Path,
    *,
    n_jobs: int = 1,
    on_run: Callable[[int, int, FrameworkSpec], None] = lambda count, total, spec: None,
) -> FrameworkReproduction:
    """Do the missing runs, compare them with the expectations, and report.

    Args:
        specs: The runs, seed by seed.
        folder: Results; runs that are already there are not done again.
        n_jobs: Processes.
        on_run: Called after each run with how many are done, how many there are, and the run.
    """
    results = FrameworkResults(folder)
    results.complete(
        specs, n_jobs=n_jobs, on_run=lambda count, spec: on_run(count, len(specs), spec)
    )
    return report(specs, results)


def report(specs: Sequence[FrameworkSpec], results: FrameworkResults) -> FrameworkReproduction:
    """Write verdicts, tables and figures of the runs that are done.

    Raises:
        InvalidArgumentError: There are none.
    """
    records = results.load([spec for spec in specs if results.has(spec)])
    if not records:
        raise InvalidArgumentError("specs must hold a run that is done, got none")
    runs, found = Runs(records), tuple(verdicts(records))
    smoke = is_smoke(specs)
    facts = {"smoke": smoke, "verdicts": verdicts_to_facts(found)}
    text = json.dumps(facts, indent=1)
    write_text(results.folder / "verdicts.json", text + "\n")
    text = "\n\n".join(
        [
            *[f"**{SMOKE_RUN}**"] * smoke,
            verdicts_to_markdown(runs, found),
            tables_to_markdown(runs, results.seconds()),
        ]
    )
    write_text(results.folder / "framework.md", text + "\n")
    for task in runs.tasks:
        write_bytes(results.folder / f"framework-{task}.svg", draw(runs, task))
    return FrameworkReproduction(found, results.folder)


def verdicts_to_markdown(runs: Runs, found: Sequence[Finding]) -> str:
    """Return the verdict on each method's learning time, and on all else that was expected."""
    titles = [TASKS[task].title for task in runs.tasks]
    lines = [
        "## Does teaching halve the learning time?\n\nRatio of learning times, `tree+demos` over "
        "`nothing`, with its 95 % interval. In brackets behind it: runs that learned with "
        "teaching, and from nothing.\n",
        f"| method | seeds | all tasks | {' | '.join(titles)} | demonstrations counted | verdict | "
        "expected | as expected |",
        "|---|---|---|" + "---|" * len(titles) + "---|---|---|---|",
    ]
    for method, verdict in by_method(found).items():
        cells = [_of_task(runs, task, method) for task in runs.tasks]
        lines.append(
            f"| `{method}` | {verdict.n_seeds} | {verdict.number} | {' | '.join(cells)} | "
            f"{_counted(runs, verdict)} | **{verdict.holds}** | "
            f"{verdict.expectation.expected} | {verdict.as_expected} |"
        )
    lines += [
        "\n## What else was expected\n\nDifference of mean scores along the curve, over the tasks "
        "that both arms were run on.\n",
        "| method | sentence | seeds | difference [95 %] | tasks | verdict | expected "
        "| as expected |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for v in found:
        if v.expectation.second is not None:
            tasks = ", ".join(TASKS[task].title for task in v.tasks)
            lines.append(
                f"| `{v.expectation.method}` | {v.expectation.sentence} | {v.n_seeds} | "
                f"{v.number} | {tasks} | **{v.holds}** | {v.expectation.expected} | "
                f"{v.as_expected} |"
            )
    return "\n".join(lines)


def _of_task(runs: Runs, task: str, method: str) -> str:
    """Return the ratio of learning times on one task and how many learned; or the refusal."""
    for arm in (NOTHING, TREE_AND_DEMOS):
        if runs.refusal(task, method, arm):
            return "refused"
    seeds = runs.seeds([task], method, TREE_AND_DEMOS, NOTHING)
    if not seeds:
        return "not run"
    taught, alone = (runs.times(task, method, arm, seeds) for arm in (TREE_AND_DEMOS, NOTHING))
    ratio = ratio_of_times([taught], [alone], fair=False)
    learned = f"({taught.reached.sum()}, {alone.reached.sum()})"
    return f"{number_text(ratio)} {learned}: {halved(ratio, [alone])}"


def _counted(runs: Runs, verdict: Finding) -> str:
    """Return the ratio of learning times with demonstrations counted as episodes."""
    if not verdict.tasks:
        return ""
    method = verdict.expectation.method
    seeds = runs.seeds(verdict.tasks, method, TREE_AND_DEMOS, NOTHING)

    def times(arm: Arm) -> list[Times]:
        return [runs.times(task, method, arm, seeds) for task in verdict.tasks]

    return number_text(ratio_of_times(times(TREE_AND_DEMOS), times(NOTHING), fair=True))


def tables_to_markdown(runs: Runs, seconds: Mapping[str, float]) -> str:
    """Return a table for each task: a row for each method and arm."""
    return "\n\n".join(_table(runs, task, seconds) for task in runs.tasks)


def _table(runs: Runs, task: str, seconds: Mapping[str, float]) -> str:
    title = TASKS[task].title
    head = (
        "method", "start", "seeds", "score", "against nothing [95 %]", "learned", "episodes",
        "lowest", "leaves", "tree's return", "own return", "fidelity", "steps shown", "steps",
        "model steps", "seconds",
    )  # fmt: skip
    lines = [
        f"## {title}\n\n![Learning curves on {title}](figures/framework-{task}.svg)\n",
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
    ]
    for arm in EXPERT_ARMS:
        lines.append(_row(runs, task, "", arm, seconds))
    for method in runs.methods:
        lines += [_row(runs, task, method, arm, seconds) for arm in ARMS]
    return "\n".join(lines)


def _row(runs: Runs, task: str, method: str, arm: Arm, seconds: Mapping[str, float]) -> str:
    name = f"`{method}`" if method else "expert tree"
    reason = runs.refusal(task, method, arm)
    if reason:
        return f"| {name} | {arm.name} | refused: {reason} |" + " |" * 13
    seeds = runs.seeds([task], method, arm)
    if not seeds:
        return f"| {name} | {arm.name} | not run |" + " |" * 13
    records = runs.cell(task, method, arm, seeds)
    scores = runs.scores(task, method, arm, seeds)
    against = learned = episodes = ""
    if method:
        times = runs.times(task, method, arm, seeds)
        learned, episodes = (
            f"{times.reached.sum()} of {len(records)}",
            f"{times.episodes.mean():.0f}",
        )
        both = runs.seeds([task], method, arm, NOTHING)
        if arm != NOTHING and both and not runs.refusal(task, method, NOTHING):
            against = number_text(lead(runs, [task], method, arm, NOTHING, both), signed=True)
    spent = [seconds[r.spec.name] for r in records if r.spec.name in seconds]
    cells = (
        name,
        arm.name,
        str(len(seeds)),
        f"{scores.mean():.2f}",
        against,
        learned,
        episodes,
        _lowest(records),
        _mean([r.n_leaves for r in records]),
        f"{np.mean([r.tree_return for r in records]):.1f}",
        f"{np.mean([r.own_return for r in records]):.1f}",
        f"{np.mean([r.fidelity for r in records]):.2f}",
        _mean([r.demonstrated_steps for r in records]),
        _mean([r.learning_steps for r in records]),
        _mean([r.model_steps for r in records]),
        f"{np.median(spent):.1f}" if spent else "",
    )
    return "| " + " | ".join(cells) + " |"


def _lowest(records: Sequence[FrameworkRecord]) -> str:
    """Return the lowest evaluation after the first, averaged over runs: success, or the return."""
    curves = [r.curve[1:] or r.curve for r in records]
    if curves[0][0].success is None:
        return f"{np.mean([min(p.mean_return for p in curve) for curve in curves]):.0f}"
    success = [min(p.success or 0.0 for p in curve) for curve in curves]
    return f"{100 * np.mean(success):.0f} %"


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):,.0f}"


def draw(runs: Runs, task: str) -> bytes:
    """Return the learning curves of a task as SVG: a panel for each method, a line for each arm."""
    return drawn(task, lambda: _figure(runs, task), "svg")[0]


def _figure(runs: Runs, task: str) -> "Figure":
    n_rows = -(-len(runs.methods) // 4)
    figure = blank(f"{TASKS[task].title}: means over seeds", (13, 2.9 * n_rows + 0.7))
    grid: Any = figure.subplots(n_rows, 4, sharex=True, sharey=True, squeeze=False)
    for axes, method in zip(grid.flat, runs.methods, strict=False):
        _panel(axes, runs, task, method)
    for axes in grid.flat[len(runs.methods) :]:
        axes.set_visible(False)
    handles, labels = _legend(grid.flat[: len(runs.methods)])
    figure.legend(handles, labels, loc="outside lower center", ncols=9, fontsize=8)
    return figure


def _legend(panels: "Sequence[Axes]") -> tuple[list[Any], list[str]]:
    """Return every line of the figure once, by its name."""
    found: dict[str, Any] = {}
    for axes in panels:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(name, handle)
    return list(found.values()), list(found)


def _panel(axes: "Axes", runs: Runs, task: str, method: str) -> None:
    """Draw the arms of one method; say why one is missing."""
    axes.set_title(method, fontsize=10)
    axes.axhline(1.0, color="#333333", linewidth=0.8, linestyle=":", label="expert tree, frozen")
    refusals = {runs.refusal(task, method, arm) for arm in ARMS} - {""}
    for arm in ARMS:
        seeds = runs.seeds([task], method, arm)
        if not seeds or runs.refusal(task, method, arm):
            continue
        curves = runs.scores(task, method, arm, seeds)
        episodes = [point.episode for point in runs.cell(task, method, arm, seeds)[0].curve]
        style: Any = {"color": COLOURS[arm.start], "linewidth": 1.5}
        if arm.demonstrator == POOR:
            style |= {"linestyle": "--", "linewidth": 1.0, "alpha": 0.8}
        axes.plot(episodes, _shown(curves), label=arm.name, **style)
    if refusals:
        axes.text(0.5, 0.5, "refused: see the table", ha="center", transform=axes.transAxes)
    axes.set_ylim(-0.6, 1.3)
    axes.set_xlabel("Episodes", fontsize=8)
    axes.set_ylabel("Score", fontsize=8)
    axes.tick_params(labelsize=8)
    clear(axes)


def _shown(curves: Floats) -> Floats:
    """Return the mean curve; scores far below chance are drawn at the lower edge."""
    mean: Floats = np.clip(curves.mean(axis=0), -0.6, 1.3)
    return mean


def verdicts_to_facts(found: Sequence[Finding]) -> list[dict[str, Any]]:
    """Return the verdicts in JSON's types."""
    return [
        {
            "method": v.expectation.method,
            "sentence": v.expectation.sentence,
            "expected": v.expectation.expected,
            "holds": v.holds,
            "as_expected": v.as_expected,
            "tasks": list(v.tasks),
            "seeds": v.n_seeds,
            "value": None if v.estimate is None else v.estimate.value,
            "interval": None if v.estimate is None else list(v.estimate.interval),
        }
        for v in found
    ]
