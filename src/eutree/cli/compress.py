"""``eutree compress``: fewer leaves, the same decisions."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from eutree.arrays import Floats
from eutree.cli import _options as option
from eutree.cli._output import Result, figures_of, front_drawn, said_what_is_played
from eutree.cli._policies import (
    against_option,
    beside,
    controller,
    load_demonstrations,
    policy_file,
    seen_in,
    set_against,
)
from eutree.cli.parts import cluster, workers_options
from eutree.data import Demonstrations
from eutree.display import counted, fixed
from eutree.errors import EutreeError, InvalidArgumentError, shown
from eutree.evaluation import evaluate
from eutree.files import check_writable
from eutree.interaction.making import make
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from eutree.compression import CompressionReport
    from eutree.compression.episodes import RoundingPlayed
    from eutree.compression.smaller_trees import Rounding
    from eutree.world_model import Transitions

_LESS = (
    " in one process, and the choice plays more; --episodes 20 plays a tenth of the default, "
    "--mode lossless nothing"
)
_FIGURES = """
    n_leaves_before n_leaves_after agreement disagreement_volume method weighted_disagreement
    environment_steps mean_return_before mean_return_after return_range range_known episodes_needed
    imagined by
"""


@option.command(
    "eutree compress runs/a --out small.json --round",
    groups={
        "What is wanted": ("max_leaves", "return_margin", "max_disagreement", "round_thresholds",
                           "monotone"),
        "How it is found": ("mode", "imagined", "weights", "demos", "episodes", "confidence",
                            "return_range", "evaluates"),
        "What is written": ("out", "front", "against"),
    },
    brief=("out", "max_leaves", "return_margin", "round_thresholds", "front", "against", "demos",
           "imagined", "episodes", "seed", "as_json"),
)  # fmt: skip
@click.argument("source", type=click.Path(path_type=Path))
@option.output("--out", text="File to write.", required=True)
@option.path(
    "--demos",
    text="Demonstrations whose observations to keep the decisions on, in place of the run's; "
    "needed where SOURCE is a policy file instead of a run folder, and nothing is played.",
)
@click.option("--mode", default="auto", show_default=True,
              help="auto (by playing, where the policy's environment can be made, else as "
              "lossless), merge (same decision everywhere), lossless, or paper.")  # fmt: skip
@click.option("--max-disagreement", type=float, metavar="SHARE",
              help="Give the smallest tree that changes at most this share of the recorded "
              "decisions.")  # fmt: skip
@option.count("--max-leaves", None, "Give the best tree of at most so many leaves.", least=2)
@click.option("--imagined", is_flag=True,
              help="With --max-leaves, cut where that costs least in episodes imagined by a world "
              "model of the run's transitions, or of --demos where these are given.")  # fmt: skip
@click.option("--weights", default="visits", show_default=True,
              help="What a changed decision costs: visits (1 each) or q-gap (by the values of "
              "the leaves).")  # fmt: skip
@click.option("--return-margin", type=float, metavar="RETURN",
              help="Give the smallest tree whose mean return in the policy's environment is "
              "not lower by more than this.")  # fmt: skip
@click.option("--return-range", type=float, nargs=2, metavar="LOW HIGH",
              help="Lowest and highest return of an episode, where the environment does not say "
              "so itself.")  # fmt: skip
@click.option("--confidence", type=float, default=0.95, show_default=True,
              help="Of the decision about the margin and of each end of the change.")  # fmt: skip
@option.count("--episodes", 1000, "Episodes of each evaluation.", least=2)
@click.option("--evaluate", "evaluates", is_flag=True,
              help="Evaluate before and after in the policy's environment.")  # fmt: skip
@click.option("--round", "round_thresholds", is_flag=False, flag_value="", multiple=True,
              metavar="[[FEATURE=]STEP]",
              help="Write thresholds with the fewest digits that keep the decisions; or, with a "
              "step, as its multiples: 0.1 for all features, room=0.1 for one. May be "
              "repeated.")  # fmt: skip
@against_option
@option.output("--front", text="Folder to write the best tree of each size to.")
@workers_options("the episodes of evaluations, where they take more than a few seconds")
@option.monotone
@option.environment
@option.seed
def compress(
    source: Path,
    out: Path,
    demos: Path | None,
    front: Path | None,
    imagined: bool,
    evaluates: bool,
    return_margin: float | None,
    return_range: tuple[float, float] | None,
    confidence: float,
    episodes: int,
    against: str | None,
    n_jobs: int | None,
    round_thresholds: tuple[str, ...],
    monotone: tuple[str, ...],
    backend: str,
    address: str | None,
    env_arguments: dict[str, Any],
    **options: Any,
) -> Result:
    """Make the tree of SOURCE, a run folder or a policy file, smaller; report the changes."""
    from eutree.compression import ImaginedEpisodes, RealEpisodes, compress_monotone
    from eutree.compression.compressing import ASKED
    from eutree.compression.episodes import ROUNDED_EPISODES
    from eutree.compression.front import few_steps
    from eutree.compression.imagined import N_ASKED
    from eutree.training.many import folder_of_winner

    rounding = _rounding(round_thresholds)
    if source.is_dir():
        source = folder_of_winner(source)
    policy = TreePolicy.load(source / "policy.json" if source.is_dir() else policy_file(source))
    plays = options["mode"] == "auto" and options["max_disagreement"] is None and not imagined
    spec, unplayed, rival = None, "", None
    if against is not None:
        rival = controller(against, "--against", _where(source, policy, env_arguments))
    evaluates = evaluates or return_margin is not None or bool(env_arguments)
    if evaluates:
        spec = _where(source, policy, env_arguments)
    elif plays or imagined or rounding is not False:
        spec, unplayed = _where_trees_play(policy)
    evaluates |= plays and spec is not None
    if not evaluates:
        option.refuse({"confidence", "return_range"}, f"no returns are compared{unplayed}")
    real = spec and RealEpisodes(
        spec, return_margin, confidence, episodes, return_range, n_jobs, evaluates, searches=plays
    )
    # Where nothing can be played, the world model of the run's own transitions chooses.
    imagined |= bool(plays and unplayed and options["max_leaves"] is not None and source.is_dir())
    if front is not None and not plays and return_margin is None:
        raise InvalidArgumentError("--front needs a search, by playing or with --return-margin")
    if unplayed and front is not None:
        raise InvalidArgumentError(f"--front needs an environment to play in{unplayed}")
    observations = _observations(source, demos, policy, needed=not plays or real is None)
    check_writable(out)
    pairs = episodes * (evaluates + (rival is not None))
    pairs += min(episodes, ROUNDED_EPISODES) * (spec is not None and rounding is not False)
    asked = ASKED * N_ASKED * (spec is not None and imagined)  # to see whether imagination is true
    playing = said_what_is_played(2 * pairs + asked)
    if plays or return_margin is not None:  # it searches
        playing = said_what_is_played(few_steps(episodes), steps=True, less=_LESS)
    with cluster(backend, address), playing:
        small, report = compress_monotone(
            policy,
            observations,
            monotone,
            imagined=ImaginedEpisodes(_experience(source, demos, policy)) if imagined else None,
            env=real,
            round_thresholds=rounding,
            **options,
        )
        found = None
        if rival is not None:
            where, seed = _where(source, policy, env_arguments), options["seed"]
            mine = evaluate(small, where, episodes=episodes, seed=seed, n_jobs=n_jobs)
            found = set_against(rival, where, mine, name=against, seed=seed, n_jobs=n_jobs)
    small.save(out)
    paths = _front_written(report, front)
    change = report.return_change
    return Result(
        {
            **figures_of(report, _FIGURES),
            "return_change": None if change is None else list(change.interval),
            "rounding": None if report.rounding is None else vars(report.rounding),
            "front": [one.facts(path) for one, path in zip(report.front, paths, strict=True)],
            "against": None if found is None else found.facts(),
            "path": str(out),
        },
        f"{small}\n{front_drawn(report.front, 'start')}"
        f"{_in_words(report, len(observations))}{unplayed}; written to {out}{beside(found)}",
    )


def _where(source: Path, policy: TreePolicy, arguments: dict[str, Any]) -> EnvironmentSpec:
    """Return the environment of a policy, some of its arguments replaced."""
    if policy.environment is None:
        raise InvalidArgumentError(
            f"{source} must name an environment for --evaluate, --return-margin, --against and "
            "--env-arg"
        )
    return policy.environment.override(arguments)


def _observations(source: Path, demos: Path | None, policy: TreePolicy, *, needed: bool) -> Floats:
    """Return the recorded observations; none where none were and the tree's own episodes do."""
    from eutree.training import stored_observations

    if demos is not None:
        return seen_in(demos, policy)
    if source.is_dir():
        return policy.derivation.behind(stored_observations(source))
    if needed:
        raise InvalidArgumentError(
            f"{source} must be a run folder, or --demos must name recorded observations"
        )
    return np.empty((0, policy.tree.n_features))


def _front_written(report: "CompressionReport", folder: Path | None) -> list[str | None]:
    """Write the trees of the front, if a folder is named; return where each one is."""
    if folder is None:
        return [None] * len(report.front)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [
        folder / ("start.json" if number == 0 else f"{one.policy.n_leaves}.json")
        for number, one in enumerate(report.front)
    ]
    for one, path in zip(report.front, paths, strict=True):
        one.policy.save(path)
    return [str(path) for path in paths]


def _experience(
    source: Path, demos: Path | None, policy: TreePolicy
) -> "Transitions | Demonstrations":
    """Return the experience to which a world model is fitted."""
    from eutree.training import stored_transitions

    if demos is not None:
        return load_demonstrations(demos, policy)
    if source.is_dir():
        return stored_transitions(source, policy.schema.n_actions)
    raise InvalidArgumentError("--imagined needs a run folder, or --demos")


def _rounding(texts: tuple[str, ...]) -> "Rounding":
    """Return the rounding that ``--round`` asks for: none, the fewest digits, or steps."""
    if not texts:
        return False
    steps: dict[str, float] = {}
    for text in filter(None, texts):
        name, _, number = text.rpartition("=")
        if name in steps:
            raise InvalidArgumentError(f"--round must give one step for {name or 'all features'}")
        try:
            steps[name] = float(number)
        except ValueError:
            raise InvalidArgumentError(
                f"--round must be alone, a step, or FEATURE=STEP, got {shown(text)}; write it "
                "after SOURCE"
            ) from None
    if "" in steps and len(steps) > 1:
        raise InvalidArgumentError("--round must be one step for all features, or FEATURE=STEP")
    return steps.get("", steps or True)


def _in_words(report: "CompressionReport", n_rows: int) -> str:
    rows = f"{n_rows} recorded observations" if n_rows else "the observations of 100 episodes"
    words = (
        f"{_change(report)} ({report.method}, chosen by {report.by}); the same decision on "
        f"{report.agreement:.2%} of {rows}, another on "
        f"{report.disagreement_volume:.3%} of the observation box"
    )
    if report.imagined is not None:
        (before, after), digits = report.imagined, fixed(2, report.imagined)
        words += f"; imagined to earn {before:{digits}} before, {after:{digits}} after"
    if report.return_change is not None:
        change = report.return_change
        digits = fixed(2, [report.mean_return_before or 0.0, report.mean_return_after or 0.0])
        words += (
            f"; mean return {report.mean_return_before:{digits}} before, "
            f"{report.mean_return_after:{digits}} after, a change in {change.interval:{digits}} "
            f"on {change.n} fresh episodes, {report.environment_steps} environment steps in all"
            f"{_condition(report)}"
        )
    if report.rounding is not None:
        words += f"; {_played(report.rounding)}"
    return words


def _where_trees_play(policy: TreePolicy) -> tuple[EnvironmentSpec | None, str]:
    """Return where trees are played; or None, and why they are not."""
    spec = policy.environment
    if spec is None:
        return None, "; nothing was played: the policy names no environment"
    try:
        make(spec).close()
    except EutreeError as error:
        return None, f"; nothing was played: {error}"
    return spec, ""


def _played(rounding: "RoundingPlayed") -> str:
    if not rounding.different:
        return f"rounded, it earned the same in each of {rounding.episodes} episodes"
    digits = fixed(2, [rounding.exact, rounding.rounded])
    words = (
        f"rounded, it earned another return in {rounding.different} of {rounding.episodes} "
        f"episodes: {rounding.exact:{digits}} on average with the exact thresholds, "
        f"{rounding.rounded:{digits}} with the rounded ones"
    )
    return words if rounding.kept else f"{words}, which is more than may be lost: they stay exact"


def _change(report: "CompressionReport") -> str:
    before, after = report.n_leaves_before, report.n_leaves_after
    if before == after:
        better = "" if report.method != "return" else ", but a better one of that size"
        smaller = [one for one in report.front if one.policy.n_leaves < before]
        found = "no smaller tree earns as much" if smaller else "no smaller tree was found"
        if any(one.success_rate is not None for one in smaller):
            found += " and succeeds as often"
        return f"still {counted(before, 'leaf')}: {found}{better}"
    return f"{counted(before, 'leaf')} became {after}"


def _condition(report: "CompressionReport") -> str:
    """Return the condition of the bounds of the return, and why no margin could be shown."""
    low, high = report.return_range or (0.0, 0.0)
    words = ""
    if not report.range_known:
        words = (
            f"; the range of returns is not known, so these bounds hold only if no episode returns "
            f"less than {low:g} or more than {high:g} (say better with --return-range)"
        )
    if report.episodes_needed is not None:
        words += (
            f"; so few episodes cannot show this margin for any tree where returns lie in "
            f"[{low:g}, {high:g}]: ask for at least {report.episodes_needed} (--episodes)"
        )
    return words
