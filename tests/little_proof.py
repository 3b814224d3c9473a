"""Proofs that cut starts into a few thousand pieces, for tests of what is around a proof."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

from eutree.proof import Effort

SMALLEST = 2.0**-10  # of the width of the starts; it is 2**-26 otherwise


@contextmanager
def little_proof() -> Iterator[None]:
    """Let a proof that names no effort cut no finer: bounds of a return are a little wider."""
    initializer: object = Effort.__init__
    defaults = {**Effort.__init__.__kwdefaults__, "smallest": SMALLEST}
    with mock.patch.object(initializer, "__kwdefaults__", defaults):
        yield
