"""Compression that searches by few steps, for tests of what is around a search."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

from eutree.world_model import ensemble


@contextmanager
def little_search() -> Iterator[None]:
    """Let a search by playing take a fiftieth of its steps, and a model of a tenth as many fits."""

    def fit(data: Any, settings: Any, generator: Any) -> Any:
        few = replace(settings, updates=min(settings.updates, 500))
        return ensemble.fit_ensemble(data, few, generator)

    with (
        mock.patch.multiple("eutree.compression.front", STEPS=300_000, FEW_STEPS=30_000),
        mock.patch("eutree.compression.imagined.fit_ensemble", fit),
    ):
        yield
