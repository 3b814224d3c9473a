"""Figures 4 and 5: other opponent speeds than the one that was demonstrated."""

from typing import TYPE_CHECKING

import numpy as np

from eutree.arrays import Floats
from eutree_lab.paper import drawing
from eutree_lab.paper.claims import Claim, claimed
from eutree_lab.paper.experiment import Experiment, ExperimentScale, Records, by_learner, by_speed
from eutree_lab.paper.figure_2_3 import LEVEL, durations, learning_curve, success
from eutree_lab.paper.runs import DEMONSTRATED_SPEED, RunRecord, RunSpec
from eutree_lab.statistics import bootstrap, restricted_mean, spearman

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAR = 0.5  # m/s from the demonstrated speed that Figure 5 draws dark and solid


def expert_specs(scale: ExperimentScale, preset: str) -> list[RunSpec]:
    """Return the expert trees of 3.2 m/s at every speed; they learn nothing."""
    return _at_every_speed("expert", scale, preset)


def learning_specs(scale: ExperimentScale, preset: str) -> list[RunSpec]:
    """Return EU-Tree runs at every speed, and C. U-Tree runs at the demonstrated one."""
    domain = scale.environment(2)
    c_u_tree = [scale.spec(domain, "c-u-tree", preset, run) for run in range(scale.runs)]
    return _at_every_speed("eu-tree", scale, preset) + c_u_tree


def _at_every_speed(learner: str, scale: ExperimentScale, preset: str) -> list[RunSpec]:
    return [
        scale.spec(scale.environment(2), learner, preset, run, speed)
        for speed in scale.speeds
        for run in range(scale.runs)
    ]


def judge_4a(records: Records) -> list[Claim]:
    """Return the claims about the fixed expert tree."""
    speeds = by_speed(records)
    slower = [
        np.mean([runs[seed].final.success for v, runs in speeds.items() if v <= 3.2])
        for seed in range(len(speeds[max(speeds)]))
    ]
    fastest = [record.final.success for record in speeds[max(speeds)]]
    return [
        claimed("figure-4a/slower-opponents", bootstrap(slower)),
        claimed("figure-4a/half-at-the-fastest", bootstrap(fastest)),
    ]


def judge_4b(records: Records) -> list[Claim]:
    """Return the claim that learning time follows the expert's quality."""
    speeds = by_speed(by_learner(records)["eu-tree"])
    quality, time = [], []
    for runs in speeds.values():
        quality.append(float(np.mean([r.expert.success for r in runs if r.expert])))
        time.append(_trials(runs))
    return [claimed("figure-4b/time-follows-quality", spearman(quality, time))]


def judge_5(records: Records) -> list[Claim]:
    """Return the claims about the learning curves at all speeds."""
    groups = by_learner(records)
    speeds = by_speed(groups["eu-tree"])
    plain = success(groups["c-u-tree"]).mean(axis=1)
    means = {speed: success(runs).mean(axis=1) for speed, runs in speeds.items()}
    worst = min(means, key=lambda speed: float(means[speed].mean()))
    near = np.mean([m for v, m in means.items() if abs(v - DEMONSTRATED_SPEED) <= NEAR], axis=0)
    far = np.mean([m for v, m in means.items() if abs(v - DEMONSTRATED_SPEED) > NEAR], axis=0)
    return [
        claimed("figure-5/no-worse-than-c-u-tree", bootstrap(means[worst] - plain), worst=worst),
        claimed("figure-5/scales-with-quality", bootstrap(near - far)),
    ]


def _trials(runs: list[RunRecord]) -> float:
    """Return the restricted mean of the episodes to the level."""
    horizon = float(runs[0].curve[-1].episode)
    return restricted_mean(durations(runs), horizon)


def draw_4a(axes: "Axes", records: Records) -> None:
    """Draw the expert trees' success at every speed."""
    speeds = by_speed(records)
    values = _matrix({v: [100 * r.final.success for r in runs] for v, runs in speeds.items()})
    drawing.curve(axes, list(speeds), values, "Expert tree", style="o-")
    axes.axvline(DEMONSTRATED_SPEED, color="#999999", linestyle=":", linewidth=1)
    drawing.label(axes, "Opponent speed (m/s)", "Success (%)", limits=(-2, 102))


def draw_4b(axes: "Axes", records: Records) -> None:
    """Draw the episodes to learn at every speed."""
    speeds = by_speed(by_learner(records)["eu-tree"])
    times = [_trials(runs) for runs in speeds.values()]
    axes.bar(
        list(speeds),
        times,
        width=0.07,
        color=["#e0a070" if v == DEMONSTRATED_SPEED else "#a8480c" for v in speeds],
        label=f"EU-Tree to {LEVEL:.0%}",
    )
    limits = None
    if not any(times):  # nothing can be seen of bars without a height
        limits = (0.0, 100.0)
        said = f"0 at every speed: each expert tree\nis at {LEVEL:.0%} before it learns"
        axes.text(0.5, 0.5, said, transform=axes.transAxes, ha="center", va="center")
    drawing.label(axes, "Opponent speed (m/s)", "Episodes", limits=limits)


def draw_5(axes: "Axes", records: Records) -> None:
    """Draw the learning curves at all speeds: near ones dark and solid, far ones dashed."""
    groups = by_learner(records)
    for speed, runs in by_speed(groups["eu-tree"]).items():
        near = abs(speed - DEMONSTRATED_SPEED) <= NEAR + 1e-9
        axes.plot(
            [point.episode for point in runs[0].curve],
            100 * success(runs).mean(axis=0),
            "-" if near else "--",
            color="#a8480c" if near else "#d9a98a",
            linewidth=1.2,
        )
    learning_curve(axes, groups["c-u-tree"], "C. U-Tree")
    axes.plot([], [], "-", color="#a8480c", label="EU-Tree, 2.7 to 3.7 m/s")
    axes.plot([], [], "--", color="#d9a98a", label="EU-Tree, further away")
    drawing.label(axes, "Episodes", "Success (%)", limits=(-2, 102))


def _matrix(values: dict[float, list[float]]) -> Floats:
    """Return the values as [runs, speeds]."""
    return np.array(list(values.values())).T


FIGURE_4A = Experiment(
    id="figure-4a",
    title="Figure 4(a): the fixed expert tree at other opponent speeds",
    specs=expert_specs,
    judge=judge_4a,
    draw=draw_4a,
)
FIGURE_4B = Experiment(
    id="figure-4b",
    title="Figure 4(b): learning time at other opponent speeds",
    specs=learning_specs,
    judge=judge_4b,
    draw=draw_4b,
)
FIGURE_5 = Experiment(
    id="figure-5",
    title="Figure 5: learning curves at other opponent speeds",
    specs=learning_specs,
    judge=judge_5,
    draw=draw_5,
)
