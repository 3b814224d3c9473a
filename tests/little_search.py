"""Compression that searches by few steps, for tests of what is around a search by playing."""

from contextlib import AbstractContextManager
from typing import Any
from unittest import mock


def little_search() -> AbstractContextManager[Any]:
    """Return a context in which a search by playing takes a fiftieth of its steps, or less."""
    return mock.patch.multiple("eutree.compression.front", STEPS=300_000, FEW_STEPS=30_000)
