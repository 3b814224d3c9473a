"""Standard output, kept for the one JSON object: what an environment prints goes to standard error.

Environments print, in Python and from libraries in C, and whoever reads the JSON must not see it.
"""

import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from typing import TextIO

_results: TextIO | None = None


def results() -> TextIO:
    """Return where a result is written."""
    return _results or sys.stdout


@contextmanager
def kept_for_results() -> Iterator[None]:
    """Send to standard error what is printed inside; ``results()`` is standard output still."""
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
                _flush_c()
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


def _flush_c() -> None:
    """Write out what C libraries have printed: at the end of the process it would come late."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).fflush(None)
