"""Compression that searches by few steps, for tests of what is around a search."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

from eutree.training import many
from eutree.world_model import ensemble


@contextmanager
def little_search() -> Iterator[None]:
    """Let a search by playing take at most a hundredth of its steps, a model a tenth of its fits.

    It plays from a fifth of the starts; the front of a run imagines a tenth of its steps, and many
    runs are compared by fewer episodes.
    """

    def fit(data: Any, settings: Any, generator: Any) -> Any:
        few = replace(settings, updates=min(settings.updates, 500))
        return ensemble.fit_ensemble(data, few, generator)

    judging = {"selection_episodes": 50, "judging_episodes": 100}
    front = {"STEPS": 100_000, "FEW_STEPS": 10_000, "STARTS": 200, "FEW_STARTS": 12}
    with (
        mock.patch.multiple("eutree.compression.front", **front),
        mock.patch("eutree.training.front.IMAGINED", 200),
        mock.patch("eutree.compression.imagined.fit_ensemble", fit),
        mock.patch.dict(many.learn_runs.__kwdefaults__, judging),
    ):
        yield
