"""``eutree demos``: look at demonstrations, edit them, check them, exchange them."""

from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from eutree.cli import _options as option
from eutree.cli._output import Result, figures_of, say
from eutree.cli.fit import hurting
from eutree.data import DemonstrationFolder, Demonstrations, Episode, LogFormat, derive
from eutree.data.csv_files import MAX_CSV, read_csv
from eutree.data.episode import DROPPED, TAUGHT
from eutree.data.log_format import KNOWN, seconds_of
from eutree.display import counted
from eutree.errors import InvalidArgumentError, blamed
from eutree.files import check_writable, read_bytes, write_text
from eutree.interaction import GuardedEnv
from eutree.interaction.episode import environment_for
from eutree.interaction.episode import replay as replay_all
from eutree.interaction.making import make
from eutree.interaction.names import Names, as_named, given_names, kinds_of
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees.text import labelled

_OWN = ("episode", "action", "reward", "allowed")  # columns that may have other names
_KINDS = "minari:ID, or a file ending in .csv or .npz"


@click.group(epilog="Example: eutree demos list demos/")
def demos() -> None:
    """List, check, replay, edit, import and export demonstrations; find the seconds that hurt."""


demos.add_command(hurting)
demos.command_class = option.ResultCommand


_folder = click.argument("folder", type=click.Path(path_type=Path))
_numbers = click.argument("numbers", type=int, nargs=-1, required=True)


@demos.command("list", epilog="Example: eutree demos list demos/")
@_folder
def list_(folder: Path) -> Result:
    """List the episodes of FOLDER with result, length and return."""
    opened = DemonstrationFolder(folder)
    rows = opened.read_all()
    return Result(
        {
            "environment": None if opened.environment is None else str(opened.environment),
            "expert": opened.expert,
            "episodes": [
                {
                    "episode": number,
                    "kept": one.kept,
                    "length": len(one),
                    "undiscounted_return": one.undiscounted_return if one.has_rewards else None,
                    **figures_of(one, "ending is_success seed comment"),
                }
                for number, one in rows.items()
            ],
        },
        _table(rows, str(opened.environment or folder)),
    )


@demos.command(epilog="Example: eutree demos keep demos/ 3 7")
@_folder
@_numbers
@click.option("--comment", help="A remark to store with the episodes.")
def keep(folder: Path, numbers: tuple[int, ...], comment: str | None) -> Result:
    """Let learners use the episodes NUMBERS of FOLDER (again)."""
    return _kept(folder, numbers, comment, kept=True)


@demos.command(epilog='Example: eutree demos drop demos/ 3 --comment "pressed too late"')
@_folder
@_numbers
@click.option("--comment", help="A remark to store with the episodes.")
def drop(folder: Path, numbers: tuple[int, ...], comment: str | None) -> Result:
    """Discard the episodes NUMBERS of FOLDER; they stay, marked, and `keep` takes them back."""
    return _kept(folder, numbers, comment, kept=False)


@demos.command(epilog="Example: eutree demos trim demos/ 3 --steps 20")
@_folder
@click.argument("number", type=int)
@click.option("--steps", type=click.IntRange(min=1), required=True, help="How many to leave.")
def trim(folder: Path, number: int, steps: int) -> Result:
    """Cut the episode NUMBER of FOLDER off after some steps."""
    opened = _open_to_edit(folder)
    episode = opened.read(number)
    if steps >= len(episode):
        raise InvalidArgumentError(
            f"--steps must be less than the {len(episode)} steps of episode {number}, got {steps}"
        )
    shorter = replace(
        episode,
        observations=episode.observations[: steps + 1],
        actions=episode.actions[:steps],
        rewards=episode.rewards[:steps],
        steps={name: array[:steps] for name, array in episode.steps.items()},
        terminated=False,
        truncated=False,
        ending="trimmed",
        is_success=None,
        extras={name: said for name, said in episode.extras.items() if name != DROPPED},
    )
    opened.write(number, shorter)
    left = counted(steps, "step")
    return Result({"episode": number, "length": steps}, f"episode {number} now has {left}")


@demos.command(epilog="Example: eutree demos rename demos/ names.json")
@_folder
@click.argument("names", type=click.Path(path_type=Path))
def rename(folder: Path, names: Path) -> Result:
    """Name the features and actions of FOLDER by the file NAMES, which is as for --names."""
    opened = _open_to_edit(folder)
    schema = Names.load(names).of(opened.schema)
    _check_kinds(schema, opened.read_all().values())
    opened.rename(schema)
    said = {
        "features": [labelled(feature) for feature in opened.schema.features],
        "actions": list(opened.schema.actions),
    }
    lines = [f"{kind}: {', '.join(entries)}" for kind, entries in said.items()]
    return Result(said, "\n".join(lines))


@demos.command(epilog="Example: eutree demos replay demos/ 3 --window")
@_folder
@click.argument("number", type=int)
@click.option("--window", is_flag=True, help="Run it again and show it in a window.")
@option.module
def replay(folder: Path, number: int, window: bool) -> Result:
    """Show the episode NUMBER of FOLDER step by step."""
    opened = DemonstrationFolder(folder)
    episode = opened.read_all().get(number)
    if episode is None:
        raise InvalidArgumentError(f"{folder} has no episode {number}")
    if window:
        _show(opened, episode)
    names = opened.schema.feature_names
    steps: list[dict[str, Any]] = [
        {
            "step": step,
            "observation": dict(zip(names, episode.observations[step].tolist(), strict=True)),
            "action": opened.schema.actions[int(episode.actions[step])],
            "reward": float(episode.rewards[step]) if episode.has_rewards else None,
        }
        for step in range(len(episode))
    ]
    lines = [
        f"{step['step']:5}  "
        + ", ".join(
            f"{feature.name} {feature.text(step['observation'][feature.name])}"
            for feature in opened.schema.features
        )
        + f"  -> {step['action']}"
        + (f"  reward {step['reward']:g}" if episode.has_rewards else "")
        for step in steps
    ]
    earned = f"return {episode.undiscounted_return:g}" if episode.has_rewards else "no rewards"
    result = f"{episode.ending or 'no ending recorded'}, {earned}"
    values = {"episode": number, "ending": episode.ending, "steps": steps}
    return Result(values, "\n".join([*lines, result]))


@demos.command(epilog="Example: eutree demos check demos/")
@_folder
@click.option("--env", "environment", help="The environment; the one of FOLDER if not given.")
@option.environment
def check(folder: Path, environment: str | None, env_arguments: dict[str, Any]) -> Result:
    """Run every episode of FOLDER again from its seed and actions; compare bit for bit.

    The exit code is 0 if all are equal and 1 if one is not.
    """
    recorded, numbers = _all_of(folder)
    spec = recorded.environment if environment is None else EnvironmentSpec(environment)
    other = spec if environment or env_arguments else None
    env = None if other is None else make(other.override(env_arguments))
    results = replay_all(recorded, env)
    problems = [
        {"episode": numbers[one.episode], "problem": one.problem}
        for one in results
        if not one.is_equal
    ]
    equal = len(results) - len(problems)
    lines = [f"episode {one['episode']}: {one['problem']}" for one in problems]
    lines.append(f"{equal} of {len(results)} episodes are equal bit for bit")
    values = {"episodes": len(results), "equal": equal, "problems": problems}
    return Result(values, "\n".join(lines), 1 if problems else 0)


@demos.command(epilog="Example: eutree demos merge monday/ tuesday/ --out demos/")
@click.argument("folders", type=click.Path(path_type=Path), nargs=-1, required=True)
@option.output("--out", text="A new folder.", required=True)
def merge(folders: tuple[Path, ...], out: Path) -> Result:
    """Put the episodes of several FOLDERS of one environment into a new folder."""
    opened = [DemonstrationFolder(folder) for folder in folders]
    for other in opened[1:]:
        opened[0].check_same(other.schema, other.environment)
    episodes = tuple(e for folder in opened for e in folder.read_all().values())
    alone = {(e.seed, e.observations.tobytes(), e.actions.tobytes()) for e in episodes}
    if twice := len(episodes) - len(alone):
        say(f"warning: {counted(twice, 'episode')} of these repeat another one, bit for bit")
    experts = ", ".join(dict.fromkeys(folder.expert for folder in opened if folder.expert))
    merged = Demonstrations(episodes, opened[0].schema, opened[0].environment, experts)
    _check_kinds(merged.schema, merged.episodes)
    merged.save(out)
    return _written(merged, str(out))


@demos.command(epilog="Example: eutree demos stats demos/ --html demos.html")
@_folder
@option.output("--html", text="Write the summary as a page, too.")
def stats(folder: Path, html: Path | None) -> Result:
    """Say how well FOLDER does the task, and whether more would help."""
    from eutree.report import demonstration_figures, demonstrations_page

    shown, numbers = _all_of(folder)
    if html is not None:
        check_writable(html)
    figures = demonstration_figures(shown)
    values, said = figures.values(), figures.words()
    if html is not None:
        title = f"Demonstrations in {folder}"
        write_text(html, demonstrations_page(shown, title=title, numbers=numbers, figures=figures))
        values["path"] = str(html)
        said += f"\nwritten to {html}"
    return Result(values, said)


@demos.command(
    "import", cls=option.Helped,
    brief=("out", "environment", "episode_column", "action_column", "reward_column", "drop",
           "nominal", "missing", "time", "actions", "as_json"),
    epilog="Example: eutree demos import minari:eutree/evasion2/human-v0 --out demos/",
)  # fmt: skip
@click.argument("source", type=click.Path())
@option.output("--out", text="A new folder.", required=True)
@click.option("--env", "environment", help="The environment, if SOURCE has none or no names.")
@click.option("--episode-column", help="Column of a .csv that says which episode; else 'episode'.")
@click.option("--action-column", help="Column with the actions, names or numbers; else 'action'.")
@click.option("--reward-column", help="Column with the rewards (more is better); else 'reward'.")
@click.option("--allowed-column", help="Column with the actions allowed then; else 'allowed'.")
@click.option("--delimiter", help="What separates the values; else as the first line shows.")
@click.option("--drop", multiple=True, metavar="COLUMN", help="A column that is no feature.")
@click.option("--nominal", multiple=True, metavar="COLUMN",
              help="A column of text: each category becomes a feature.")  # fmt: skip
@click.option("--missing", default="", metavar="hold|drop|NUMBER",
              help="What an empty cell means: the value before it; the row is left out and the "
              "episode ends; a number.")  # fmt: skip
@click.option("--time", default="", metavar="COLUMN", help="The column of the time.")
@click.option("--time-format", default="", metavar="FORMAT",
              help="Its form, '%d.%m.%Y %H:%M', where it is not seconds or ISO 8601.")  # fmt: skip
@click.option("--episode-gap", metavar="SPAN", help="A pause that ends an episode: 90s, 1h.")
@click.option("--one-episode", is_flag=True, help="All rows are one episode.")
@click.option("--ends-in-place", is_flag=True,
              help="Keep the last action of an episode that terminated, as if it had ended where "
              "that was taken, if no row follows.")  # fmt: skip
@click.option("--actions", metavar="NAME,NAME,...", help="The actions, in order.")
@option.environment
def import_(
    source: str,
    out: Path,
    environment: str | None,
    delimiter: str | None,
    episode_gap: str | None,
    actions: str | None,
    env_arguments: dict[str, Any],
    **log: Any,
) -> Result:
    """Read demonstrations from SOURCE: minari:ID, or a file ending in .csv or .npz.

    A .csv has one row for each observation, in order. Two columns are required: "episode" (which
    one; any text) and "action" (taken there; names, numbers from 0, or quantities as 0 and 1500).
    "step", "action_name", "reward", "terminated", "truncated", "seed", "ending", "is_success",
    "kept" and "allowed" (the actions that were, divided by blanks; empty for all) are known; every
    other column is a feature, its unit in brackets: "level [m]". The last row of an episode has an
    empty action: it shows where the last action led. Without such a row the last action is left
    out. A machine's log without marks of episodes is read by --time, or as --one-episode.
    """
    kind = _kind("SOURCE", source)
    columns = {name: own for name in _OWN if (own := log.pop(f"{name}_column")) is not None}
    log_format = LogFormat(
        episode_gap=None if episode_gap is None else seconds_of(episode_gap),
        actions=() if actions is None else tuple(name.strip() for name in actions.split(",")),
        **log,
    )
    in_place: dict[str, Any] = {"ends_in_place": log_format.ends_in_place} if kind == "npz" else {}
    given = columns or delimiter is not None or log_format != LogFormat(**in_place)
    if kind != "csv" and given:
        raise InvalidArgumentError(f"columns and --delimiter are for a file .csv, got {source!r}")
    if environment is None and env_arguments:
        raise InvalidArgumentError(f"arguments need --env, got {', '.join(env_arguments)}")
    known: dict[str, Any] = {}
    rows, names = {"filled": 0, "left out": 0}, given_names()
    if environment is not None:
        with closing(make(EnvironmentSpec(environment, env_arguments))) as env:
            guarded = GuardedEnv(env)
            known = {"schema": guarded.schema, "environment": guarded.spec}
    if kind == "minari":
        loaded = replace(Demonstrations.from_minari(source.removeprefix("minari:")), **known)
    elif kind == "csv":
        table = partial(read_csv, source, columns=columns, delimiter=delimiter, log=log_format)
        episodes, schema, rows["filled"], rows["left out"] = table(known.get("schema"))
        if not known and (ordered := as_named(schema, names)) != schema:
            episodes, schema, *_ = table(ordered)
        with blamed(source):
            loaded = Demonstrations(episodes, schema, known.get("environment"), Path(source).stem)
    else:
        loaded = Demonstrations.from_npz(source, **in_place, **known)
    if not any(map(len, loaded.episodes)):
        raise InvalidArgumentError(
            f"{source} holds no transition: that takes two rows of an episode, the second of which "
            "is what the first one's action led to"
        )
    if names is not None:
        as_named(loaded.schema, names)  # refuses names of which only some stand elsewhere
        loaded = replace(loaded, schema=names.of(loaded.schema, f"those in {source}"))
    _check_kinds(loaded.schema, loaded.episodes)
    if names is not None and names.derived and not loaded.schema.derived:
        loaded = derive(loaded, names.derived)
    loaded.save(out)
    return _written(loaded, str(out), **rows)


def _check_kinds(schema: Schema, episodes: Iterable[Episode]) -> None:
    """Raise InvalidArgumentError where a value is not of the kind of its feature."""
    values = np.vstack([np.empty((0, schema.n_features)), *(one.observations for one in episodes)])
    for feature, column in zip(schema.measured.features, values.T, strict=False):
        fits = (column == np.floor(column)) & (feature.low <= column) & (column <= feature.high)
        if feature.is_integer and not fits.all():
            what = f"a whole number from {feature.low:g} to {feature.high:g}"
            raise InvalidArgumentError(
                f"kind of {feature.name!r} must be that of its values: it is declared to be "
                f"{what}, and {column[~fits][0]:g} was recorded"
            )


@demos.command(epilog="Example: eutree demos export demos/ minari:eutree/evasion2/human-v0")
@_folder
@click.argument("target", type=option.Written())
@option.module
def export(folder: Path, target: str) -> Result:
    """Write the kept episodes of FOLDER to TARGET: minari:ID, or a file .csv or .npz.

    A .csv file also holds the discarded episodes, marked. A Minari dataset names the environment if
    it is registered, by Gymnasium itself or by the module of --import.
    """
    kind = _kind("TARGET", target)
    there = read_bytes(target, limit=MAX_CSV) if kind == "csv" and Path(target).is_file() else b""
    if there and not there.startswith(",".join(KNOWN).encode()):
        raise InvalidArgumentError(f"TARGET must be no log of another program, got {target}")
    demonstrations, _ = _all_of(folder)
    write = {"minari": demonstrations.to_minari, "csv": demonstrations.to_csv}
    write.get(kind, demonstrations.to_npz)(target.removeprefix("minari:"))
    marks = {"by_hand": "steps that a tree drove", TAUGHT: "steps cut or flipped"}
    lost = [said for name, said in marks.items() if any(name in e.steps for e in demonstrations)]
    if lost and kind != "minari":
        say(
            f"warning: the marks of {' and '.join(lost)} are not in the table; who reads it "
            "imitates each step as it was taken"
        )
    if kind == "csv" and (gone := _gone(demonstrations)):
        spec = demonstrations.environment
        how = "--names and --actions" if spec is None else f"--env {spec.id}"
        say(f"warning: {' and '.join(gone)} are not in the table; demos import takes them by {how}")
    return _written(demonstrations, target)


def _gone(demonstrations: Demonstrations) -> list[str]:
    """Return what a table alone does not tell of features and actions."""
    schema = demonstrations.schema
    taken = {action for one in demonstrations.episodes for action in one.actions.tolist()}
    found = {
        "kinds of features": bool(kinds_of(schema)),
        "units that hold a bracket": any("]" in feature.unit for feature in schema.features),
        "actions that were never taken": len(taken) < schema.n_actions,
    }
    return [said for said, is_so in found.items() if is_so]


def _open_to_edit(folder: Path) -> DemonstrationFolder:
    """Open a folder, and first turn the journals of dead recorders into episodes."""
    opened = DemonstrationFolder(folder)
    opened.recover()
    return opened


def _all_of(folder: Path) -> tuple[Demonstrations, list[int]]:
    """Return the episodes of a folder, at least one, and the number of each."""
    opened = DemonstrationFolder(folder)
    episodes = opened.read_all()
    if not episodes:
        raise InvalidArgumentError(
            f"{folder} holds no episodes yet; record some: eutree record ENV --out {folder}"
        )
    every = tuple(episodes.values())
    shown = Demonstrations(every, opened.schema, opened.environment, opened.expert)
    return shown, list(episodes)


def _kept(folder: Path, numbers: tuple[int, ...], comment: str | None, *, kept: bool) -> Result:
    opened = _open_to_edit(folder)
    episodes = {number: opened.read(number) for number in numbers}  # all exist, or none is changed
    for number, episode in episodes.items():
        was = "" if kept and not episode.kept else episode.comment  # why it was discarded
        text = was if comment is None else comment
        opened.write(number, replace(episode, kept=kept, comment=text))
    word = "kept" if kept else "discarded"
    listing = ", ".join(map(str, episodes))
    return Result({"episodes": list(episodes), "kept": kept}, f"{word}: {listing}")


def _kind(argument: str, name: str) -> str:
    if name.startswith("minari:"):
        return "minari"
    if name.endswith((".csv", ".npz")):
        return name[-3:]
    raise InvalidArgumentError(f"{argument} must be {_KINDS}; got {name!r}")


def _show(folder: DemonstrationFolder, episode: Episode) -> None:
    """Run an episode again in a window."""
    shown = Demonstrations((episode,), folder.schema, folder.environment)
    with closing(environment_for(shown, render_mode="human")) as env:
        guarded = GuardedEnv(env)
        guarded.reset(episode.seed)
        for action in episode.actions.tolist():
            guarded.step(action)


def _table(rows: dict[int, Episode], title: str) -> Any:
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title))
    for name in ("episode", "", "ending", "steps", "return", "seed", "comment"):
        numbers = name in ("episode", "steps", "return")
        table.add_column(name, justify="right" if numbers else "left")
    for number, episode in rows.items():
        table.add_row(
            str(number),
            "kept" if episode.kept else "discarded",
            escape(episode.ending),
            str(len(episode)),
            f"{episode.undiscounted_return:g}" if episode.has_rewards else "",
            "" if episode.seed is None else str(episode.seed),
            escape(episode.comment),
        )
    return table


def _written(demonstrations: Demonstrations, path: str, **rows: int) -> Result:
    cut = [episode for episode in demonstrations.episodes if DROPPED in episode.extras]
    earned = any(one.has_rewards for one in cut)
    lost = ", so what it earned counts nowhere (but see --ends-in-place)" if earned else ""
    said = {f"; {counted(n, 'row')} with empty cells {fate}": n for fate, n in rows.items()}
    last = f"; the last action of {counted(len(cut), 'episode')} is left out"
    said[f"{last}: nothing says what it led to{lost}"] = len(cut)
    return Result(
        {
            "episodes": len(demonstrations),
            "n_transitions": demonstrations.n_transitions,
            "dropped_actions": len(cut),
            **{f"{fate.replace(' ', '_')}_rows": n for fate, n in rows.items()},
            "path": path,
        },
        f"{counted(len(demonstrations), 'episode')}, "
        f"{counted(demonstrations.n_transitions, 'transition')}, written to {path}"
        f"{''.join(words for words, count in said.items() if count)}",
    )
