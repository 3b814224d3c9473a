"""The ``eutree`` group: finds commands by name, turns errors into one line and an exit code."""

import importlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from importlib.metadata import entry_points
from typing import Any

import click

from eutree.cli._options import check_outputs
from eutree.cli._output import kept_for_results, said_what_is_compiled
from eutree.errors import NOTED, EutreeError, UnknownNameError, described
from eutree.validation import check_kind, check_offered

# Loaded when called, so that `eutree --help` imports only the modules that it needs.
COMMANDS = {
    "record": "Record demonstrations, by a person or a scripted expert.",
    "demos": "List, check, replay, edit, import and export demonstrations.",
    "fit": "Fit a tree to demonstrations (C4.5), play it, and set it beside them.",
    "learn": "Learn a tree policy by reinforcement, starting from demonstrations.",
    "distill": "Make a small tree of another policy (cloning, DAgger, VIPER).",
    "evaluate": "Evaluate a policy over many episodes.",
    "compress": "Make a policy's tree smaller without changing what it decides.",
    "export": "Export a policy to C, ONNX, DOT, SVG, JSON, text, Python and more.",
    "diff": "Say where two policies decide differently, and how they are built.",
    "verify": "Prove a property of a policy, or refute it with an observation.",
    "prove": "Prove how every episode of a policy goes, or refute it with a start.",
    "edit": "Change a policy by hand, and lock what must stay.",
    "why": "Say why a policy decides as it does for an observation.",
    "show": "Show a policy's tree in the terminal or as a page.",
    "zoo": "List the learned trees that come with the package.",
    "demo": "Run the whole main job once, ending in an HTML report.",
    "warm-up": "Compile everything now, so that no later command waits for it.",
}

HOMES = {  # of several commands; the others have a module of their own
    **dict.fromkeys(("diff", "edit", "verify", "why"), "inspecting"),
    **dict.fromkeys(("evaluate", "prove"), "measuring"),
    **dict.fromkeys(("demo", "warm_up", "zoo"), "included"),
    "distill": "fit",
    "export": "show",
}

EXIT_MISTAKE = 2
MAX_LINE = 1500  # characters of an error
GROUP = "eutree.commands"  # entry points by which other distributions add theirs


class LazyGroup(click.Group):
    """A group whose commands are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, in the order of the main job; those of others last."""
        return [*COMMANDS, *_added()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command; an unknown name names the nearest."""
        if cmd_name not in COMMANDS:
            return _added_command(cmd_name)
        module = cmd_name.replace("-", "_")
        home = HOMES.get(module, module)
        command: click.Command = getattr(importlib.import_module(f"eutree.cli.{home}"), module)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return command and arguments: no option has two values, and no output is an input."""
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None:
            _check(command, ctx, rest)
        return name, command, rest

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([*COMMANDS.items(), *((name, _help_of(name)) for name in _added())])


def _added() -> list[str]:
    """Return the names of commands that other installed distributions add."""
    return sorted({point.name for point in entry_points(group=GROUP)} - COMMANDS.keys())


def _added_command(name: str) -> click.Command:
    """Import and return a command of another distribution."""
    points = entry_points(group=GROUP, name=name)
    if not points:
        raise UnknownNameError("command", name, [*COMMANDS, *_added()])
    command = check_offered("command", points)
    return check_kind(f"command {name!r}, {points[name].value},", command, click.Command)


def _help_of(name: str) -> str:
    try:
        return _added_command(name).get_short_help_str(limit=70)
    except EutreeError as error:
        return str(error)


def _check(command: click.Command, parent: click.Context, arguments: list[str]) -> None:
    """Raise where an option that takes one value is given two, or an output is an input."""
    context = command.context_class(command, parent=parent)
    try:
        values, rest, order = command.make_parser(context).parse_args(list(arguments))
    except click.UsageError:
        return  # the command itself says so
    single = [p for p in order if isinstance(p, click.Option) and not (p.multiple or p.is_flag)]
    for option in single:
        if single.count(option) > 1:
            raise click.UsageError(f"{option.opts[-1]} is given {single.count(option)} times")
    check_outputs(command, values)
    if isinstance(command, click.Group) and rest:
        inner = command.get_command(context, rest[0])
        if inner is not None:
            _check(inner, context, rest[1:])


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Example: eutree demo",
)
@click.version_option(package_name="eutree", message="%(package)s %(version)s")
def eutree() -> None:
    """Learn small, readable decision trees that control things.

    Every command takes --json (exactly one JSON object on standard output), --debug (a traceback
    for errors) and --help.
    """


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return the exit code: 0, 1 (a bug), 2 (a mistake), 130."""
    sys.stdout = sys.stdout or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")  # closed
    debug = "--debug" in arguments
    rest = [argument for argument in arguments if argument != "--debug"]
    wants_json = "--json" in rest and not {"-h", "--help", "--version"} & set(rest)
    hook, sys.unraisablehook = sys.unraisablehook, partial(_again, sys.unraisablehook)
    try:
        with said_what_is_compiled(), kept_for_results() if wants_json else nullcontext():
            code = eutree.main(rest, prog_name="eutree", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return EXIT_MISTAKE
    except (click.exceptions.Abort, KeyboardInterrupt) as end:  # Abort is click's name for Ctrl-C
        click.echo("interrupted", err=True)
        cause = end if isinstance(end, KeyboardInterrupt) else end.__cause__
        # An interrupt says its signal unless it is Ctrl-C.
        return 128 + (cause.args[0] if cause is not None and cause.args else signal.SIGINT)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        return _report(error, debug=debug)
    finally:
        sys.unraisablehook = hook
    return code if isinstance(code, int) else 0


def _again(hook: Callable[[Any], None], ignored: Any) -> None:
    """Interrupt again, soon, where Ctrl-C fell into a callback of the compiler, which drops it."""
    if isinstance(ignored.exc_value, KeyboardInterrupt):
        main = threading.main_thread().ident
        threading.Timer(0.1, signal.pthread_kill, (main, signal.SIGINT)).start()
    else:
        hook(ignored)


def _report(error: Exception, *, debug: bool) -> int:
    """Print an error as one line, or with its traceback, and return the exit code."""
    if debug:
        traceback.print_exception(error)
    if isinstance(error, click.ClickException):
        message, code = error.format_message(), EXIT_MISTAKE
    elif isinstance(error, EutreeError):
        message, code = str(error), EXIT_MISTAKE
    elif isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        message, code = f"{where}{error.strerror or error}", EXIT_MISTAKE
    else:
        notes = (note for note in getattr(error, "__notes__", ()) if note.startswith(NOTED))
        where = next(notes, "internal error")
        message, code = f"{where}, {described(error)} (--debug shows where)", 1
    line = " ".join(message.split())
    line = line if len(line) <= MAX_LINE else f"{line[:MAX_LINE]} ... {line[-100:]}"
    click.echo(f"error: {line}", err=True)
    return code
