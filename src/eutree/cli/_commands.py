"""What every command is: its ``--help`` in one screen, and what it writes never what it reads.

A command declares what it reads as ``click.Path`` and what it writes as ``Written``. Before it
begins, each of its outputs is set beside each of its inputs. ``--help-all`` shows every option in
its group.
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click

from eutree.errors import InvalidArgumentError

_FULL = "eutree.help_all"  # in click's context: every option is to be shown
_SHARED: Mapping[str, Sequence[str]] = {
    "The environment": (
        "env_arguments",
        "decode",
        "action_grid",
        "import",
        "names",
        "derive",
        "strict",
    ),
    "Several processes": ("n_jobs", "backend", "address"),
    "Everywhere": ("seed", "as_json", "help_all", "help"),
}
# What a run and demonstrations consist of; anything else in their folders may be written anew.
PARTS = re.compile(
    r"(config|command|policy|learned|expert|demonstrations)\.json|checkpoint\.npz|(curve|progress|runs)\.csv"
    r"|(events|answers)\.jsonl|episode-\d+\.(npz|journal)"
)


class Helped(click.Command):
    """A command with many options, of which ``--help`` shows those that come first.

    Args:
        arguments: As click has them.
        groups: Names of parameters under the heading of each group; others are *Options*.
        brief: Names of the parameters that ``--help`` shows; by default all but those that every
            command has for environments and processes.
        more: As click has them.
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
        self.params.append(
            click.Option(
                ["--help-all"],
                is_flag=True,
                is_eager=True,
                expose_value=False,
                callback=_show_all,
                help="Show every option, and exit.",
            )
        )

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


def _show_all(context: click.Context, parameter: click.Parameter, asked: bool) -> None:
    """Print the whole help and end the command."""
    if asked and not context.resilient_parsing:
        context.meta[_FULL] = True
        click.echo(context.get_help(), color=context.color)
        context.exit()


class Written(click.Path):
    """A file or a folder that the command writes."""


def check_outputs(command: click.Command, given: dict[str, Any]) -> None:
    """Raise InvalidArgumentError where an output of a command would overwrite an input.

    Args:
        command: The command.
        given: The texts given for its parameters, by the parameters' names.
    """
    inputs = list(_paths(command, given, written=False))
    for output, target in _paths(command, given, written=True):
        if given.get("resume") and os.path.isdir(target):
            continue  # a run goes on in the folder whose files it was started with
        for name, source in inputs:
            if os.path.exists(source) and _overwrites(target, source):
                raise InvalidArgumentError(
                    f"{output} must be another place than {name}, {source}, which it would "
                    f"overwrite; got {target}"
                )


def _paths(
    command: click.Command, given: dict[str, Any], *, written: bool
) -> Iterator[tuple[str, str]]:
    """Yield name and path of each input, or of each output, of a command."""
    for parameter in command.params:
        kind = parameter.type
        if not isinstance(kind, click.Path) or isinstance(kind, Written) != written:
            continue
        values = given.get(str(parameter.name)) or parameter.default
        is_option = isinstance(parameter, click.Option)
        name = parameter.opts[-1] if is_option else str(parameter.name).upper()
        for value in values if isinstance(values, list | tuple) else [values]:
            if isinstance(value, str):
                yield name, value


def _overwrites(target: str, source: str) -> bool:
    """Return whether writing a file or a folder would change one that exists."""
    target, source = os.path.realpath(target), os.path.realpath(source)
    if target == source or (os.path.exists(target) and os.path.samefile(target, source)):
        return True
    inner, outer = (source, target) if os.path.isdir(target) else (target, source)
    folder, name = os.path.split(inner)
    return folder == outer and PARTS.fullmatch(name) is not None
