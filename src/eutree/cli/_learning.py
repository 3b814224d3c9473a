"""The words of ``eutree learn``: how a run goes, and its result."""

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eutree.cli._given import keep
from eutree.cli._output import ProgressLine, figures_of, front_drawn, progress, runs_as_values, say
from eutree.cli._policies import beside
from eutree.display import counted
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from rich.table import Table

    from eutree.training import LearningResult, Run
    from eutree.training.many import FinishedRun, LearningRuns

_EARNED = "mean_return return_interval success_rate success_interval"
NOT_BELIEVED = "the learned tree is not believed to earn more than the tree of fit"
_SAID_HERE = logging.NullHandler()  # a command says itself which method was chosen


class Following:
    """Keeps the command in the run's folder, and shows where the run stands.

    That is how much of the budget is used, and the present policy.
    """

    def __init__(self, progress: ProgressLine, out: Path) -> None:
        logging.getLogger("eutree.training.planned").addHandler(_SAID_HERE)
        self._progress, self._out = progress, out
        self._has_said = False

    def __call__(self, run: "Run") -> None:
        """Show where the run stands now."""
        keep(self._out)
        if not self._has_said and run.beginning.reason:
            say(run.beginning.reason)
        self._has_said = True
        self._progress.stage(*progress_of(run), present(run))


def progress_of(run: "Run") -> tuple[str, int, int]:
    """Return the stage under way, how much of its budget is used, and that budget."""
    from eutree.learners.learner import HasStages
    from eutree.training.phases import MANY

    plan, at = run.plan, run.at
    stage = run.learner.stage_name if isinstance(run.learner, HasStages) else "learning"
    if run.racing.search is not None and plan.race is not None:
        return "racing", at.racing_steps, plan.race.steps
    if not plan.gathers:
        return "learning", at.updates, plan.episodes
    if plan.episodes < MANY:
        return stage, at.episode, plan.episodes
    if plan.steps is not None:
        return stage, at.steps, plan.steps - plan.race_steps
    return "learning", int(at.seconds), int(plan.seconds or 0)


def present(run: "Run") -> str:
    """Return the present policy in a few words: its size, and the last that is known of it."""
    if run.racing.search is not None:
        state = run.racing.search.state
        leaves = counted(state.incumbent.n_leaves, "leaf")
        return f"{leaves}, {state.won} of {state.tried} challengers won"
    sizes = (event["n_leaves"] for event in reversed(run.state.events) if "n_leaves" in event)
    leaves = counted(next(sizes, run.first.n_leaves), "leaf")
    if not run.curve:
        return leaves
    point = run.curve[-1]
    if run.at.updated_at <= point.episode:
        return point.describe()
    return f"{leaves}; at episode {point.episode}: {point.describe()}"


def as_values(result: "LearningResult", out: Path) -> dict[str, Any]:
    """Return a result for ``--json``."""
    from eutree.training.run_folder import names_of

    steps, judgement = result.environment_steps, result.against_start
    offline = result.against_fit is not None and result.handed_over == "start"
    why = NOT_BELIEVED if offline else "" if judgement is None else judgement.why
    return {
        "method": result.method.name,
        **figures_of(result, "reason start episodes steps evaluation_episodes challengers"),
        "environment_steps": vars(steps) | {"total": steps.total},
        "n_leaves": result.policy.n_leaves,
        "handed_over": result.handed_over,
        "why": why,
        "against_start": None if judgement is None else judgement.facts(),
        "front": [
            one.facts(str(out / name))
            for one, name in zip(result.front, names_of(result.front), strict=True)
        ],
        "certificate": None if result.certificate is None else result.certificate.figures(),
        "against_fit": None if result.against_fit is None else result.against_fit.facts(),
        "against": None if result.against is None else result.against.facts(),
        "model_trust": None if result.model_trust is None else result.model_trust.figures(),
        "path": str(out / "policy.json"),
        "curve": [
            figures_of(point, "episode success_rate mean_return n_leaves") for point in result.curve
        ],
    }


def in_words(result: "LearningResult", out: Path, *, recorded: int | None) -> str:
    """Return a result in a sentence: its cost, its tree, and the gain over its start.

    ``recorded`` are the episodes that all was learned from; None if it gathered its own.
    """
    last = result.curve[-1].describe() if result.curve else counted(result.policy.n_leaves, "leaf")
    if result.picked is not None and not result.front:  # it was on trial, and no curve knows it
        last = f"last adopted: {last}"
    experience = f"{counted(result.episodes, 'episode')}, {counted(result.steps, 'step')}"
    if recorded is not None:
        experience = f"{counted(recorded, 'recorded episode')}, none of its own"
    counts = result.environment_steps
    raced = f" and {counts.racing} of racing" if counts.racing else ""
    if result.evaluation_episodes:
        raced += f", {counted(result.evaluation_episodes, 'more episode')} of evaluation"
    if counts.total and recorded is None:
        raced += (
            f"; {counts.total} steps counted, {counts.demonstrations} of them in demonstrations"
        )
    words = f"{result.method.name} from {result.start}: {experience}{raced}; {last}"
    words += _against_start(result)
    if result.against_fit is not None:
        words += f"; {result.against_fit.describe()}"
    if result.model_trust is not None:
        words += f"; {result.model_trust.describe()}"
    if counts.declared:
        words += (
            f"; its teacher was trained in {counted(counts.declared, 'step')}, "
            "as declared, which are not among these"
        )
    judgement = result.against_start
    verdict = "" if judgement is None else judgement.verdict()
    picked = None if result.picked is None else result.picked.n_leaves
    front = front_drawn(result.front, "learned", picked).rstrip()
    proven = "" if result.certificate is None else str(result.certificate)
    lines = [f"{words}; written to {out}", *filter(None, [front, verdict, proven])]
    return "\n".join(lines) + beside(result.against)


def _against_start(result: "LearningResult") -> str:
    """Return the gain over the start, to follow other words; nothing if that is not known."""
    if result.against_start is None:
        return ""
    return f"; {result.against_start.describe(result.first.n_leaves)}"


def run_many(
    spec: EnvironmentSpec, runs: int, n_jobs: int, out: Path, options: dict[str, Any]
) -> "LearningRuns":
    """Learn several times, with one progress display."""
    from eutree.training.many import learn_runs

    with progress("runs", runs) as line:

        def show(count: int, run: "FinishedRun") -> None:
            keep(out)
            line.update(count, f"seed {run.seed}: {run.selection}")

        return learn_runs(spec, runs=runs, n_jobs=n_jobs, out=out, on_run=show, **options)


def many_results(learned: "LearningRuns", out: Path) -> "tuple[dict[str, Any], Table]":
    """Return several runs for ``--json``, and as a table."""
    from rich.table import Table

    result, judged = learned.result, learned.judged
    judgement = learned.judgement or result.against_start
    values = as_values(replace(result, against=learned.against), out) | {
        "n_leaves": learned.policy.n_leaves,
        "handed_over": "learned" if judgement is None else judgement.handed_over,
        "why": "" if judgement is None else judgement.why,
        "runs": runs_as_values(learned, _EARNED),
        "certificate": None if learned.certificate is None else learned.certificate.figures(),
        "judged": {"episodes": judged.episodes, **figures_of(judged, _EARNED)},
    }
    best = learned.runs[learned.winner]
    table = Table(
        "", "seed", "return [95 %]", "success [95 %]", "leaves",
        caption=f"The best of {counted(len(learned.runs), 'run')} on "
        f"{counted(best.selection.episodes, 'episode')} of their own is that of seed {best.seed}"
        f"{_against_start(result)}. On {judged}. Written to {out / 'policy.json'}."
        + ("" if judgement is None else f"\n{judgement.verdict()}")
        + ("" if learned.certificate is None else f"\n{learned.certificate}")
        + beside(learned.against),
        caption_justify="left",
    )  # fmt: skip
    for number, run in enumerate(learned.runs):
        known, rate = run.selection, run.selection.success_rate
        table.add_row(
            "*" if number == learned.winner else "",
            str(run.seed),
            known.return_interval.around(known.mean_return, 2),
            "" if rate is None else f"{rate:.1%} {known.success_interval:.1%}",
            str(run.n_leaves),
        )
    return values, table
