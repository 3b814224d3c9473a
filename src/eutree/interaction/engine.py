"""What a page shows and drives."""

from collections.abc import Iterable
from typing import Protocol

from eutree.interaction.events import Event, Tick
from eutree.interaction.session import Session


class Engine(Protocol):
    """A recorder, or whoever asks a person to act for a stretch."""

    session: Session

    def tick(self, now: float, events: Iterable[Event] = ()) -> Tick:
        """Take in what happened until ``now``; return what to show."""
        ...
