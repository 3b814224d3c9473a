"""Where commands write, and that this is never what they read.

A command declares what it reads as ``click.Path`` and what it writes as ``Written``. Before it
begins, each of its outputs is set beside each of its inputs.
"""

import os
import re
from collections.abc import Iterator
from typing import Any

import click

from eutree.errors import InvalidArgumentError

# What a run and demonstrations consist of; anything else in their folders may be written anew.
PARTS = re.compile(
    r"(config|command|policy|learned|expert|demonstrations)\.json|checkpoint\.npz|(curve|progress|runs)\.csv"
    r"|(events|answers)\.jsonl|episode-\d+\.(npz|journal)"
)


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
