"""Where a command's words go: results to standard output, everything else to standard error.

Environments print, in Python and from libraries in C, and a reader of the JSON must not see it:
standard output is kept for the one JSON object.
"""

import ctypes
import io
import json
import logging
import math
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, redirect_stdout, suppress
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO, cast

import click

from eutree.arrays import plain
from eutree.display import fixed

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from eutree.compression.episodes import FrontEntry
    from eutree.training.many import LearningRuns

_HEADER = "leaves  return [95 %]                 success"
_WIDTH = 20
_SECONDS = 2.0  # between two lines about compiling
_SOON = 10.0  # seconds until play is known to be slow
_results: TextIO | None = None


class Result(NamedTuple):
    """The result of a command."""

    values: dict[str, Any]  # the entries of its JSON object
    text: Any  # its output without ``--json``, a string or a rich renderable
    exit_code: int = 0


class Output:
    """Prints the result of a command once, as text or as one JSON object."""

    def __init__(self, *, as_json: bool) -> None:
        from rich.console import Console

        self.as_json = as_json
        self.messages = Console(stderr=True, highlight=False, emoji=False)

    def say(self, text: str) -> None:
        """Print a message on standard error."""
        self.messages.print(text, markup=False, soft_wrap=True)

    def result(self, values: dict[str, Any], text: Any) -> None:
        """Print ``values`` as one JSON object, or else ``text`` (a string or a rich renderable)."""
        if self.as_json:
            click.echo(json.dumps(plain(values), allow_nan=False), file=results())
        else:
            from rich.console import Console
            from rich.text import Text

            Console(highlight=False, emoji=False, soft_wrap=isinstance(text, str | Text)).print(
                text, markup=not isinstance(text, str)
            )

    def progress(self, label: str, total: int) -> "ProgressLine":
        """Return a progress bar on a terminal, quiet lines in a pipe."""
        return ProgressLine(self.messages, label, total)


class ProgressLine:
    """A rich progress bar on a terminal; in a pipe, a line for each tenth of the work."""

    def __init__(self, console: "Console", label: str, total: int) -> None:
        self._console, self._label, self._total, self._tenth = console, label, total, 0
        self._bar: Progress | None = None

    def __enter__(self) -> "ProgressLine":
        if self._console.is_terminal:
            from rich import progress as rich

            self._bar = rich.Progress(
                rich.TextColumn("{task.description}"),
                rich.BarColumn(),
                rich.MofNCompleteColumn(),
                rich.TimeElapsedColumn(),
                rich.TimeRemainingColumn(),
                rich.TextColumn("{task.fields[note]}"),
                console=self._console,
            )
            self._bar.start()
            self._task = self._bar.add_task(self._label, total=self._total, note="")
        return self

    def __exit__(self, *exception: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def stage(self, label: str, count: int, total: int, note: str = "") -> None:
        """Say how far a stage is, whose units are others than those of the stage before."""
        self._tenth = self._tenth if label == self._label else 0
        self._label, self._total = label, max(total, 1)  # there may be more than was foreseen
        if self._bar is not None:
            self._bar.update(self._task, description=label, total=self._total)
        self.update(count, note)

    def update(self, count: int, note: str = "") -> None:
        """Say how many of the units are done, with a short note on the present state."""
        if self._bar is not None:
            self._bar.update(self._task, completed=count, note=note)
        elif count * 10 // self._total > self._tenth:
            self._console.print(
                f"{self._label} {count}/{self._total} {note}".rstrip(), markup=False
            )
            self._tenth = count * 10 // self._total


def figures_of(result: object, names: str) -> dict[str, Any]:
    """Return some of a result's attributes for ``--json``, by their names, in words apart."""
    return {name: getattr(result, name) for name in names.split()}


def runs_as_values(runs: "LearningRuns", earned: str) -> list[dict[str, Any]]:
    """Return several runs for ``--json``, each with these figures of the episodes that chose."""
    return [
        {
            **figures_of(run, "seed n_leaves environment_steps"),
            **figures_of(run.selection, earned),
            "path": str(run.path),
            "winner": number == runs.winner,
        }
        for number, run in enumerate(runs.runs)
    ]


def front_drawn(front: "Sequence[FrontEntry]", first: str, picked: int | None = None) -> str:
    """Return a front as lines, the longer the more it returns; "" if there is none.

    The others were made of the ``first``; ``picked`` are the leaves of the one that was picked.
    """
    if not front:
        return ""
    best = max(one.mean_return for one in front)
    least = min(one.mean_return for one in front)
    digits, lines = fixed(2, [best, least]), [_HEADER]
    for number, one in enumerate(front):
        width = round(_WIDTH * (one.mean_return - least) / ((best - least) or 1.0))
        success = "" if one.success_rate is None else f"{one.success_rate:.1%}"
        mark = f"  {first}" if number == 0 else ""
        if number and one.policy.n_leaves == picked:
            mark = "  picked"
        earned = f"{one.mean_return:{digits}} {one.return_interval:{digits}}"
        lines.append(
            f"{one.policy.n_leaves:>6}  {earned:<28}  {success:>6}  {'#' * width}{mark}".rstrip()
        )
    return "\n".join(lines) + "\n"


def say(text: str) -> None:
    """Print a message on standard error."""
    Output(as_json=False).say(text)


def progress(label: str, total: int) -> ProgressLine:
    """Return a progress bar on a terminal, quiet lines in a pipe."""
    return Output(as_json=False).progress(label, total)


def results() -> TextIO:
    """Return where a result is written."""
    return _results or sys.stdout


@contextmanager
def kept_for_results() -> Iterator[None]:
    """Send to standard error all that is printed inside; ``results()`` is standard output still."""
    global _results
    stream = sys.stdout
    own = _own_descriptor(stream)
    _results = stream if own is None else os.fdopen(own, "w", encoding=stream.encoding)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        if own is not None:
            with suppress(OSError):  # a pipe that nobody reads any more has been reported
                _results.flush()
                with suppress(OSError, AttributeError, TypeError):
                    # C libraries would print their buffers late, at the end of the process.
                    ctypes.CDLL(None).fflush(None)
                os.dup2(own, 1)
                _results.close()
        _results = None


def _own_descriptor(stream: TextIO) -> int | None:
    """Point descriptor 1 to standard error; return another one for where it pointed before.

    None where standard output is not the process's own, as in tests, or there is no other.
    """
    try:
        if stream.fileno() != 1:
            return None
        stream.flush()
        own = os.dup(1)
        os.dup2(2, 1)
    except (OSError, ValueError, io.UnsupportedOperation):
        return None
    return own


class _Saying(logging.Handler):
    """A line when it begins, and one every few seconds with how far it is."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._count, self._said = 0, 0.0

    def emit(self, record: logging.LogRecord) -> None:
        """Count a kernel whose compilation begins."""
        self._count += 1
        now = time.monotonic()
        if self._count == 1:
            click.echo(
                "compiling for this computer, which is kept: the first time takes up to half a "
                "minute (eutree warm-up does it beforehand)",
                err=True,
            )
        elif now - self._said >= _SECONDS:
            name = str(record.args[0]) if isinstance(record.args, tuple) else ""
            part = name.removeprefix("eutree.").partition("._kernels")[0]
            click.echo(f"compiling {self._count}: {part}", err=True)
        else:
            return
        self._said = now


class _Counting(logging.Handler):
    """How much is played, where that takes long: at ``_SOON``, and ever less often."""

    def __init__(self, total: int, steps: bool, less: str) -> None:
        super().__init__(logging.DEBUG)
        self._total, self._steps, self._less = total, steps, less
        self._count, self._began, self._next = 0, time.monotonic(), _SOON

    def emit(self, record: logging.LogRecord) -> None:
        """Count an episode that is over."""
        self._count += cast(tuple[Any, ...], record.args)[-1] if self._steps else 1
        elapsed = time.monotonic() - self._began
        if elapsed < self._next:
            return
        self._next = math.inf if self._less else 1.5 * elapsed
        left = elapsed * (self._total / max(self._count, 1) - 1.0)
        unit = "steps" if self._steps else "episodes"
        click.echo(
            f"{unit} played: {self._count:,} of {self._total:,}, about {max(left, 0.0) / 60:.0f} "
            f"minutes are left{self._less}", err=True,
        )  # fmt: skip


def said_what_is_compiled() -> AbstractContextManager[None]:
    """Report the compilation of kernels while the context lasts."""
    return _heard("eutree.compiled", _Saying())


def said_what_is_played(
    total: int, *, steps: bool = False, less: str = ""
) -> AbstractContextManager[None]:
    """Report how much this process has played, where that takes long, while the context lasts.

    There will be ``total`` episodes, or steps. ``less`` is what a user may do about it; then it is
    said once.
    """
    return _heard("eutree.interaction.episode", _Counting(total, steps, less))


@contextmanager
def _heard(name: str, handler: logging.Handler) -> Iterator[None]:
    """Let a handler hear a logger while the context lasts."""
    logger = logging.getLogger(name)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(handler.level)
    try:
        yield
    finally:
        logger.setLevel(level)
        logger.removeHandler(handler)
