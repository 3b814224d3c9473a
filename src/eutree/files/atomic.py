"""Whole files, written so that a reader finds the old content or the new, never a mixture.

The bytes go to a temporary file in the same folder, are flushed to the disk, and take the
file's name in one rename, which is flushed too by an fsync of the folder. A process that dies on
the way leaves at most a temporary file, whose name tells machine and process; the next writer in
that folder removes it. Every file of eutree is written and read through this package.
"""

import errno
import io
import itertools
import os
import platform
import re
import stat
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from eutree.errors import EutreeError, FileError, FormatError, RunFolderError

try:
    import fcntl
except ImportError:  # not a POSIX system: no locks there
    fcntl = None  # type: ignore[assignment]  # a module elsewhere

TEMPORARY_SUFFIX = ".eutree-tmp"
RUN, DEMONSTRATIONS, RESULTS = "a run", "demonstrations", "results"
KINDS = {  # kinds of folders, and the files that tell them
    RUN: ("config.json", "checkpoint.npz", "runs.csv"),
    DEMONSTRATIONS: ("demonstrations.json",),
    RESULTS: (),
}

_MACHINE = f"{zlib.crc32(platform.node().encode()):08x}"
_TEMPORARY_NAME = re.compile(
    rf"\.(?P<name>.+)\.(?P<machine>[0-9a-f]{{8}})-(?P<pid>\d+)-\d+{re.escape(TEMPORARY_SUFFIX)}"
)
_counter = itertools.count()

_ADVICE = {
    errno.ENOSPC: "the disk is full; what was there before is intact",
    errno.EDQUOT: "the disk quota is used up; what was there before is intact",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "no permission; choose another folder or change its permissions",
    errno.EPERM: "no permission; choose another folder or change its permissions",
    errno.ENOENT: "it does not exist",
    errno.ENOTDIR: "a part of the path is a file, not a folder",
    errno.EISDIR: "it is a folder, not a file",
    errno.ENAMETOOLONG: "the name is too long",
}


# The system calls behind every write, by names of our own: tests make them fail on purpose.
_write, _fsync, _replace = os.write, os.fsync, os.replace


def write_bytes(path: str | Path, data: bytes) -> None:
    """Make ``data`` the content of the file, completely or not at all.

    The folder must exist. An existing file keeps its permissions; a symbolic link keeps pointing
    where it points.

    Raises:
        FileError: The file cannot be written; its old content is intact and no temporary file
            is left behind.
    """
    with reported("write", path):
        target = Path(os.path.realpath(path))
        _refuse_special(target)
        remove_orphans(target.parent)
        temporary = temporary_path(target)
        try:
            _write_new(temporary, data, _permissions(target))
            _replace(temporary, target)
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        sync_folder(target.parent)


def write_text(path: str | Path, text: str) -> None:
    """Make ``text`` the content of the file, in UTF-8; see ``write_bytes``."""
    write_bytes(path, text.encode("utf-8"))


@contextmanager
def opened_text(path: str | Path, *, limit: int) -> Iterator[io.TextIOWrapper]:
    """Open a regular file of at most ``limit`` bytes to read it as UTF-8, line ends as they are.

    Raises:
        FileError: The file is missing, unreadable or no regular file.
        FormatError: It is larger than ``limit``, or not UTF-8, which reading it tells.
    """
    with _opened(path, limit) as file:
        try:
            yield io.TextIOWrapper(file, encoding="utf-8-sig", newline="")
        except UnicodeDecodeError:
            raise FormatError(path, *_no_text(path, limit)) from None


def _no_text(path: str | Path, limit: int) -> tuple[str, str]:
    """Return the line of a file that is no UTF-8, and what it is likely to be."""
    for number, line in enumerate(read_bytes(path, limit=limit).split(b"\n"), 1):
        try:
            line.decode()
        except UnicodeDecodeError as error:
            kind = "UTF-16" if b"\0" in line else "Latin-1"
            wrong = f"byte {line[error.start]:#04x} is not UTF-8 text, perhaps {kind}"
            return f"line {number}", f"{wrong}: save the file as UTF-8"
    return "", "not UTF-8 text"


def read_bytes(path: str | Path, *, limit: int) -> bytes:
    """Return the content of a regular file of at most ``limit`` bytes.

    Raises:
        FileError: The file is missing, unreadable or no regular file.
        FormatError: It is larger than ``limit``.
    """
    with _opened(path, limit) as file, reported("read", path):
        content = file.read(os.fstat(file.fileno()).st_size + 1)
    _check_size(path, len(content), limit)
    return content


@contextmanager
def _opened(path: str | Path, limit: int) -> Iterator[BinaryIO]:
    with reported("read", path):
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        file = os.fdopen(descriptor, "rb")  # a folder cannot be opened so
    with file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise FileError("read", path, "it is not a regular file")
        _check_size(path, status.st_size, limit)
        yield file


def _check_size(path: str | Path, size: int, limit: int) -> None:
    if size > limit:
        raise FormatError(path, "", f"too large: {size:,} bytes, more than {limit:,}")


def make_folder(path: str | Path, *, of: str = "") -> Path:
    """Make the folder and its missing parents; return its path.

    One that holds something of another kind than ``of``, one of ``KINDS``, is refused.
    """
    folder = Path(path)
    with reported("make folder", path):
        if folder.exists() and not folder.is_dir():
            raise FileError("make folder", path, "a file of that name is in the way")
        for kind, marks in KINDS.items() if of else ():
            if kind != of and any((folder / mark).exists() for mark in marks):
                raise FileError("write", path, f"it holds {kind}; choose another folder for {of}")
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def check_new_folder(path: str | Path) -> Path:
    """Raise FileError if there is something at ``path`` but an empty folder; return its place."""
    with reported("write", path):
        target = Path(os.path.realpath(path))
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise FileError("write", path, "it exists and is not an empty folder")
    return target


def check_writable(path: str | Path) -> None:
    """Raise FileError unless a file can be written at ``path``; nothing there is changed.

    For commands that compute for long before they write: a block is written beside the place and
    removed again.
    """
    with reported("write", path):
        target = Path(os.path.realpath(path))
        _refuse_special(target)
        probe = temporary_path(target)
        try:
            _write_new(probe, bytes(4096), None)
        finally:
            with suppress(OSError):
                probe.unlink(missing_ok=True)


def write_folder(path: str | Path, files: dict[str, bytes]) -> None:
    """Make a folder with these files appear under its name in one step.

    Raises:
        FileError: There is already something in the folder, or it cannot be written; then
            nothing is left behind.
    """
    with reported("write", path):
        target = check_new_folder(path)
        make_folder(target.parent)
        remove_orphans(target.parent)
        temporary = temporary_path(target)
        try:
            temporary.mkdir()
            for name, data in files.items():
                _write_new(temporary / name, data, None)
            sync_folder(temporary)
            _replace(temporary, target)
        except BaseException:
            _remove_folder(temporary)
            raise
        sync_folder(target.parent)


def remove_file(path: str | Path) -> None:
    """Remove the file if it exists, and make that last."""
    with reported("remove", path):
        Path(path).unlink(missing_ok=True)
        sync_folder(Path(path).parent)


def remove_orphans(folder: str | Path) -> list[Path]:
    """Remove, and return, the temporary files that dead processes of this machine left in a folder.

    Those of living processes and of other machines stay.
    """
    removed = []
    with suppress(OSError):
        # Folders of thousands of episodes are looked through at each: by plain names.
        for name in sorted(n for n in os.listdir(folder) if n.endswith(TEMPORARY_SUFFIX)):
            match = _TEMPORARY_NAME.fullmatch(name)
            if match is None or match["machine"] != _MACHINE or is_running(int(match["pid"])):
                continue
            path = Path(folder) / name
            if path.is_dir():
                _remove_folder(path)
            else:
                path.unlink(missing_ok=True)
            removed.append(path)
    return removed


def is_running(pid: int) -> bool:
    """Return whether a process of that number runs on this machine."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # it is there, but another user's
    return True


def opened_new(path: str | Path) -> int:
    """Return the descriptor of a file that was not there before, to append to."""
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)


def lock(descriptor: int) -> None:
    """Lock an open file until its process closes it or dies; a lock of another is an OSError."""
    if fcntl is not None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def locked(folder: Path, advice: str = "wait for it, or choose another folder") -> int:
    """Return a descriptor that holds the folder's lock, with our pid in it for others to read."""
    path = folder / ".lock"
    with reported("write", path):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            lock(descriptor)
            is_ours = os.path.samestat(os.fstat(descriptor), os.stat(path))
        except (BlockingIOError, FileNotFoundError):
            is_ours = False
        if not is_ours:  # another holds it, or has deleted it meanwhile
            holder = os.read(descriptor, 32).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise RunFolderError(f"{folder} is in use by process {holder}: {advice}")
        os.ftruncate(descriptor, 0)
        os.write(descriptor, f"{os.getpid()}\n".encode())
    return descriptor


def is_locked(path: str | Path) -> bool:
    """Return whether a living process holds the lock on a file."""
    if fcntl is None:
        return False
    with reported("read", path):
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
    return False


def temporary_path(target: Path) -> Path:
    """Return a new name beside ``target`` that tells machine and process."""
    name = f".{target.name[:150]}.{_MACHINE}-{os.getpid()}-{next(_counter)}{TEMPORARY_SUFFIX}"
    return target.with_name(name)


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of ``data``, in as many calls as the system wants."""
    view = memoryview(data)
    while view:
        view = view[_write(descriptor, bytes(view[: 1 << 24])) :]


def sync(descriptor: int) -> None:
    """Flush an open file to the disk."""
    _fsync(descriptor)


def sync_folder(folder: Path) -> None:
    """Flush the folder's list of names to the disk, where the system can."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        _fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def reported(action: str, path: str | Path) -> Iterator[None]:
    """Turn an OSError inside the ``with`` block into one clear FileError."""
    try:
        yield
    except EutreeError:
        raise
    except OSError as error:
        raise FileError(action, path, _reason(error, action, Path(path))) from error
    except ValueError as error:  # a path with a null character
        raise FileError(action, path, str(error)) from None


def _reason(error: OSError, action: str, path: Path) -> str:
    if error.errno == errno.ENOENT and action != "read":
        return f"the folder {path.parent} does not exist"
    return _ADVICE.get(error.errno or 0, error.strerror or str(error))


def _write_new(path: Path, data: bytes, permissions: int | None) -> None:
    """Write a file that does not exist yet and flush it to the disk."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        if permissions is not None:
            with suppress(OSError):
                os.chmod(path, permissions)
        write_all(descriptor, data)
        _fsync(descriptor)
    finally:
        os.close(descriptor)


def _permissions(path: Path) -> int | None:
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError:
        return None


def _refuse_special(path: Path) -> None:
    if path.is_dir():
        raise FileError("write", path, "it is a folder, not a file")
    if path.exists() and not path.is_file():
        raise FileError("write", path, "it is not a regular file")


def _remove_folder(folder: Path) -> None:
    """Remove a flat folder and its files; ignore files already gone."""
    remove: Callable[[Path], None]
    with suppress(OSError):
        for path in folder.iterdir():
            remove = Path.rmdir if path.is_dir() else Path.unlink
            remove(path)
        folder.rmdir()
