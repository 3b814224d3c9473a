"""Whether a significant split is worth a leaf."""

from dataclasses import dataclass
from typing import Protocol

from eutree.splitting import LeafSample, Split


class Gate(Protocol):
    """A rule that keeps or refuses a significant split."""

    def keeps(self, split: Split, sample: LeafSample, *, action: int) -> bool:
        """Return whether the leaf, whose present action is ``action``, should be split."""
        ...


@dataclass(frozen=True)
class AlwaysOpen:
    """Keep every significant split, as the paper does."""

    def keeps(self, split: Split, sample: LeafSample, *, action: int) -> bool:
        """Return True."""
        return True
