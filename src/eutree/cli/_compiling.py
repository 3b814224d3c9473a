"""Say on standard error what is being compiled: the first command waits for it, in silence else."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

import click

SECONDS = 2.0  # between two lines


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
        elif now - self._said >= SECONDS:
            name = str(record.args[0]) if isinstance(record.args, tuple) else ""
            part = name.removeprefix("eutree.").partition("._kernels")[0]
            click.echo(f"compiling {self._count}: {part}", err=True)
        else:
            return
        self._said = now


@contextmanager
def said_what_is_compiled() -> Iterator[None]:
    """Say what is compiled while the context lasts."""
    logger, saying = logging.getLogger("eutree.compiled"), _Saying()
    level = logger.level
    logger.addHandler(saying)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.setLevel(level)
        logger.removeHandler(saying)
