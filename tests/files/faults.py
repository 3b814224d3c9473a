"""A file system that fails."""

import errno
import os
from contextlib import contextmanager

from eutree.errors import FileError
from eutree.files import atomic


class Operations:
    """The system calls behind every write; others derive from it and fail."""

    def write(self, descriptor, data):
        return os.write(descriptor, data)

    def fsync(self, descriptor):
        os.fsync(descriptor)

    def replace(self, source, target):
        os.replace(source, target)


@contextmanager
def use_operations(operations):
    """Let all writes inside the ``with`` block go through ``operations``."""
    before = atomic._write, atomic._fsync, atomic._replace
    atomic._write, atomic._fsync = operations.write, operations.fsync
    atomic._replace = operations.replace
    try:
        yield
    finally:
        atomic._write, atomic._fsync, atomic._replace = before


class Fault(Operations):
    """Raises at the n-th operation, or writes only half of it first."""

    def __init__(self, n: int, number: int = errno.ENOSPC) -> None:
        self.left, self.number = n, number

    def _step(self, descriptor: int | None = None, data: bytes = b"") -> None:
        self.left -= 1
        if self.left == 0:
            if descriptor is not None:
                os.write(descriptor, data[: len(data) // 2])
            raise OSError(self.number, os.strerror(self.number))

    def write(self, descriptor, data):
        self._step(descriptor, data)
        return super().write(descriptor, data[:7000])

    def fsync(self, descriptor):
        self._step()
        super().fsync(descriptor)

    def replace(self, source, target):
        self._step()
        super().replace(source, target)


def faults_until_success(save, check):
    """Call ``save`` with a fault at operation 1, 2, 3, ... until none is hit; check each time."""
    for n in range(1, 1000):
        operations = Fault(n)
        try:
            with use_operations(operations):
                save()
        except FileError as error:
            message = str(error)
            assert operations.left <= 0
            check(n, False)
        else:
            assert operations.left > 0
            check(n, True)
            return n
        assert "disk is full" in message
    raise AssertionError("never succeeded")
