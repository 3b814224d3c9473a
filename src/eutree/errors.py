"""Every error that eutree raises on purpose.

    EutreeError
    ├── InvalidArgumentError (also ValueError)   an argument has a wrong type or value
    │   ├── UnknownNameError                     a name is not among the known ones
    │   └── UnsupportedSpaceError                an environment's space cannot be learned on
    ├── FormatError (also ValueError)            a file breaks its format
    ├── FileError (also OSError)                 a file cannot be read or written
    ├── EnvironmentFault (also RuntimeError)     an environment broke its contract
    ├── RunFolderError (also RuntimeError)       a run folder is locked, missing or in the way
    └── MissingExtraError (also ImportError)     an optional dependency is not installed

The command line prints the message of an ``EutreeError`` as one line and exits with code 2.
"""

import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import Any

MAX_SHOWN = 100  # characters of a value in a message
NOTED = "raised in "  # begins a note that says in whose code something was raised
_interrupts: list[int] = []  # signals that interrupted this process


class EutreeError(Exception):
    """Base of all errors that eutree raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Let the error be raised in another process: by its message, not by how it was made."""
        return _again, (type(self), self.args, self.__dict__)


class InvalidArgumentError(EutreeError, ValueError):
    """An argument has a wrong type or value; the message names it and the allowed ones."""


class UnknownNameError(InvalidArgumentError):
    """A name is not among the known ones.

    Args:
        kind: The kind of thing named, for example ``"environment"``.
        name: The name given.
        known: The names that would have been right.
        hint: Another way out.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], *, hint: str = "") -> None:
        known, name = sorted({*known}), _cut(name)
        nearest = get_close_matches(name, known, n=1, cutoff=0.5)
        meant = f" Did you mean {nearest[0]!r}?" if nearest else ""
        listing = f" Known: {', '.join(known) or 'none'}." if len(known) <= 20 else ""
        also = f" {hint}" if hint else ""
        super().__init__(f"unknown {kind} {name!r}.{meant}{listing}{also}")


class UnsupportedSpaceError(InvalidArgumentError):
    """An environment's observation or action space is one that a tree cannot be learned on."""


class FormatError(EutreeError, ValueError):
    """A file breaks its format.

    Args:
        path: The file.
        place: Where in the file, for example ``"nodes[3].threshold"``; empty for the whole file.
        reason: The fault there.
    """

    def __init__(self, path: str | Path, place: str, reason: str) -> None:
        place, reason = _printable(place), _printable(reason)
        self.path, self.place, self.reason = str(path), place, reason
        where = f"{path}: {place}" if place else str(path)
        super().__init__(f"{where}: {reason}")


@contextmanager
def blamed(
    path: str | Path,
    place: str = "",
    errors: type[Exception] | tuple[type[Exception], ...] = InvalidArgumentError,
) -> Iterator[None]:
    """Say that it is a file that is not as it must be: raise FormatError in place of others."""
    try:
        yield
    except errors as error:
        raise FormatError(path, place, str(error)) from None


class FileError(EutreeError, OSError):
    """A file or folder cannot be read or written: missing, no permission, disk full.

    Args:
        action: The verb, for example ``"write"``.
        path: The file or folder.
        reason: Why it failed, and the remedy if it is known.
    """

    def __init__(self, action: str, path: str | Path, reason: str) -> None:
        super().__init__(f"cannot {action} {path}: {reason}")
        self.action, self.path, self.reason = action, str(path), reason


class EnvironmentFault(EutreeError, RuntimeError):  # noqa: N818 - a fault of theirs, not ours
    """An environment broke its contract: NaN, a wrong shape, an exception inside ``step``.

    Args:
        environment: Id of the environment.
        episode: Number of the episode, from 0.
        step: Number of the step within the episode, from 0; -1 during ``reset``.
        reason: The fault, with the offending value.
        seed: Seed of its reset; None where none was given.
    """

    def __init__(
        self, environment: str, episode: int, step: int, reason: str, seed: int | None = None
    ) -> None:
        self.environment, self.episode, self.step, self.reason = environment, episode, step, reason
        self.seed, moment = seed, "reset" if step < 0 else f"step {step}"
        number = episode if seed is None else f"{episode} (seed {seed})"
        super().__init__(f"{environment}, episode {number}, {moment}: {reason}")


class RunFolderError(EutreeError, RuntimeError):
    """A run folder is locked by another process, missing, or already holds something else."""


class MissingExtraError(EutreeError, ImportError):
    """An optional dependency is not installed.

    Args:
        package: The package that could not be imported.
        extra: The extra of eutree that installs it; empty if none does.
    """

    def __init__(self, package: str, extra: str) -> None:
        wanted = f"'eutree[{extra}]'" if extra else package
        super().__init__(f"{package} is not installed; get it with: pip install {wanted}")


@contextmanager
def needed(package: str, extra: str) -> Iterator[None]:
    """Say how to install a package where its import inside fails."""
    try:
        yield
    except ImportError:
        raise MissingExtraError(package, extra) from None


def _again(kind: type[EutreeError], args: tuple[Any, ...], facts: dict[str, Any]) -> EutreeError:
    """Return an error as it was raised in another process."""
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(facts)
    return error


def _printable(text: str) -> str:
    """Escape line breaks and terminal controls, and cut: the text may quote a hostile file."""
    text = text if len(text) <= 400 else f"{text[:300]} ... {text[-80:]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object) -> str:
    """Return ``repr(value)``, cut where it is long: messages stay one line.

    An integer of more digits than Python converts to text has no ``repr``; another author's may
    raise.
    """
    try:
        text = repr(value).replace("\n", "")  # of an array
    except Exception:
        kind = type(value).__name__
        digits = f" of more than {sys.get_int_max_str_digits()} digits"
        return f"a {kind}{digits if isinstance(value, int) else ''}"
    return _cut(text)


def described(error: BaseException) -> str:
    """Return the type of another author's exception and, if it has one, its message in one line."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # of its own ``__str__``
        text = ""
    kind = type(error).__name__
    return f"{kind}: {text}" if text else kind


def _package(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


def warn(message: str) -> None:
    """Warn, at the line outside of eutree and of the package that calls this that led here."""
    frame, level = sys._getframe(1), 2  # as warnings.warn counts, from here
    passed = {"eutree", "contextlib", _package(frame)}
    while frame.f_back is not None and _package(frame) in passed:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, stacklevel=level)


@contextmanager
def noted(kind: Any, words: str) -> Iterator[None]:
    """Note ``words`` on what the package of a class or function raises, if that is not eutree."""
    try:
        yield
    except Exception as error:
        package = str(kind.__module__).partition(".")[0]
        through = (_package(frame) for frame, _ in walk_tb(error.__traceback__))
        if package != "eutree" and package in through:
            error.add_note(f"{NOTED}{words}")
        raise


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt for a signal: what the command line does at Ctrl-C and SIGTERM."""
    _interrupts.append(number)
    raise KeyboardInterrupt(number)


def interrupt_again() -> None:
    """Raise it once more after another author's code that may drop it, as SciPy's ``ode`` does."""
    if _interrupts and threading.current_thread() is threading.main_thread():
        raise KeyboardInterrupt(_interrupts[-1])


def _cut(text: str) -> str:
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."
