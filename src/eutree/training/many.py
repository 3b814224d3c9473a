"""Many runs as one: each kept in its folder, the best chosen, and judged on other episodes.

Run k has the seed ``seed + k`` and is the run of ``learn`` alone, so the bytes do not depend on
the number of processes or machines. The smallest tree within one standard error of the best, on
episodes that no run has learned from, is the winner. A winner was lucky too, so on others again it
has to deserve to take the place of the start, by the rule of a single run
(:mod:`eutree.training.handover`). Where proven trees are preferred, the winner is the best of those
that are proven, if any is.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import gymnasium
import numpy as np

from eutree.contests import SmallestWithin
from eutree.data import Demonstrations
from eutree.errors import FormatError, InvalidArgumentError, RunFolderError
from eutree.evaluation import Against, CurvePoint, Evaluation, curve_from_csv, evaluate
from eutree.evaluation.curves import curves_to_pandas, table_to_csv
from eutree.files import make_folder, read_bytes, write_text
from eutree.files.atomic import RUN
from eutree.interaction import episode_seed
from eutree.interaction.episode import Stream
from eutree.interaction.first_look import return_range
from eutree.interaction.making import Recipe, make
from eutree.learners import Method
from eutree.learners.learner import GIVEN
from eutree.parallel import Workers
from eutree.policies import TreePolicy
from eutree.proof import Certificate
from eutree.schema import EnvironmentSpec
from eutree.training.evaluations import ProvenFirst
from eutree.training.handover import START, Duel, Handover, Judgement, handover_for, judge
from eutree.training.learn import check_possible, learn, rivalry
from eutree.training.result import LearningResult
from eutree.training.values import Asked, Budget, Folder, Schedule, ShortForms
from eutree.validation import check_function, check_integer, check_seed

MAX_TABLE = 2**24  # bytes
_GIVEN = ("demonstrations", "expert", "method", "start")
COLUMNS = (
    "seed", "mean_return", "return_low", "return_high", "success_rate", "success_low",
    "success_high", "n_leaves", "environment_steps", "winner",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """One of many runs.

    Attributes:
        seed: Its seed.
        path: Its folder.
        n_leaves: Leaves of its policy.
        environment_steps: All environment steps, demonstrations included.
        selection: Its policy's selection episodes, from the same starts for all runs.
    """

    seed: int
    path: Path
    n_leaves: int
    environment_steps: int
    selection: Evaluation

    def curve(self) -> tuple[CurvePoint, ...]:
        """Return its learning curve, from its folder.

        Raises:
            FileError: It is not there any more.
        """
        path = self.path / "curve.csv"
        return curve_from_csv(_text_of(path), path=str(path))


@dataclass(frozen=True, eq=False)
class LearningRuns:
    """Many finished runs.

    Attributes:
        runs: All of them, by seed.
        winner: Number of the one chosen in ``runs``.
        result: The result of the best run.
        judged: Episodes of the policy that is handed over, which chose nothing.
        judgement: The winner's policy against the start on the same episodes, and which of them is
            handed over; None where it is the start, or was handed over without a contest.
        certificate: The proof of the policy that is handed over; None where none was asked for,
            or no run's policy is proven.
        against: Its episodes and those of the rival that ``Handover`` names, from the same starts.
    """

    runs: tuple[FinishedRun, ...]
    winner: int
    result: LearningResult
    judged: Evaluation
    judgement: Judgement | None = None
    certificate: Certificate | None = None
    against: Against | None = None

    @property
    def policy(self) -> TreePolicy:
        """The policy that is handed over."""
        if self.judgement is not None and self.judgement.handed_over == START:
            return self.result.first
        return self.result.policy

    def to_pandas(self) -> Any:
        """Return the learning curves of all runs as one data frame; index: seed, episode.

        Columns: steps, success_rate, mean_return, n_leaves.

        Raises:
            FileError: The curve of a run is not in its folder any more.
            MissingExtraError: pandas is not installed.
        """
        return curves_to_pandas({run.seed: run.curve() for run in self.runs})


class RunsForms(ShortForms, total=False):
    """The arguments of ``learn`` that ``learn_runs`` hands on to each run, and its plain words."""

    demonstrations: Demonstrations | None
    expert: TreePolicy | None
    method: str | Method | None
    start: str | None
    budget: Budget | None
    evaluation: Schedule | None
    handover: Handover | None


def learn_runs(
    environment: EnvironmentSpec | str,
    *,
    runs: int,
    folder: Folder | str | Path | None = None,
    n_jobs: int | None = -1,
    seed: int = 0,
    selection_episodes: int = 200,
    judging_episodes: int = 1000,
    on_run: Callable[[int, FinishedRun], None] = lambda count, run: None,
    **options: Unpack[RunsForms],
) -> LearningRuns:
    """Learn several times, and return all runs, the best of them and how good it is.

    Args:
        environment: Where to learn: an id or how to make it. Each process makes its own.
        runs: Number of runs.
        folder: Where they are written, ``runs/SEED`` each, with the winner's ``policy.json`` and
            the table ``runs.csv``, and whether the runs that are there go on; or ``out``.
        n_jobs: Processes, as ``evaluate`` takes them; a cluster must share the folder.
        seed: Seed of the first run; the others follow.
        selection_episodes: Episodes by which one is chosen: the smallest within one standard error
            of the best.
        judging_episodes: Episodes by which it is judged.
        on_run: Called with the number of finished runs and the last of them.
        **options: As ``learn`` takes them, but for listeners.

    Raises:
        InvalidArgumentError: An argument is not as described.
        RunFolderError: The folder holds runs that are not to be resumed.
    """
    check_integer("runs", runs, low=1)
    check_integer("selection_episodes", selection_episodes, low=2)
    check_integer("judging_episodes", judging_episodes, low=2)
    check_seed(seed)
    check_function("on_run", on_run)
    recipe = Recipe.of(environment)
    spec = recipe.spec
    asked, given = _asked(folder, options)
    workers, question = Workers(n_jobs), asked.handover.prefer_proven
    proven = None if question is None else ProvenFirst(spec, question)
    unproven = replace(asked.handover, prefer_proven=None)  # that is of all runs together
    if asked.folder is None or not asked.folder.resume:
        check_possible(spec, replace(asked, handover=unproven), given, seed=seed)
    where = _opened(asked.folder)
    path = Path(where.path)
    place = (path / "runs").absolute()  # a cluster's processes may be in another folder
    of_one = replace(asked, handover=replace(unproven, against=None))
    task = _Task(recipe, path / "runs", place, selection_episodes, seed, of_one, given)
    found: dict[int, FinishedRun] = {}
    for run in workers.as_finished(task, range(seed, seed + runs)):
        found[run.seed] = run
        on_run(len(found), run)
    ordered = tuple(found[seed + k] for k in range(runs))
    best, certificate = _best_of(ordered, proven)
    with closing(make(spec)) as env:
        result = task.learn(env, ordered[best].seed)
        known = asked.handover.return_range or return_range(env)

    def evaluated(policy: TreePolicy) -> Evaluation:
        fresh = episode_seed(seed, 0, Stream.WINNER)
        return evaluate(policy, spec, episodes=judging_episodes, seed=fresh, n_jobs=n_jobs)

    judged, judgement = evaluated(result.policy), None
    handover = handover_for(result.method, asked.handover)
    if handover is not None and result.against_start is not None and not result.is_start:
        start = evaluated(result.first)
        met = _against_start(handover, result, start, judged, known)
        if met.handed_over != START:
            judgement = met
        elif proven is None or certificate is None:
            judgement, judged = met, start
        elif (of_start := proven.certificate(result.first)) is not None:
            judgement, judged, certificate = met, start, of_start
    learned = LearningRuns(ordered, best, result, judged, judgement, certificate)
    if (rival := asked.handover.against) is not None:
        beside = rivalry(learned.policy, rival, spec, seed=seed, known=known, n_jobs=n_jobs)
        learned = replace(learned, against=beside)
    learned.policy.save(path / "policy.json")
    write_text(path / "runs.csv", _table(ordered, best))
    return learned


def _asked(
    folder: Folder | str | Path | None, options: Mapping[str, Any]
) -> tuple[Asked, dict[str, Any]]:
    """Return the request for each run, and its beginning."""
    for name in ("listeners", "on_progress", "stop", "callback", "tensorboard"):
        if options.get(name) is not None:
            raise InvalidArgumentError(f"{name} must be None for several runs")
    words = dict(options)
    given = {name: words.pop(name) for name in _GIVEN if name in words}
    values = {name: words.pop(name, None) for name in ("budget", "evaluation", "handover")}
    return Asked.of(values | {"folder": folder}, (), words), given


def _opened(folder: Folder | None) -> Folder:
    """Return the folder of the runs, made, unless it holds runs that are not to go on."""
    if folder is None:
        raise InvalidArgumentError("folder must say where several runs are written, got none")
    path = make_folder(folder.path, of=RUN)
    if (path / "config.json").exists():
        raise RunFolderError(f"{path} already holds a single run; choose another folder")
    if any((path / "runs").glob("*/config.json")) and not folder.resume:
        raise RunFolderError(
            f"{path} already holds runs; go on with them (--resume) or choose another folder"
        )
    return replace(folder, path=path)


def _best_of(
    runs: Sequence[FinishedRun], proven: ProvenFirst | None
) -> tuple[int, Certificate | None]:
    """Return the number of the chosen run, and its proof; the best of the proven, if any is."""
    sizes = tuple(run.n_leaves for run in runs)
    selected = np.stack([run.selection.returns for run in runs])
    chosen = SmallestWithin(sizes=sizes, episodes=selected.shape[1]).choice(selected)
    ranking = sorted(
        range(len(runs)), key=lambda k: (k != chosen, -runs[k].selection.mean_return, sizes[k], k)
    )
    if proven is None:
        return ranking[0], None
    found = proven.first(TreePolicy.load(runs[k].path / "policy.json") for k in ranking)
    return (ranking[0], None) if found is None else (ranking[found[0]], found[1])


def _against_start(
    handover: Handover,
    result: LearningResult,
    start: Evaluation,
    judged: Evaluation,
    known: tuple[float, float] | None,
) -> Judgement:
    """Return which is handed over, the start or the winner, by episodes that both have played."""
    by_policy = {id(result.first): start, id(result.policy): judged}
    duel = Duel(
        result.first,
        result.policy,
        lambda policy, starts: by_policy[id(policy)].of_episodes(starts),
        most=start.episodes,
        steps=None,
    )
    sizes = result.first.n_leaves, result.policy.n_leaves
    given = result.start in GIVEN
    return judge(handover, duel, sizes, known=known, challengers=result.challengers, given=given)


def folder_of_winner(path: str | Path) -> Path:
    """Return the folder of the best of several runs; ``path`` itself where it is a single run.

    Raises:
        FormatError: The table of the runs names no winner.
        FileError: The table cannot be read.
    """
    folder = Path(path)
    if not (folder / "runs.csv").exists():
        return folder
    header, *rows = _text_of(folder / "runs.csv").splitlines() or [""]
    table = [dict(zip(header.split(","), row.split(","), strict=False)) for row in rows]
    seeds = [row.get("seed", "") for row in table if row.get("winner") == "1"]
    if len(seeds) != 1 or not seeds[0].isdecimal() or not seeds[0].isascii():
        raise FormatError(folder / "runs.csv", "winner", "must be 1 for one run")
    return folder / "runs" / seeds[0]


def _text_of(path: Path) -> str:
    try:
        return read_bytes(path, limit=MAX_TABLE).decode()
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "must be text in UTF-8") from None


@dataclass(frozen=True, eq=False)
class _Task:
    """One run in a process of its own; the same bytes whichever process does it."""

    recipe: Recipe
    folder: Path
    place: Path
    episodes: int
    seed: int
    asked: Asked
    given: dict[str, Any]

    def learn(self, env: gymnasium.Env[Any, Any], seed: int) -> LearningResult:
        """Return the result of a run, which goes on if it was begun."""
        asked, path = self.asked, self.place / str(seed)
        seconds = None if asked.folder is None else asked.folder.checkpoint_seconds
        folder = Folder(path, resume=True, checkpoint_seconds=seconds)
        return learn(env, folder=folder, seed=seed, **self.given, **asked.arguments())

    def __call__(self, seed: int) -> FinishedRun:
        with closing(self.recipe.make()) as env:
            result = self.learn(env, seed)
            selection = evaluate(
                result.policy,
                env,
                episodes=self.episodes,
                seed=episode_seed(self.seed, 0, Stream.SELECTION),
            )
        steps = result.environment_steps.total
        return FinishedRun(seed, self.folder / str(seed), result.policy.n_leaves, steps, selection)


def _table(runs: Sequence[FinishedRun], winner: int) -> str:
    rows = []
    for number, run in enumerate(runs):
        found = run.selection
        success = found.success_rate, *(found.success_interval or (None, None))
        rows.append((run.seed, found.mean_return, *found.return_interval, *success,
                     run.n_leaves, run.environment_steps, int(number == winner)))  # fmt: skip
    return table_to_csv(COLUMNS, rows)
