"""Options that several commands share."""

import json
from collections.abc import Callable
from typing import Any, TypeVar

import click

from eutree.schema import EnvironmentSpec

_Command = TypeVar("_Command", bound=Callable[..., Any])


def json_option(command: _Command) -> _Command:
    """Add ``--json``, passed on as ``as_json``."""
    text = "Print exactly one JSON object on standard output."
    return click.option("--json", "as_json", is_flag=True, help=text)(command)


def seed_option(command: _Command) -> _Command:
    """Add ``--seed``."""
    text = "Seed; the same seed gives the same bytes."
    return click.option(
        "--seed", type=click.IntRange(min=0), default=0, show_default=True, help=text
    )(command)


def env_arg_option(command: _Command) -> _Command:
    """Add ``--env-arg key=value`` (repeatable), passed on as a dict ``env_arguments``."""
    return click.option(
        "--env-arg",
        "env_arguments",
        multiple=True,
        metavar="KEY=VALUE",
        callback=_parse_arguments,
        help="Argument of the environment, for example opponent_speed=4.2. May be repeated.",
    )(command)


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
