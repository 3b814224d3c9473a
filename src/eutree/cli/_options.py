"""The base of every command: options that several share, and help in one screen.

A command declares its input files as ``click.Path`` and its output files as ``Written``. Before it
begins, each output is compared with each input, modules among them: a command never writes over its
input. ``--help-all`` shows every option in its group.
"""

import importlib
import json
import os
import re
import shlex
import sys
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from eutree.cli._output import Output, Result
from eutree.errors import InvalidArgumentError, described, shown
from eutree.files.schema_document import plain_json
from eutree.schema import MAX_ACTIONS
from eutree.validation import MAX_SEED

if TYPE_CHECKING:
    from eutree.interaction.names import Names

_FULL = "eutree.help_all"  # in click's context: every option is to be shown
_LINE = "eutree.line"  # and the words that were given
_JSON = "eutree.json"  # and whether one JSON object is wanted
_MODULE = "eutree.module"  # and the module that was imported
_ONE_OBJECT = "Print exactly one JSON object on standard output."
_SHARED: Mapping[str, Sequence[str]] = {
    "The environment": ("env_arguments", "decode", "action_grid", "import", "names", "derive",
                        "strict"),
    "Several processes": ("n_jobs", "backend", "address"),
    "Everywhere": ("seed", "as_json", "help_all", "help"),
}  # fmt: skip
# The files of runs, demonstrations and studies; others in their folders may be overwritten.
PARTS = re.compile(
    r"(runs/\d+/)?((config|command|policy|learned|expert|demonstrations)\.json|checkpoint\.npz"
    r"|(curve|progress|runs)\.csv|(events|answers)\.jsonl|episode-\d+\.(npz|journal)|study\.toml)"
)
_FRONT = re.compile(r"(start|\d+)\.json")  # what --front writes to its folder
# Parameters that name a file or something in a module, and those that name a module or a part
_NAMED, _IMPORTED = {"expert", "teacher", "against", "derive"}, {"import", "environment", "method"}
_Command = TypeVar("_Command", bound=Callable[..., Any])
# In click's context: one option tells another.
_DECODE = "eutree.decode"
_ACTION_GRID = "eutree.action_grid"
AUTO = "auto"  # of --derive
MAX_COUNT = 10**9  # of anything that is counted: more than any run can do


class ResultCommand(click.Command):
    """A command that returns its ``Result``, printed here: with ``--json`` as one object."""

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.params.append(_flag("--json", "as_json", callback=_use_json, help=_ONE_OBJECT))

    def invoke(self, ctx: click.Context) -> None:
        """Run the command, and print its result."""
        result = super().invoke(ctx)
        if isinstance(result, Result):
            Output(as_json=wants_json()).result(result.values, result.text)
            if result.exit_code:
                ctx.exit(result.exit_code)


def _flag(*names: str, **more: Any) -> click.Option:
    return click.Option(names, is_flag=True, expose_value=False, **more)


def _use_json(context: click.Context, parameter: click.Parameter, given: bool) -> None:
    context.meta[_JSON] = given


def wants_json() -> bool:
    """Return whether the command under way was given ``--json``."""
    return bool(click.get_current_context().meta[_JSON])


class Helped(ResultCommand):
    """A command with many options, of which ``--help`` shows those that come first.

    Args:
        arguments: As click has them, and ``more``.
        groups: Names of parameters under the heading of each group; others are *Options*.
        brief: Names of the parameters that ``--help`` shows; by default all but those that every
            command has for environments and processes.
    """

    def __init__(
        self,
        *arguments: Any,
        groups: Mapping[str, Sequence[str]] | None = None,
        brief: Sequence[str] = (),
        **more: Any,
    ) -> None:
        super().__init__(*arguments, **more)
        self._groups = {**(groups or {}), **_SHARED}
        self._brief = brief
        text = "Show every option, and exit."
        self.params.append(_flag("--help-all", is_eager=True, callback=_show_all, help=text))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments, and keep them as they were given."""
        ctx.meta[_LINE] = list(args)
        return super().parse_args(ctx, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options: all in their groups, or the first ones."""
        records = {
            "help" if "--help" in one.opts else str(one.name): record
            for one in self.get_params(ctx)
            if isinstance(one, click.Option) and (record := one.get_help_record(ctx)) is not None
        }
        if not ctx.meta.get(_FULL):
            with formatter.section("Options"):
                formatter.write_dl([records[name] for name in records if self._is_first(name)])
            if (hidden := len(records) - sum(map(self._is_first, records))) > 0:
                formatter.write_paragraph()
                formatter.write_text(f"{ctx.command_path} --help-all shows {hidden} more.")
            return
        grouped = {name for names in self._groups.values() for name in names}
        others = {"Options": [name for name in records if name not in grouped]}
        for heading, names in {**others, **self._groups}.items():
            shown = [records[name] for name in names if name in records]
            if shown:
                with formatter.section(heading):
                    formatter.write_dl(shown)

    def _is_first(self, name: str) -> bool:
        if name in ("help", "help_all"):
            return True
        if self._brief:
            return name in self._brief
        return name in _SHARED["Everywhere"] or not any(name in of for of in _SHARED.values())


def command(
    example: str, *, helped: bool = True, **more: Any
) -> Callable[[Callable[..., Any]], click.Command]:
    """Return the decorator of a command with an example, with or without ``--help-all``."""
    kind = {"cls": Helped if helped else ResultCommand}
    return click.command(**kind | more, epilog=f"Example: {example}")


def _show_all(context: click.Context, parameter: click.Parameter, asked: bool) -> None:
    """Print the whole help and end the command."""
    if asked and not context.resilient_parsing:
        context.meta[_FULL] = True
        click.echo(context.get_help(), color=context.color)
        context.exit()


def line_with(*more: str) -> str:
    """Return the line of the command under way with more words, quoted for a shell."""
    context = click.get_current_context()
    return shlex.join(["eutree", str(context.info_name), *context.meta[_LINE], *more])


def imported() -> tuple[str, ...]:
    """Return the words by which another command knows the same environments."""
    module = click.get_current_context().meta.get(_MODULE)
    return () if module is None else ("--import", module)


class Written(click.Path):
    """A file or a folder that the command writes."""


def check_outputs(command: click.Command, given: dict[str, Any]) -> None:
    """Raise InvalidArgumentError where an output would overwrite an input or another output."""
    inputs = list(_paths(command, given, written=False))
    outputs = list(_paths(command, given, written=True))
    # A log of TensorBoard names its files itself.
    files = [output for output in outputs if output[0] != "--tensorboard"]
    for (one, first), (other, second) in combinations(files, 2):
        taken = [os.path.realpath(first)]
        if other == "--front" and _FRONT.fullmatch(os.path.basename(first)):
            taken.append(os.path.dirname(taken[0]))
        if os.path.realpath(second) in taken:
            raise InvalidArgumentError(
                f"{other} must be another place than {one}, {first}, which it would overwrite; "
                f"got {second}"
            )
    for output, target in outputs:
        if given.get("resume") and os.path.isdir(target):
            continue  # a run goes on in the folder whose files it was started with
        for name, source in inputs:
            parts = _FRONT if output == "--front" else PARTS
            if os.path.exists(source) and _overwrites(target, source, parts):
                raise InvalidArgumentError(
                    f"{output} must be another place than {name}, {source}, which it would "
                    f"overwrite; got {target}"
                )


def _paths(
    command: click.Command, given: dict[str, Any], *, written: bool
) -> Iterator[tuple[str, str]]:
    """Yield name and path of each input, or of each output, of a command."""
    for parameter in command.params:
        if isinstance(parameter.type, Written) != written:
            continue
        values = given.get(str(parameter.name)) or parameter.default
        is_option = isinstance(parameter, click.Option)
        name = parameter.opts[-1] if is_option else str(parameter.name).upper()
        for value in values if isinstance(values, list | tuple) else [values]:
            if isinstance(value, str):
                yield from ((name, file) for file in _files_of(parameter, value))


def _files_of(parameter: click.Parameter, text: str) -> Iterator[str]:
    """Yield the files that the text of a parameter may mean: its own, and that of a module."""
    if isinstance(parameter.type, click.Path) or parameter.name in _NAMED:
        yield text
    module = text if parameter.name == "import" else text.rpartition(":")[0]
    if module and parameter.name in _NAMED | _IMPORTED:
        if module.endswith(".py"):
            yield module
        for folder in ("", *sys.path):
            file = os.path.join(folder, *module.split("."))
            yield from (f"{file}.py", os.path.join(file, "__init__.py"))


def _overwrites(target: str, source: str, parts: re.Pattern[str]) -> bool:
    """Return whether writing a file, or these parts of a folder, would change a source."""
    part = os.path.relpath(os.path.realpath(target), os.path.realpath(source)).replace(os.sep, "/")
    return bool(PARTS.fullmatch(part) or _held(target, parts) & _held(source, PARTS))


def _held(place: str, parts: re.Pattern[str]) -> set[tuple[int, int]]:
    """Return the identity of a file, or of a folder and such parts in it; links are followed."""
    inside = os.listdir(place) if os.path.isdir(place) else []
    files = [place, *(os.path.join(place, name) for name in inside if parts.fullmatch(name))]
    return {(at.st_dev, at.st_ino) for at in map(os.stat, filter(os.path.exists, files))}


class _Count(click.IntRange):
    """A whole number whose range is said where it is exceeded, and not in every line of help."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        number: int = click.INT.convert(value, param, ctx)
        if not (self.min or 0) <= number <= (self.max or MAX_COUNT):
            self.fail(f"{number} is not in the range {super()._describe_range()}.", param, ctx)
        return number

    def _describe_range(self) -> str:
        return ""


def count(
    flag: str, default: int | None, text: str, *, least: int = 1, most: int = MAX_COUNT
) -> Callable[[_Command], _Command]:
    """Return an option that takes a whole number from ``least`` to ``most``."""
    return click.option(
        flag, type=_Count(least, most), default=default, show_default=default is not None, help=text
    )


def path(*names: str, text: str, **more: Any) -> Callable[[_Command], _Command]:
    """Return an option that takes a file or a folder to read, passed on as a path."""
    return click.option(*names, type=click.Path(path_type=Path), help=text, **more)


def output(*names: str, text: str, **more: Any) -> Callable[[_Command], _Command]:
    """Return an option that takes a file or a folder to write, passed on as a path."""
    return click.option(*names, type=Written(path_type=Path), help=text, show_default=True, **more)


def starts(text: str, *, multiple: bool = False) -> Callable[[_Command], _Command]:
    """Return the option that takes a certificate, in whose boxes episodes begin."""
    words = f"A certificate, by prove --out, of what is not proven: {text}"
    return path("--starts-from", text=words, metavar="CERTIFICATE", multiple=multiple)


def together(*options: Callable[[_Command], _Command]) -> Callable[[_Command], _Command]:
    """Return several options as one."""

    def add(command: _Command) -> _Command:
        for one in reversed(options):
            command = one(command)
        return command

    return add


def _decode(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    """Take note that the environment's arguments are to ask for decoded observations."""
    if wanted:
        context.meta[_DECODE] = True


def _grid(context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]) -> None:
    """Take note of the grid that the environment's arguments are to ask for."""
    if not texts or context.resilient_parsing:
        return
    from eutree.interaction.action_grid import controls_of, plain_grid

    grid = []
    for text in texts:
        name, equals, levels = text.rpartition("=")
        if not equals or not name:
            raise click.BadParameter(f"must be NAME=LEVEL,LEVEL,..., got {shown(text)}")
        grid.append((name, _levels(levels)))
    context.meta[_ACTION_GRID] = plain_grid(controls_of(grid))


def _levels(text: str) -> list[float]:
    """Return the levels that a text lists, or those of LOW:HIGH:COUNT."""
    try:
        if ":" not in text:
            return [float(number) for number in text.split(",")]
        low, high, count = text.split(":")
        n = int(count)
        if not 2 <= n <= MAX_ACTIONS:
            raise ValueError
        ends = float(low), float(high)
        return [(ends[0] * (n - 1 - k) + ends[1] * k) / (n - 1) for k in range(n)]
    except ValueError:
        raise click.BadParameter(
            f"levels must be numbers, 0,50,100, or LOW:HIGH:COUNT, got {shown(text)}"
        ) from None


def number(text: str, wanted: str) -> float:
    """Return the number that a text holds; ``wanted`` says where it is none."""
    try:
        return float(text)
    except ValueError:
        raise InvalidArgumentError(f"{wanted}, got {shown(text)}") from None


def _use_names(context: click.Context, parameter: click.Parameter, path: Path | None) -> None:
    """Give the names in a file to every environment that the command makes."""
    from eutree.interaction.names import Names

    if path is not None and not context.resilient_parsing:
        give(context, Names.load(path))


def _derive(context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]) -> None:
    """Declare derived features for every environment that the command makes."""
    if not texts or context.resilient_parsing:
        return
    from eutree.interaction.names import Names, declarations

    if AUTO in texts:
        if context.info_name != "fit":
            raise click.BadParameter(f"{AUTO} is understood by fit, which proposes features, only")
        context.meta[AUTO] = True
        texts = tuple(text for text in texts if text != AUTO)
    declared = [line for text in texts for line in ([text] if "=" in text else declarations(text))]
    give(context, Names(derived=tuple(declared)))


def give(context: click.Context, names: "Names") -> None:
    """Give names besides those that were given before."""
    from eutree.interaction.names import given_names, named

    context.with_resource(named(names.besides(given_names())))


def _import_module(context: click.Context, parameter: click.Parameter, name: str | None) -> None:
    """Import a module that the user has named; files never name one.

    Whatever the module does wrong, its author is to be told: that it is not there, cannot be read
    as Python, raises, or ends the process.
    """
    if name is None or context.resilient_parsing:
        return
    look_in_this_folder()
    context.meta[_MODULE] = name = name.removesuffix(".py")
    if not all(part.isidentifier() for part in name.split(".")):
        raise click.BadParameter(f"must be the name of a module, as in Python, got {shown(name)}")
    try:
        importlib.import_module(name)
    except ImportError as error:
        example = name.startswith("examples.") and "; the examples are in a clone of the repository"
        raise click.BadParameter(f"cannot import {name!r}: {error}{example or ''}") from error
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise click.BadParameter(f"cannot import {name!r}: it raised {described(error)}") from error


def given(names: Container[str | None]) -> list[str]:
    """Return those of some options, by their parameters, that stand on the command line."""
    context = click.get_current_context()
    said = click.core.ParameterSource.COMMANDLINE
    found = (one for one in context.command.params if one.name in names)
    return [one.opts[0] for one in found if context.get_parameter_source(one.name or "") is said]


def refuse(names: Container[str | None], reason: str) -> None:
    """Raise InvalidArgumentError if one of some options, by their parameters, was given."""
    for one in given(names)[:1]:
        raise InvalidArgumentError(f"{reason}: leave out {one}")


def look_in_this_folder() -> None:
    """Let modules of the current folder be imported, as ``python -m`` does."""
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())


def _parse_arguments(
    context: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> dict[str, Any]:
    parsed: dict[str, Any] = {}
    for text in values:
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise click.BadParameter(f"must be KEY=VALUE, got {shown(text)}")
        try:
            parsed[key] = plain_json(_parsed(value), f"--env-arg {key}")
        except RecursionError:
            raise click.BadParameter(f"{key} is nested too deeply") from None
    if context.meta.get(_DECODE):
        parsed["decode"] = True
    if _ACTION_GRID in context.meta:
        parsed["action_grid"] = context.meta[_ACTION_GRID]
    return parsed


def _parsed(value: str) -> Any:
    """Return the value of the text in JSON or Python, else the text itself."""
    try:
        return json.loads(value)
    except ValueError:
        return {"True": True, "False": False, "None": None}.get(value, value)


# ``--json``, passed on as ``as_json``, of a command that prints its result itself
as_json = click.option("--json", "as_json", is_flag=True, help=_ONE_OBJECT)
seed = count("--seed", 0, "Seed; the same seed gives the same bytes.", least=0, most=MAX_SEED)
monotone = click.option(
    "--monotone", multiple=True, metavar="RULE",
    help="A rule that the tree keeps: 'stop in distance', raising it never leads away from stop; "
    "'go in falling speed when ...', as verify has them. May be repeated.",
)  # fmt: skip
module = click.option(
    "--import", metavar="MODULE", expose_value=False, callback=_import_module,
    help="Python module, installed or in this folder, that registers your environment.",
)  # fmt: skip
# Of every command that makes an environment: ``env_arguments`` is a dict, with what ``--decode``
# and ``--action-grid`` ask for; the others are obeyed before the command begins.
environment = together(
    click.option(
        "--env-arg", "env_arguments", multiple=True, metavar="KEY=VALUE", callback=_parse_arguments,
        help="Argument of the environment, for example opponent_speed=4.2. May be repeated.",
    ),
    click.option(  # eager: before --env-arg, to which it adds
        "--decode", is_flag=True, is_eager=True, expose_value=False, callback=_decode,
        help="Observe what the environment's codes stand for, by its own method decode (Taxi).",
    ),
    click.option(  # eager as --decode
        "--action-grid", multiple=True, is_eager=True, expose_value=False, callback=_grid,
        metavar="NAME=LEVEL,...",
        help="For continuous actions: the levels to choose from, valve=0,50,100 or "
        "'valve [%]=0:100:5' (five from 0 to 100). One for each number of the action, in order.",
    ),
    module,
    click.option(
        "--derive", multiple=True, metavar="NAME=FORMULA", expose_value=False, callback=_derive,
        help="A feature made of others: 'fall = level - last(level)'; or a file with one a line. "
        "May be repeated. fit --derive auto proposes some.",
    ),
    path(
        "--names", metavar="FILE", expose_value=False, callback=_use_names,
        text='Names for an environment without: {"features": ["room [°C]", "hour [h]"], '
        '"actions": ["off", "on"], "derived": ["warmth = room * hour"]}.',
    ),
)  # fmt: skip
