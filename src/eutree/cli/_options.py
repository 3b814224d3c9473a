"""Options that several commands share."""

import importlib
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from eutree.schema import EnvironmentSpec

_Command = TypeVar("_Command", bound=Callable[..., Any])


def count_option(
    flag: str, default: int, text: str, *, least: int = 1
) -> Callable[[_Command], _Command]:
    """Return an option that takes a whole number of at least ``least``."""
    return click.option(
        flag, type=click.IntRange(min=least), default=default, show_default=True, help=text
    )


def path_option(*names: str, text: str, required: bool = False) -> Callable[[_Command], _Command]:
    """Return an option that takes a file or a folder, passed on as a path."""
    return click.option(*names, type=click.Path(path_type=Path), required=required, help=text)


def json_option(command: _Command) -> _Command:
    """Add ``--json``, passed on as ``as_json``."""
    text = "Print exactly one JSON object on standard output."
    return click.option("--json", "as_json", is_flag=True, help=text)(command)


def seed_option(command: _Command) -> _Command:
    """Add ``--seed``."""
    return count_option("--seed", 0, "Seed; the same seed gives the same bytes.", least=0)(command)


def env_arg_option(command: _Command) -> _Command:
    """Add what every command that makes an environment takes.

    ``--env-arg key=value`` (repeatable) is passed on as a dict ``env_arguments``; ``--import`` is
    obeyed before the command begins.
    """
    argument = click.option(
        "--env-arg",
        "env_arguments",
        multiple=True,
        metavar="KEY=VALUE",
        callback=_parse_arguments,
        help="Argument of the environment, for example opponent_speed=4.2. May be repeated.",
    )
    return argument(import_option(command))


def import_option(command: _Command) -> _Command:
    """Add ``--import``, which is obeyed before the command begins."""
    return click.option(
        "--import",
        metavar="MODULE",
        expose_value=False,
        callback=_import_module,
        help="Python module, installed or in this folder, that registers your environment.",
    )(command)


def _import_module(context: click.Context, parameter: click.Parameter, name: str | None) -> None:
    """Import a module that the user has named; files never name one."""
    if name is None or context.resilient_parsing:
        return
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        importlib.import_module(name)
    except ImportError as error:
        raise click.BadParameter(f"cannot import {name!r}: {error}") from error


def _parse_arguments(
    context: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> dict[str, Any]:
    parsed: dict[str, Any] = {}
    for text in values:
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise click.BadParameter(f"must be KEY=VALUE, got {text!r}")
        try:
            parsed[key] = json.loads(value)
        except ValueError:
            parsed[key] = {"True": True, "False": False, "None": None}.get(value, value)
    return parsed


def override(spec: EnvironmentSpec, arguments: dict[str, Any]) -> EnvironmentSpec:
    """Return ``spec`` with some of its arguments replaced."""
    return EnvironmentSpec(spec.id, {**spec.arguments, **arguments})
