"""A run goes on from its folder alone: what its command was given is kept there, and given again.

Kept is what a file may choose. A module to import, an address to work at, a folder elsewhere to write
and an environment's argument that could name a file are the user's own choice each time; the line
that is printed when a run is interrupted has them.
"""

import os
import shlex
from pathlib import Path
from typing import Any, ClassVar

import click

from eutree.cli._paths import Written
from eutree.errors import InvalidArgumentError
from eutree.files import Document, read_document, write_document

KEPT = "command.json"
# Asked for each time: none changes what a run learns.
_EACH_TIME = {"out", "resume", "as_json", "list_settings", "checkpoint_seconds", "n_jobs", "port"}
_USERS_OWN = {"import", "backend", "address", "tensorboard"}

Arguments = dict[str, list[str]]  # what was given for each parameter, by its name


class CommandDocument(Document, frozen=True, kw_only=True):
    """What a command was given, by the names of its parameters; paths are absolute."""

    FORMAT: ClassVar[str] = "eutree/command"
    VERSION: ClassVar[int] = 1

    arguments: Arguments


class GoesOn(click.Command):
    """A command that with ``--resume`` is given again what is kept in the folder ``--out``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments, those kept first."""
        given = _given(self, ctx, args)
        if "resume" in given and "out" in given:
            kept = _kept(Path(given["out"][0]))
            ctx.meta[KEPT] = {text.partition("=")[0] for text in kept.get("env_arguments", [])}
            ctx.meta[KEPT] -= {text.partition("=")[0] for text in given.get("env_arguments", [])}
            args = [*_line(self, _without(kept, given)), *args]
        elif "out" in given:
            ctx.meta["eutree.given"] = given
        return super().parse_args(ctx, args)


def chosen_by_file(arguments: dict[str, Any]) -> frozenset[str]:
    """Return which of an environment's arguments were kept in a folder, and not given now."""
    kept = click.get_current_context().meta.get(KEPT, set())
    return frozenset(kept & arguments.keys())


def keep(out: Path) -> None:
    """Keep in a new run's folder what the command was given.

    Args:
        out: The folder; nothing is written into one that was begun before.
    """
    context = click.get_current_context()
    given = context.meta.get("eutree.given")
    if given is None or (out / KEPT).exists() or not out.is_dir():
        return
    kept = {
        name: [_absolute(parameter, text) for text in given[name]]
        for name, parameter in _parameters(context.command).items()
        if name in given and name not in _EACH_TIME | _USERS_OWN
    }
    if ":" in kept.get("environment", [""])[0]:
        del kept["environment"]  # it names a module to import
    write_document(out / KEPT, CommandDocument(arguments=kept))


def line_to_go_on(out: Path) -> str:
    """Return the line by which a run goes on, quoted for a shell."""
    from eutree.interaction.making import could_name_a_place

    context = click.get_current_context()
    given = dict(context.meta.get("eutree.given") or _given(context.command, context, []))
    own = {name: given[name] for name in _USERS_OWN & given.keys()}
    if ":" in given.get("environment", [""])[0]:
        own["environment"] = given["environment"]
    places = [text for text in given.get("env_arguments", []) if could_name_a_place(text)]
    if places:
        own["env_arguments"] = places
    words = ["eutree", str(context.command.name), *_line(context.command, own)]
    return shlex.join([*words, "--out", str(out), "--resume"])


def _given(command: click.Command, context: click.Context, args: list[str]) -> Arguments:
    """Return what is given on the line, by the names of the parameters; nothing if it is wrong."""
    try:
        values, _, order = command.make_parser(context).parse_args(list(args))
    except click.UsageError:
        return {}  # click itself says so
    named = {str(parameter.name): values[str(parameter.name)] for parameter in order}
    return {
        name: [str(text) for text in (value if isinstance(value, list | tuple) else [value])]
        for name, value in named.items()
        if isinstance(value, str | list | tuple | bool)
    }


def _kept(out: Path) -> Arguments:
    """Return what is kept in a folder; nothing where it was not a command that began the run."""
    if (out / KEPT).exists():
        return read_document(out / KEPT, CommandDocument).arguments
    if not any((out / name).exists() for name in ("config.json", "runs")):
        return {}
    return {}


def _without(kept: Arguments, given: Arguments) -> Arguments:
    """Return what is kept and not given now; of the environment's arguments each by itself."""
    rest = {name: texts for name, texts in kept.items() if name not in given}
    now = {text.partition("=")[0] for text in given.get("env_arguments", [])}
    own = [text for text in kept.get("env_arguments", []) if text.partition("=")[0] not in now]
    return rest | ({"env_arguments": own} if own else {})


def _line(command: click.Command, arguments: Arguments) -> list[str]:
    """Return the words that give arguments to a command.

    Raises:
        InvalidArgumentError: It takes no such argument.
    """
    known, words = _parameters(command), []
    for name, texts in arguments.items():
        parameter = known.get(name)
        if parameter is None or name in _EACH_TIME | _USERS_OWN:
            raise InvalidArgumentError(f"{KEPT} must hold arguments of the command, got {name!r}")
        for text in texts:
            flag = [parameter.opts[-1]] if isinstance(parameter, click.Option) else []
            is_flag = isinstance(parameter, click.Option) and parameter.is_flag
            words += flag if is_flag else [*flag, text]
    return words


def _parameters(command: click.Command) -> dict[str, click.Parameter]:
    return {str(parameter.name): parameter for parameter in command.params}


def _absolute(parameter: click.Parameter, text: str) -> str:
    """Return a path as it is known from everywhere, and any other text as it is."""
    is_path = isinstance(parameter.type, click.Path) and not isinstance(parameter.type, Written)
    is_file = parameter.name == "teacher" and os.path.exists(text)
    return os.path.abspath(text) if is_path or is_file else text
