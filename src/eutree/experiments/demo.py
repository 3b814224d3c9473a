"""The whole main job once: demonstrate, fit, learn, evaluate, compress, export, report.

It is the paper's loop in small: 15 demonstrations of a scripted demonstrator, the expert tree, a
few learning runs of the EU-Tree beside the C. U-Tree, and a table like Table 2.
"""

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import gymnasium

from eutree.compression import CompressionReport, compress
from eutree.data import Demonstrations
from eutree.envs.experts import experts_for
from eutree.errors import FileError
from eutree.evaluation import CurvePoint, Evaluation, evaluate
from eutree.evaluation.intervals import mean_interval
from eutree.experiments.runs import STARTS
from eutree.export import to_c, to_svg
from eutree.files import make_folder, write_text
from eutree.interaction import record
from eutree.interaction.making import make
from eutree.learners.expert_tree import fit_expert_tree
from eutree.policies import TreePolicy
from eutree.report import RunReport, run_page
from eutree.schema import EnvironmentSpec
from eutree.training import LearningResult, Run, learn
from eutree.validation import check_choice
from eutree.wording import counted

Say = Callable[[str], None]
Follow = Callable[[str, Run], None]

MARK = ".eutree-demo"


class Measure(NamedTuple):
    """What a chart shows of each evaluation, and what it can be: intervals end there."""

    value: Callable[[CurvePoint], float | None]
    low: float = -inf
    high: float = inf


MEASURES = {
    "success rate": Measure(lambda point: point.success_rate, 0.0, 1.0),
    "return": Measure(lambda point: point.mean_return),
    "leaves": Measure(lambda point: float(point.n_leaves), 1.0),
}
LABELS = {"eu-tree": "EU-Tree", "c-u-tree": "C. U-Tree"}


@dataclass(frozen=True, kw_only=True)
class DemoSettings:
    """How much of everything.

    Attributes:
        environment: Where.
        expert: Name of the scripted demonstrator; None takes the environment's first.
        demonstrations: Episodes to record.
        runs: Learning runs of each learner, with seeds of their own.
        episodes: Episodes of each learning run.
        evaluate_every: Episodes between two frozen evaluations.
        evaluation_episodes: Episodes of each of them.
        final_episodes: Episodes of the comparison at the end.
        seed: Seed of everything.
    """

    environment: EnvironmentSpec
    expert: str | None = None
    demonstrations: int = 15
    runs: int = 3
    episodes: int = 200
    evaluate_every: int = 20
    evaluation_episodes: int = 50
    final_episodes: int = 500
    seed: int = 0


@dataclass(frozen=True, eq=False)
class DemoResult:
    """What the demo made.

    Attributes:
        policies: Expert tree, learned trees and the compressed tree, by name.
        evaluations: How each of them did.
        compression: What compression changed.
        report: The HTML report.
    """

    policies: Mapping[str, TreePolicy]
    evaluations: Mapping[str, Evaluation]
    compression: CompressionReport
    report: Path


def run_demo(settings: DemoSettings, out: Path, *, say: Say, follow: Follow) -> DemoResult:
    """Run the main job and write everything to ``out``.

    Args:
        settings: How much of everything.
        out: Folder to write; made if it does not exist.
        say: Takes a sentence before each step.
        follow: Takes the learner's label and its run after each episode.
    """
    env, name = make(settings.environment), _expert_name(settings)
    folder = _fresh_folder(out)  # not before: a mistake must not cost an earlier report
    demonstrations = _demonstrate(settings, env, name, folder, say)
    expert = fit_expert_tree(demonstrations)
    expert.save(folder / "expert.json")
    say(f"C4.5 made an expert tree of {counted(expert.n_leaves, 'leaf')}:\n{expert}")
    starts: dict[str, dict[str, Any]] = {
        "eu-tree": {"demonstrations": demonstrations, "expert": expert},
        "c-u-tree": {},
    }
    results = {
        name: _learn(name, settings, start, folder, say, follow) for name, start in starts.items()
    }
    learned = results["eu-tree"][0]
    small, compression = compress(learned.policy, learned.history.observations)
    small.save(folder / "small.json")
    write_text(folder / "small.c", to_c(small))
    write_text(folder / "small.svg", to_svg(small))
    say(f"compressed {compression.n_leaves_before} leaves to {compression.n_leaves_after}")
    policies = {
        "Expert tree": expert,
        "C. U-Tree": results["c-u-tree"][0].policy,
        "EU-Tree": learned.policy,
        "EU-Tree, compressed": small,
    }
    say(f"evaluating each on {settings.final_episodes} fresh episodes")
    evaluations = {
        name: evaluate(
            policy, settings.environment, episodes=settings.final_episodes, seed=settings.seed
        )
        for name, policy in policies.items()
    }
    page = run_page(_report(settings, demonstrations, policies, evaluations, results))
    write_text(folder / "report.html", page)
    return DemoResult(policies, evaluations, compression, folder / "report.html")


def table_rows(
    policies: Mapping[str, TreePolicy], evaluations: Mapping[str, Evaluation]
) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of a table like the paper's Table 2."""
    succeeds = all(e.success_rate is not None for e in evaluations.values())
    header = ["Policy", "Leaves", "Return", "95 % interval"]
    rows = []
    for name, result in evaluations.items():
        low, high = result.return_interval
        row = [name, str(policies[name].n_leaves), f"{result.mean_return:.1f}"]
        row.append(f"{low:.1f} to {high:.1f}")
        if result.success_rate is not None and result.success_interval is not None:
            least, most = result.success_interval
            row.append(f"{result.success_rate:.1%} ({least:.1%} to {most:.1%})")
        rows.append(row)
    return [*header, "Success"] if succeeds else header, rows


def _fresh_folder(path: Path) -> Path:
    """Return an empty folder; what an earlier demo left there is replaced, nothing else is."""
    if (path / MARK).exists():
        shutil.rmtree(path)
    if path.exists() and any(path.iterdir()):
        raise FileError("write to", path, "the folder is not empty and no earlier demo made it")
    folder = make_folder(path)
    write_text(folder / MARK, "made by eutree demo; the next demo replaces this folder\n")
    return folder


def _expert_name(settings: DemoSettings) -> str:
    known = experts_for(settings.environment.id)
    return (
        next(iter(known))
        if settings.expert is None
        else check_choice("expert", settings.expert, known)
    )


def _demonstrate(
    settings: DemoSettings, env: gymnasium.Env[Any, Any], name: str, folder: Path, say: Say
) -> Demonstrations:
    expert = experts_for(settings.environment.id)[name]
    say(f"the scripted demonstrator {name!r} shows {settings.environment} to the learner")
    demonstrations = record(env, expert, episodes=settings.demonstrations, seed=settings.seed)
    demonstrations.save(folder / "demonstrations")
    say(f"{len(demonstrations)} demonstrations, {demonstrations.n_transitions} transitions")
    return demonstrations


def _learn(
    name: str,
    settings: DemoSettings,
    start: dict[str, Any],
    folder: Path,
    say: Say,
    follow: Follow,
) -> Sequence[LearningResult]:
    """Run one learner with several seeds; the first run is kept in a folder."""
    say(f"{LABELS[name]} learns: {settings.runs} runs of {settings.episodes} episodes")
    results = []
    for run in range(settings.runs):
        label = f"{LABELS[name]} {run + 1}"
        result = learn(
            make(settings.environment),
            **start,
            start=STARTS[name],
            episodes=settings.episodes,
            evaluate_every=settings.evaluate_every,
            evaluation_episodes=settings.evaluation_episodes,
            seed=settings.seed + run,
            out=folder / "runs" / name if run == 0 else None,
            on_progress=partial(follow, label),
        )
        results.append(result)
    return results


def _report(
    settings: DemoSettings,
    demonstrations: Demonstrations,
    policies: Mapping[str, TreePolicy],
    evaluations: Mapping[str, Evaluation],
    results: Mapping[str, Sequence[LearningResult]],
) -> RunReport:
    header, rows = table_rows(policies, evaluations)
    curves = {
        name: {LABELS[learner]: _series(runs, measure) for learner, runs in results.items()}
        for name, measure in MEASURES.items()
    }
    return RunReport(
        title=f"{settings.environment}: shown, learned, compressed, exported",
        curves={k: v for k, v in curves.items() if all(v.values())},
        header=header,
        rows=rows,
        trees={k: policies[k] for k in ("Expert tree", "EU-Tree", "EU-Tree, compressed")},
        files=[
            ("the demonstrations", "demonstrations"),
            ("the expert tree", "expert.json"),
            ("the EU-Tree's run: policy, curve, progress, events, checkpoint", "runs/eu-tree"),
            ("the C. U-Tree's run", "runs/c-u-tree"),
            ("the compressed tree", "small.json"),
            ("the compressed tree in C", "small.c"),
            ("the compressed tree, drawn", "small.svg"),
        ],
        notes=[
            f"{len(demonstrations)} demonstrations by {demonstrations.expert}, "
            f"{demonstrations.n_transitions} transitions. {settings.runs} learning runs of "
            f"{settings.episodes} episodes each; the shaded bands are 95 % intervals over runs. "
            f"The table is of {settings.final_episodes} fresh episodes a policy."
        ],
    )


def _series(
    runs: Sequence[LearningResult], measure: Measure
) -> list[tuple[int, float, float, float]]:
    """Return (episode, mean, low, high) of a measure over runs; nothing where it is unknown."""
    series = []
    for points in zip(*(run.curve for run in runs), strict=True):
        values = [known for known in map(measure.value, points) if known is not None]
        if len(values) < len(points):
            return []
        low, high = mean_interval(values)
        low, high = max(low, measure.low), min(high, measure.high)
        series.append((points[0].episode, fmean(values), low, high))
    return series
