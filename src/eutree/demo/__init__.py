"""``eutree demo``, the whole main job: demonstrate, fit, learn, judge, compress, export, report.

It shows the use of the program: a person shows a task, C4.5 makes a tree of it, the world turns
out to be different, learning mends the tree, and the changes can be read.
"""

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from eutree.compression import RealEpisodes, compress
from eutree.compression.smaller_trees import rounded
from eutree.data import Demonstrations
from eutree.demo.page import DemoResult, DemoSettings, PlayedDemo, demo_report, story_of
from eutree.display import counted
from eutree.envs.experts import experts_for
from eutree.errors import FileError
from eutree.evaluation import Evaluation, evaluate
from eutree.export import to_c, to_svg
from eutree.files import make_folder, write_text
from eutree.inspection import diff
from eutree.interaction import episode_seed
from eutree.interaction.episode import Stream
from eutree.interaction.making import make
from eutree.learners import fit_expert_tree
from eutree.policies import TreePolicy
from eutree.recording import record
from eutree.report import run_page
from eutree.schema import EnvironmentSpec
from eutree.training.handover import judged
from eutree.training.many import FinishedRun, learn_runs
from eutree.validation import check_choice

__all__ = ["run_demo", "settings_for", "table_rows"]

Say = Callable[[str], None]
Follow = Callable[[int, FinishedRun], None]

MARK = ".eutree-demo"

EXPERT, LEARNED, COMPRESSED = "Expert tree", "Learned tree", "Compressed tree"


def run_demo(settings: DemoSettings, out: Path, *, say: Say, follow: Follow) -> DemoResult:
    """Run the main job and write everything to the folder ``out``, which need not exist.

    ``say`` takes a sentence before each step, ``follow`` the number of finished runs and the last
    of them.
    """
    known = experts_for(settings.environment.id)
    name = next(iter(known)) if settings.expert is None else settings.expert
    check_choice("expert", name, known)
    for spec in (settings.environment, settings.changed):
        make(spec).close()  # a mistake must not cost an earlier report
    folder = _fresh_folder(out)
    demonstrations = _demonstrate(settings, name, folder, say)
    expert = fit_expert_tree(demonstrations)
    expert.save(folder / "expert.json")
    say(f"the tree that was shown has {counted(expert.n_leaves, 'leaf')}, by C4.5")
    once = f", now that {settings.story.changed}" if settings.story.changed else ""
    say(f"{counted(settings.runs, 'run')} of learning{once} (compiling takes a while, once)")
    runs = learn_runs(  # the best is chosen by episodes of its own
        settings.changed,
        runs=settings.runs,
        out=folder / "learned",
        n_jobs=settings.n_jobs,
        seed=settings.seed,
        selection_episodes=max(2, settings.story.final_episodes // 5),
        judging_episodes=settings.story.final_episodes,
        on_run=follow,
        demonstrations=demonstrations,
        expert=expert,
        **settings.story.learning,
    )
    ground = None
    if settings.story.plays:
        say("making it smaller: the best tree of each size, by playing")
        ground = RealEpisodes(settings.changed, n_jobs=settings.n_jobs, searches=True)
    recorded = runs.result.history.observations
    small, compression = compress(
        runs.policy, recorded, round_thresholds=True, env=ground, seed=settings.seed
    )
    small.save(folder / "small.json")
    write_text(folder / "small.c", to_c(small))
    write_text(folder / "small.svg", to_svg(small))
    policies = {EXPERT: expert, LEARNED: runs.policy, COMPRESSED: small}
    say(f"judging each tree on {settings.story.final_episodes} fresh episodes")
    evaluations = {
        EXPERT: _judge(settings, expert),
        LEARNED: runs.judged,
        COMPRESSED: _judge(settings, small),
    }
    at_home = _judge(settings, expert, at=settings.environment) if settings.story.change else None
    played = PlayedDemo.of(expert, small, settings.changed, seed=settings.seed)
    seen = played.observations
    result = DemoResult(
        settings=settings,
        folder=folder,
        demonstrations=demonstrations,
        policies=policies,
        evaluations=evaluations,
        at_home=at_home,
        judgement=judged(evaluations[EXPERT], evaluations[COMPRESSED], challengers=0),
        runs=runs,
        compression=compression,
        played=played,
        changes=diff(rounded(expert, seen), small, observations=seen),
        source=(folder / "small.c").read_text(encoding="utf-8"),
    )
    write_text(result.report, run_page(demo_report(result)))
    return result


def table_rows(result: DemoResult) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of a table of the policies."""
    succeeds = all(e.success_rate is not None for e in result.evaluations.values())
    header = ["Policy", "Leaves", "Return", "95 % interval"]
    rows = []
    for name, evaluation in result.evaluations.items():
        low, high = evaluation.return_interval
        row = [name, str(result.policies[name].n_leaves), f"{evaluation.mean_return:.1f}"]
        row.append(f"{low:.1f} to {high:.1f}")
        if evaluation.success_rate is not None and evaluation.success_interval is not None:
            least, most = evaluation.success_interval
            rate = f"{100 * evaluation.success_rate:.1f} %"
            row.append(f"{rate} ({100 * least:.1f} to {100 * most:.1f})")
        rows.append(row)
    return [*header, "Success"] if succeeds else header, rows


def settings_for(environment: EnvironmentSpec, **choices: Any) -> DemoSettings:
    """Return the settings of an environment's own story."""
    return DemoSettings(environment=environment, story=story_of(environment.id), **choices)


def _fresh_folder(path: Path) -> Path:
    """Return an empty folder; only the files of an earlier demo are replaced there."""
    if (path / MARK).exists():
        shutil.rmtree(path)
    if path.exists() and any(path.iterdir()):
        raise FileError("write to", path, "the folder is not empty and no earlier demo made it")
    folder = make_folder(path)
    write_text(folder / MARK, "made by eutree demo; the next demo replaces this folder\n")
    return folder


def _demonstrate(settings: DemoSettings, name: str, folder: Path, say: Say) -> Demonstrations:
    expert = experts_for(settings.environment.id)[name]
    say(f"the scripted demonstrator {name!r} shows {settings.environment}")
    with closing(make(settings.environment)) as env:
        shown = record(env, expert, episodes=settings.demonstrations, seed=settings.seed)
    shown.save(folder / "demonstrations")
    say(f"{counted(len(shown), 'episode')} shown, {counted(shown.n_transitions, 'step')}")
    return shown


def _judge(
    settings: DemoSettings, policy: TreePolicy, *, at: EnvironmentSpec | None = None
) -> Evaluation:
    """Evaluate on the episodes on which the best run was judged: they chose nothing."""
    return evaluate(
        policy,
        at or settings.changed,
        episodes=settings.story.final_episodes,
        seed=episode_seed(settings.seed, 0, Stream.WINNER),
        n_jobs=settings.n_jobs,
    )
