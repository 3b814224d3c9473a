"""The content of the demo's page, in the words of its story.

A demonstrator who does everything right leaves nothing to learn. So the world changes after the
demonstrations (the opponents of Evasion become faster), or the demonstrator is mediocre from the
start (the plain scripts of Gymnasium's tasks). Budgets are chosen so that the whole demo takes
about a minute on two cores for Evasion and a few minutes for the others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.compression import CompressionReport
from eutree.data import Demonstrations, Episode
from eutree.display import counted
from eutree.evaluation import Evaluation, Interval
from eutree.inspection import PolicyDiff
from eutree.parallel import Workers
from eutree.policies import TreePolicy
from eutree.report import CHANGES_ID, Headline, RunReport, Table, WatchedEpisode, WatchedTree, watch
from eutree.report.chart import curves
from eutree.report.html import Pointer, Verdict, changed_leaves
from eutree.report.watching import film_if_possible
from eutree.schema import EnvironmentSpec
from eutree.training import Judgement
from eutree.training.many import FinishedRun, LearningRuns

STARTS = 60  # of which one is shown: where learning made the largest difference
MOST_CHANGES = 6


@dataclass(frozen=True, kw_only=True)
class Story:
    """The course of the demo in an environment."""

    # Arguments of the environment that are others after the demonstrations
    change: Mapping[str, Any] = field(default_factory=dict)
    changed: str = ""  # what that means, to follow "once" in a sentence; empty without one
    # Options of ``learn``: the method if it is not the default one, and budgets
    learning: Mapping[str, Any] = field(default_factory=dict)
    # Whether compression looks for the best tree of each size by playing; else it keeps every
    # recorded decision. Where episodes run side by side it takes half a minute.
    plays: bool = False
    final_episodes: int = 1000  # fresh ones on which every policy is judged


_PLANNING = {"episodes": 200, "evaluate_every": 20, "evaluation_episodes": 50}
_FASTER = Story(
    change={"opponent_speed": 4.2},
    changed="the opponents run at 4.2 instead of 3.2 m/s",
    learning=_PLANNING,
    plays=True,
)
_RACED = {"episodes": 20, "evaluate_every": 10, "evaluation_episodes": 20, "race_steps": 20_000}

_STORIES = {
    "eutree/Evasion-v0": _FASTER,
    "eutree/Evasion2-v0": _FASTER,
    "eutree/Evasion3-v0": _FASTER,
    "CartPole-v1": Story(learning=_RACED, final_episodes=100),
    "LunarLander-v3": Story(
        learning={
            "method": "distilled-dqn",
            "steps": 90_000,
            "max_leaves": 34,
            "evaluate_every": 100,
            "evaluation_episodes": 10,
        },
        final_episodes=200,
    ),
}


def story_of(environment: str) -> Story:
    """Return the demo's story in an environment, given its id; a plain story for others."""
    name = environment.rpartition(":")[2]
    return _STORIES.get(name, Story(learning=_PLANNING, final_episodes=200))


@dataclass(frozen=True, kw_only=True)
class DemoSettings:
    """The settings of a demo."""

    environment: EnvironmentSpec  # in which the demonstrations are shown
    story: Story = field(default_factory=Story)  # the change, the learning and the budget
    expert: str | None = None  # the scripted demonstrator; None takes the environment's first
    demonstrations: int = 15  # episodes to record
    runs: int = 3  # of learning, with seeds of their own; the best is chosen
    n_jobs: int = -1  # processes, as joblib counts them
    seed: int = 0  # of the demonstrations, the runs and the evaluations

    @property
    def changed(self) -> EnvironmentSpec:
        """Where it learns and is judged."""
        arguments = dict(self.environment.arguments) | dict(self.story.change)
        return EnvironmentSpec(self.environment.id, arguments)


@dataclass(frozen=True, eq=False)
class PlayedDemo:
    """Episodes of two policies from the same starts."""

    before: Sequence[Episode]  # episodes of the expert tree
    after: Sequence[Episode]  # episodes of the compressed tree

    @classmethod
    def of(
        cls, before: TreePolicy, after: TreePolicy, spec: EnvironmentSpec, *, seed: int
    ) -> "PlayedDemo":
        """Let both play."""
        return cls(
            *(
                [w.episode for w in watch(p, spec, episodes=STARTS, seed=seed, pictures=False)]
                for p in (before, after)
            )
        )

    @property
    def observations(self) -> Floats:
        """The observations on which the later policy decided, shape [N, d]."""
        return np.concatenate([episode.observations[:-1] for episode in self.after])

    @property
    def largest_gain(self) -> int:
        """The start at which the later policy earned most above the earlier one."""
        gains = [
            after.undiscounted_return - before.undiscounted_return
            for before, after in zip(self.before, self.after, strict=True)
        ]
        return int(np.argmax(gains))


@dataclass(frozen=True, eq=False)
class DemoResult:
    """All results of the demo."""

    settings: DemoSettings
    folder: Path  # of its files
    demonstrations: Demonstrations
    policies: Mapping[str, TreePolicy]  # expert tree, learned tree and compressed tree, by name
    evaluations: Mapping[str, Evaluation]  # how each did on the same fresh episodes
    at_home: Evaluation | None  # how the expert tree did where it was shown, if that is elsewhere
    judgement: Judgement  # the compressed tree against the expert tree
    runs: LearningRuns
    compression: CompressionReport
    played: PlayedDemo  # from the same starts
    changes: PolicyDiff  # where the compressed tree decides otherwise than the expert tree
    source: str  # the C function

    @property
    def report(self) -> Path:
        """The HTML report."""
        return self.folder / "report.html"

    @property
    def small(self) -> TreePolicy:
        """The tree that is handed over."""
        return tuple(self.policies.values())[-1]

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        return "".join(part if isinstance(part, str) else part.words for part in self.sentence)

    @property
    def sentence(self) -> Verdict:
        """The result in a sentence, which calls nothing better that 95 % intervals do not part."""
        story, change = self.settings.story, self.judgement
        before, *_, after = self.evaluations.values()
        once = f" once {story.changed}" if story.changed else ""
        leaves = counted(self.small.n_leaves, "leaf")
        first = f"The tree that was shown {_does(before)}{once}"
        earns = 0 if change.is_start else _told(change.return_interval)
        succeeds = None if change.success_interval is None else _told(change.success_interval)
        told = {earns, succeeds} - {None, 0}
        if not told:
            return [
                f"{first}; what was learned {_does(after)} with {leaves}, which "
                f"{after.episodes:,} episodes cannot tell apart."
            ]
        end = f": with {leaves} it {_does(after)}."
        if succeeds is None or (succeeds and told != {1, -1}):
            better = "Learning mends it" if told == {1} else "Learning harms it"
            return [f"{first}. ", Pointer(better, CHANGES_ID), end]
        better = f"Learning makes it earn {'more' if earns > 0 else 'less'}"
        end = f", {after.mean_return:.4g} in place of {before.mean_return:.4g}{end}"
        if not succeeds:
            end += f" Whether it succeeds more often, {after.episodes:,} episodes cannot tell."
        return [f"{first}. ", Pointer(better, CHANGES_ID), end]


def demo_report(result: DemoResult) -> RunReport:
    """Return the content of the page."""
    settings, (expert, *_, small) = result.settings, result.policies.values()
    observations, runs = result.played.observations, result.runs
    named = {_name(run, k == runs.winner): run.curve() for k, run in enumerate(runs.runs)}
    return RunReport(
        title=f"eutree demo, {settings.environment.id}: shown, learned, compressed, exported",
        verdict=result.sentence,
        notes=[_measured(result)],
        stages=_stages(result),
        watched=WatchedTree(
            small,
            _filmed(result),
            changed_leaves(expert, small, observations),
            observations,
            "The tree that learning and compression made. A dashed outline marks leaves that "
            "decide otherwise than the tree that was shown; the lit path follows the episode.",
        ),
        changes=[(b.words, b.visited or 0.0) for b in result.changes.boxes if b.visited][
            :MOST_CHANGES
        ],
        curves=curves(named),
        front=result.compression.front,
        picked=small.n_leaves,
        tables={"The runs": _runs(result), "The trees": _trees(result)},
        trees={name: policy for name, policy in result.policies.items() if policy is not small},
        texts={f"The C function: {len(result.source.splitlines())} lines": result.source},
        files=[
            ("the demonstrations", "demonstrations"),
            ("the expert tree", "expert.json"),
            ("every run: policy, curve, events, checkpoint", "learned/runs"),
            ("the best run's tree", "learned/policy.json"),
            ("the compressed tree", "small.json"),
            ("the compressed tree in C", "small.c"),
            ("the compressed tree, drawn", "small.svg"),
        ],
    )


def _told(interval: Interval) -> int:
    """Return 1 or -1 where an interval of a difference lies above or below 0, else 0."""
    return int(interval.low > 0.0) - int(interval.high < 0.0)


def _does(evaluation: Evaluation) -> str:
    """Return the success or the return of a policy: "succeeds in 58 % of all episodes"."""
    if evaluation.success_rate is None:
        return f"earns {evaluation.mean_return:.4g}"
    return f"succeeds in {_percent(evaluation.success_rate)} of all episodes"


def _percent(share: float) -> str:
    """Return a share with one digit more where it is close to all or nothing."""
    return f"{100 * share:.0f} %" if 0.02 <= share <= 0.98 else f"{100 * share:.1f} %"


def _measured(result: DemoResult) -> str:
    gain = f"{result.judgement.return_change:+.1f} {result.judgement.return_interval:.1f}"
    same = "every decision the same" if result.judgement.is_start else f"return {gain}"
    *_, after = result.evaluations.values()
    return (
        f"On {after.episodes:,} fresh episodes that chose nothing, the same for all "
        f"trees: {same} against the tree that was shown. Brackets are 95 % intervals."
    )


def _figures(evaluation: Evaluation) -> tuple[str, str]:
    """Return the figure of a policy and its interval: success, or else the return."""
    if evaluation.success_rate is None or evaluation.success_interval is None:
        return f"{evaluation.mean_return:.1f}", f"{evaluation.return_interval:.1f}"
    return _percent(evaluation.success_rate), f"{evaluation.success_interval.percent:.1f}"


def _stages(result: DemoResult) -> list[Headline]:
    shown, story, runs = result.demonstrations, result.settings.story, result.runs
    before, learned, after = result.evaluations.values()
    leaves = counted(next(iter(result.policies.values())).n_leaves, "leaf")
    words = f"{counted(len(shown), 'demonstration')}, {leaves}"
    if result.at_home is None:
        stages = [Headline("The tree that was shown", *_figures(before), words)]
    else:
        stages = [
            Headline("The tree that was shown", *_figures(result.at_home),
                     f"{words}, nothing changed"),
            Headline("The same tree, another world", *_figures(before), f"now {story.changed}"),
        ]  # fmt: skip
    best = runs.runs[runs.winner]
    steps = f"{best.environment_steps:,} steps, the best of {counted(len(runs.runs), 'run')}"
    stages.append(Headline("After learning", *_figures(learned), steps))
    lines = len(result.source.splitlines())
    words = f"{result.compression.n_leaves_before} leaves before; a C function of {lines} lines"
    stages.append(Headline(f"Compressed to {counted(result.small.n_leaves, 'leaf')}",
                           *_figures(after), words))  # fmt: skip
    return stages


def _filmed(result: DemoResult) -> list[WatchedEpisode]:
    """Return the start at which learning made the largest difference, and a demonstration."""
    changed, at = result.settings.changed, result.played.largest_gain
    played = [
        (changed, result.played.after[at], "After learning"),
        (changed, result.played.before[at], "Before, from the same start"),
        (result.settings.environment, result.demonstrations.episodes[0], "As it was shown"),
    ]
    return Workers(result.settings.n_jobs).map(_film, played)


def _film(played: tuple[EnvironmentSpec, Episode, str]) -> WatchedEpisode:
    spec, episode, by = played
    return film_if_possible(spec, episode, by=by)


def _name(run: FinishedRun, chosen: bool) -> str:
    return f"run {run.seed}" + ", chosen" * chosen


def _runs(result: DemoResult) -> Table:
    runs = result.runs
    success = all(run.selection.success_rate is not None for run in runs.runs)
    rows = []
    for number, run in enumerate(runs.runs):
        row = [_name(run, number == runs.winner), str(run.n_leaves), f"{run.environment_steps:,}"]
        rows.append(row + _cells(run.selection, success))
    count = counted(runs.runs[0].selection.episodes, "episode")
    return Table(
        ["run", "leaves", "steps", *_titles(success)],
        rows,
        f"Chosen by the mean return of {count} that no run learned from.",
        runs.winner,
    )


def _trees(result: DemoResult) -> Table:
    before = next(iter(result.evaluations.values()))
    success = before.success_rate is not None
    rows = [
        [name, str(result.policies[name].n_leaves), *_cells(evaluation, success)]
        for name, evaluation in result.evaluations.items()
    ]
    caption = f"Judged on {before.episodes:,} fresh episodes, the same for all."
    return Table(["tree", "leaves", *_titles(success)], rows, caption, len(rows) - 1)


def _titles(success: bool) -> list[str]:
    return ["return [95 %]", "worst; 5 % quantile", *["success [95 %]"] * success]


def _cells(evaluation: Evaluation, success: bool) -> list[str]:
    cells = [
        f"{evaluation.mean_return:.1f} {evaluation.return_interval:.1f}",
        f"{evaluation.worst_return:.1f}; {evaluation.return_quantile_05:.1f}",
    ]
    if success and evaluation.success_interval is not None:
        percent = evaluation.success_interval.percent
        cells.append(f"{100 * (evaluation.success_rate or 0.0):.1f} % {percent:.1f}")
    return cells
