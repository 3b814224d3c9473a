"""Expectations of the framework, written down before it ran, and how runs judge them.

The learning time of a run is the first evaluation from which its tree stays for good at 95 % of
the way from chance to the good demonstrator's expert tree, which is evaluated on the same episodes;
a run that does not end there counts with all of its episodes. The paper found teaching to take less
than half the learning time of its C. U-Tree. A method is asked the same: mean time from the expert
tree and the demonstrations over mean time from nothing, in shares of each task's episodes, tasks
weighed alike, runs of one seed drawn together.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.evaluation import Estimate
from eutree_lab.framework.runs import (
    DEMOS,
    FROZEN,
    GOOD,
    NOTHING,
    POOR_TREE_AND_DEMOS,
    RANDOM_TREE,
    TASKS,
    TREE,
    TREE_AND_DEMOS,
    Arm,
    FrameworkRecord,
)
from eutree_lab.paper.claims import FAILS, HOLDS, OPEN, judged
from eutree_lab.statistics import bootstrap, bootstrap_rows

SHARE = 0.95  # of the way from chance to the expert tree, that counts as learned
HALF = 0.5  # of the learning time from nothing, that the paper's teaching stays below
SIMILAR = 0.05  # a difference of mean scores below this is none
FEWEST = 5  # seeds that a verdict needs
REFUSED = "refused"
GOOD_TREE = Arm(FROZEN, GOOD)


@dataclass(frozen=True)
class Expectation:
    """An expectation, written down before any run.

    Attributes:
        method: Name of the method.
        first: The arm of which it is said; with ``second`` None, learning time is meant.
        second: The arm it is compared with, by the mean score along the curve.
        similar: Whether both are expected to be alike, to 0.05; else the first is to be above.
        expected: Whether the sentence was expected to hold.
        reason: Why.
    """

    method: str
    expected: str
    reason: str
    first: Arm = TREE_AND_DEMOS
    second: Arm | None = None
    similar: bool = False

    @property
    def sentence(self) -> str:
        """The claim about the method."""
        if self.second is None:
            return "teaching halves the learning time"
        relation = "as good as" if self.similar else "above"
        return f"{self.first.name} {relation} {self.second.name}"


_OVERRULED = "cells by visits alone overrule the expert's labels"
_CUTS = "it is the expert's cuts that help, not having cells"
_HARM = "a poor tree does harm where its cells are kept"

EXPECTATIONS = (
    Expectation("planning", HOLDS, "nothing but what proved better replaces the expert's policy"),
    Expectation("u-tree", FAILS, "it begins well and loses it: q overrules the expert's labels"),
    Expectation("history-u-tree", FAILS, "as the u-tree: memory adds features, not restraint"),
    Expectation("density-tree", FAILS, _OVERRULED),
    Expectation("adaptive-q", FAILS, "optimism sends it away from what was shown"),
    Expectation("vqql", HOLDS, "a quantizer without values gains most from cells that have some"),
    Expectation("vrd", HOLDS, "a demonstration gives it the model that it otherwise waits for"),
    Expectation("parti-game", HOLDS, "the expert is one more aim, and a good one"),
    Expectation("vqql", HOLDS, "codewords lie where the expert's actions differ", TREE, NOTHING),
    Expectation("vrd", HOLDS, "demonstrations are its first model", TREE_AND_DEMOS, TREE),
    Expectation("u-tree", HOLDS, "the paper's finding", TREE, TREE_AND_DEMOS, similar=True),
    Expectation("parti-game", HOLDS, "the aim helps, not the data", TREE_AND_DEMOS, DEMOS),
    Expectation("u-tree", HOLDS, _CUTS, TREE, RANDOM_TREE),
    Expectation("history-u-tree", HOLDS, _CUTS, TREE, RANDOM_TREE),
    Expectation("density-tree", HOLDS, _CUTS, TREE, RANDOM_TREE),
    Expectation("adaptive-q", HOLDS, _CUTS, TREE, RANDOM_TREE),
    Expectation("vqql", HOLDS, _CUTS, TREE, RANDOM_TREE),
    Expectation("vrd", HOLDS, _HARM, NOTHING, POOR_TREE_AND_DEMOS),
    Expectation("parti-game", HOLDS, _HARM, NOTHING, POOR_TREE_AND_DEMOS),
)


@dataclass(frozen=True)
class Finding:
    """The verdict of the runs on one expectation.

    Attributes:
        expectation: Sentence that is judged.
        holds: ``"holds"``, ``"does not hold"``, ``"cannot be told"`` or ``"refused"``.
        estimate: Ratio of learning times, or difference of mean scores; None where refused.
        tasks: The tasks that it is made of.
    """

    expectation: Expectation
    holds: str
    estimate: Estimate | None
    tasks: tuple[str, ...]

    @property
    def number(self) -> str:
        """The estimate with its interval; "" where refused."""
        return "" if self.estimate is None else number_text(self.estimate)

    @property
    def n_seeds(self) -> int:
        """Seeds that it is made of."""
        return 0 if self.estimate is None else self.estimate.n

    @property
    def as_expected(self) -> str:
        """Whether it came as expected, in a word."""
        if self.holds in (OPEN, REFUSED):
            return "open"
        return "yes" if self.holds == self.expectation.expected else "no"


@dataclass(frozen=True, eq=False)
class Times:
    """Learning times of one arm on one task, a run each.

    Attributes:
        episodes: Episodes until the level was held for good, or all of them.
        reached: Whether it was.
        horizon: Episodes of a run.
        demonstrations: Episodes that were demonstrated before.
    """

    episodes: Floats  # [N]
    reached: Booleans  # [N]
    horizon: int
    demonstrations: int = 0

    def shares(self, *, counting_demonstrations: bool = False) -> Floats:
        """Return the times as shares of the horizon, with demonstrations as episodes or without."""
        before = self.demonstrations if counting_demonstrations else 0
        return (self.episodes + before) / self.horizon


class Runs:
    """All records, found by task, method, arm and seed.

    A comparison is made over the seeds that have all of its runs, so not every arm needs to have
    been run on every seed.

    Args:
        records: Records of the runs.
    """

    def __init__(self, records: Iterable[FrameworkRecord]) -> None:
        self._found = {(r.spec.task, r.spec.method, r.spec.arm, r.spec.seed): r for r in records}
        self.methods = tuple(dict.fromkeys(m for _, m, _, _ in self._found if m))
        self.tasks = tuple(name for name in TASKS if any(key[0] == name for key in self._found))
        self._seeds = sorted({key[3] for key in self._found})

    def seeds(self, tasks: Sequence[str], method: str, *arms: Arm) -> list[int]:
        """Return the seeds that have runs of all arms on all tasks, and of the expert tree."""
        cells = [(task, method, arm) for task in tasks for arm in arms]
        cells += [(task, "", GOOD_TREE) for task in tasks]
        return [s for s in self._seeds if all((*cell, s) in self._found for cell in cells)]

    def cell(self, task: str, method: str, arm: Arm, seeds: Sequence[int]) -> list[FrameworkRecord]:
        """Return the records of one cell in the order of the seeds."""
        return [self._found[task, method, arm, seed] for seed in seeds]

    def refusal(self, task: str, method: str, arm: Arm) -> str:
        """Return why a method does not take the arm on the task, or ""."""
        found = (self._found.get((task, method, arm, seed)) for seed in self._seeds)
        return next((record.refused for record in found if record is not None), "")

    def scores(self, task: str, method: str, arm: Arm, seeds: Sequence[int]) -> Floats:
        """Return the scores along the curves: 0 is chance, 1 the good expert tree; [N, points]."""
        chance = TASKS[task].chance
        expert = [r.curve[0].mean_return for r in self.cell(task, "", GOOD_TREE, seeds)]
        records = self.cell(task, method, arm, seeds)
        curves = np.array([[p.mean_return for p in r.curve] for r in records])
        scale = np.array(expert)[:, np.newaxis] - chance
        found: Floats = (curves - chance) / scale
        return found

    def times(self, task: str, method: str, arm: Arm, seeds: Sequence[int]) -> Times:
        """Return the learning times of an arm."""
        records = self.cell(task, method, arm, seeds)
        episodes = np.array([point.episode for point in records[0].curve])
        shown = records[0].spec.settings.demonstrations if records[0].demonstrated_steps else 0
        found, reached = for_good(self.scores(task, method, arm, seeds), episodes, SHARE)
        return Times(found, reached, int(episodes[-1]), shown)


def for_good(scores: Floats, episodes: Integers, level: float) -> tuple[Floats, Booleans]:
    """Return when each run came to the level for good, and whether it did.

    Args:
        scores: Scores of each run at each evaluation, shape [N, P].
        episodes: Episodes before each evaluation, ascending, shape [P].
        level: Score to be reached.

    Returns:
        The first evaluation from which all later ones are at the level, or the last, [N]; and
        whether the last one is, [N].
    """
    below = scores < level
    n_points = scores.shape[1]
    last_below = np.where(below.any(axis=1), n_points - 1 - below[:, ::-1].argmax(axis=1), -1)
    first = np.minimum(last_below + 1, n_points - 1)
    return episodes[first].astype(np.float64), ~below[:, -1]


def ratio_of_times(taught: Sequence[Times], alone: Sequence[Times], *, fair: bool) -> Estimate:
    """Return how much of the learning time is left with teaching, with its 95 % interval.

    Args:
        taught: Times with teaching on each task; runs are paired with those of ``alone``.
        alone: Times from nothing.
        fair: Whether demonstrations count as episodes too.
    """
    mine = np.mean([t.shares(counting_demonstrations=fair) for t in taught], axis=0)  # [N]
    theirs = np.mean([t.shares() for t in alone], axis=0)
    if not theirs.any():
        return Estimate(1.0, bootstrap(np.ones(len(theirs))).interval, len(theirs))
    smallest = np.finfo(np.float64).tiny  # draws in which nobody needed any time

    def ratio(rows: Integers) -> Floats:
        quotient: Floats = mine[rows].mean(axis=1) / np.maximum(theirs[rows].mean(axis=1), smallest)
        return quotient

    return bootstrap_rows(ratio, len(mine))


def halved(estimate: Estimate, alone: Sequence[Times]) -> str:
    """Return whether teaching halves the learning time.

    It does if the whole interval is below a half. It does not if none of it is, and at least half
    of the runs from nothing learned: else their time is longer than could be seen. Of fewer than
    five seeds nothing can be told: drawing so few again and again shows too little spread.
    """
    low, high = estimate.interval
    if estimate.n < FEWEST:
        return OPEN
    if high < HALF:
        return HOLDS
    learned = float(np.mean([t.reached.mean() for t in alone]))
    return FAILS if low >= HALF and learned >= HALF else OPEN


def verdict(runs: Runs, expectation: Expectation) -> Finding:
    """Return the runs' verdict on an expectation, over the tasks that refuse none of its arms."""
    method, first = expectation.method, expectation.first
    second = expectation.second or NOTHING
    tasks = tuple(
        task
        for task in runs.tasks
        if not any(runs.refusal(task, method, arm) for arm in (first, second))
    )
    if not tasks:
        return Finding(expectation, REFUSED, None, ())
    seeds = runs.seeds(tasks, method, first, second)
    if not seeds:
        return Finding(expectation, OPEN, None, ())
    if expectation.second is None:
        taught = [runs.times(task, method, first, seeds) for task in tasks]
        alone = [runs.times(task, method, NOTHING, seeds) for task in tasks]
        estimate = ratio_of_times(taught, alone, fair=False)
        return Finding(expectation, halved(estimate, alone), estimate, tasks)
    estimate = lead(runs, tasks, method, first, second, seeds)
    return Finding(expectation, _holds(expectation, estimate), estimate, tasks)


def _holds(expectation: Expectation, estimate: Estimate) -> str:
    """Return whether one arm is above another, or as good."""
    if estimate.n < FEWEST:
        return OPEN
    low, high = (-SIMILAR, SIMILAR) if expectation.similar else (0.0, np.inf)
    claim = judged(
        f"framework/{expectation.method}",
        expectation.sentence,
        paper="",
        estimate=estimate,
        low=low,
        high=high,
        rule="",
    )
    return claim.holds


def lead(
    runs: Runs, tasks: Sequence[str], method: str, first: Arm, second: Arm, seeds: Sequence[int]
) -> Estimate:
    """Return the difference of two arms' mean scores along the curve, over tasks, by seed."""

    def scores(task: str, arm: Arm) -> Floats:
        return runs.scores(task, method, arm, seeds)

    differences = [(scores(task, first) - scores(task, second)).mean(axis=1) for task in tasks]
    return bootstrap(np.mean(differences, axis=0))


def number_text(estimate: Estimate, *, signed: bool = False) -> str:
    """Return an estimate with its interval."""
    sign = "+" if signed else ""
    return f"{estimate.value:{sign}.2f} {estimate.interval:.2f}"


def verdicts(records: Iterable[FrameworkRecord]) -> list[Finding]:
    """Return the verdict on every expectation of a method that was run."""
    runs = Runs(records)
    return [verdict(runs, e) for e in EXPECTATIONS if e.method in runs.methods]


def by_method(found: Iterable[Finding]) -> Mapping[str, Finding]:
    """Return the verdict on each method's learning time."""
    return {v.expectation.method: v for v in found if v.expectation.second is None}
