"""Figures 2 and 3: the three learners side by side, in 2-Evasion and in 3-Evasion."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from eutree.arrays import Floats
from eutree.evaluation import Estimate
from eutree_lab.paper import drawing
from eutree_lab.paper.claims import Claim, claimed
from eutree_lab.paper.experiment import Experiment, ExperimentScale, Records, by_learner
from eutree_lab.paper.finals import FINAL, FINALS
from eutree_lab.paper.runs import Performance, RunRecord, RunSpec
from eutree_lab.statistics import (
    Durations,
    bootstrap,
    bootstrap_rows,
    restricted_mean_ratio,
    trials_to_threshold,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEARNERS = ("c-u-tree", "eu-tree-dt", "eu-tree")
LEVEL = 0.9  # success rate that "learned" stands for


def specs(opponents: int, scale: ExperimentScale, preset: str) -> list[RunSpec]:
    """Return the runs of the three learners."""
    return [
        scale.spec(scale.environment(opponents), learner, preset, run)
        for learner in LEARNERS
        for run in range(scale.runs)
    ]


def judge(name: str, records: Records) -> list[Claim]:
    """Return the paper's claims about one of the two figures."""
    groups = by_learner(records)
    c_u_tree, without, eu_tree = (success(groups[learner]) for learner in LEARNERS)
    horizon = groups["eu-tree"][0].curve[-1].episode
    return [
        claimed(f"{name}/half-the-trials", _ratio_of_trials(groups, horizon)),
        claimed(f"{name}/dt-similar", bootstrap((eu_tree - without).mean(axis=1))),
        claimed(f"{name}/above-at-every-point", _smallest_lead(eu_tree, c_u_tree)),
        claimed(
            f"{name}/c-u-tree-learns",
            bootstrap([final(record).success for record in groups["c-u-tree"]]),
            horizon=horizon,
        ),
        claimed(
            f"{name}/eu-tree-learns",
            bootstrap([final(record).success for record in groups["eu-tree"]]),
            horizon=horizon,
        ),
    ]


def final(record: RunRecord, rule: str = FINAL) -> Performance:
    """Return the final policy of a run, on fresh episodes.

    A record from before there was the rule has measured it along the curve only.
    """
    if isinstance(record.finals, dict) and rule in record.finals:
        return record.finals[rule]
    point = record.curve[FINALS[rule](record.curve)]
    return Performance(point.success, point.mean_return, point.n_leaves)


def success(records: list[RunRecord]) -> Floats:
    """Return the success rates of all runs at all evaluations, shape [runs, points]."""
    return np.array([[point.success for point in record.curve] for record in records])


def durations(records: list[RunRecord]) -> Durations:
    """Return how many episodes each run took to the level, or that it did not get there."""
    episodes = [point.episode for point in records[0].curve]
    return trials_to_threshold(episodes, list(success(records)), LEVEL)


def _ratio_of_trials(groups: dict[str, list[RunRecord]], horizon: float) -> Estimate:
    """Return the ratio of restricted mean trials to the level, EU-Tree over C. U-Tree."""
    return restricted_mean_ratio(
        durations(groups["eu-tree"]), durations(groups["c-u-tree"]), horizon
    )


def _smallest_lead(first: Floats, second: Floats) -> Estimate:
    """Return the smallest lead of the mean curve over its points, with its bootstrap interval.

    Runs of the same seed are drawn together.
    """
    lead = first - second  # [runs, points]
    return bootstrap_rows(lambda rows: lead[rows].mean(axis=1).min(axis=1), len(lead))


def draw(axes: "Axes", records: Records) -> None:
    """Draw the learning curves, with intervals over runs shaded."""
    for learner, runs in by_learner(records).items():
        learning_curve(axes, runs, drawing.LABELS[learner])
    drawing.label(axes, "Episodes", "Success (%)", limits=(-2, 102))


def learning_curve(axes: "Axes", runs: list[RunRecord], name: str) -> None:
    """Draw the success of some runs over the episodes."""
    drawing.curve(axes, [point.episode for point in runs[0].curve], 100 * success(runs), name)


def _experiment(name: str, opponents: int, title: str) -> Experiment:
    return Experiment(
        id=name, title=title, specs=partial(specs, opponents), judge=partial(judge, name), draw=draw
    )


FIGURE_2 = _experiment("figure-2", 2, "Figure 2: 2-Evasion, three learners")
FIGURE_3 = _experiment("figure-3", 3, "Figure 3: 3-Evasion, three learners")
