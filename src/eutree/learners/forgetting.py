"""What a history of bounded size forgets: chosen by lot, so that what stays is a fair sample.

Each transition draws a lot, a whole number below ``WHOLE``, when it comes. A reservoir keeps the
transitions whose lots lie below its *bound*. Whatever the bound, they are a uniform sample of all
that the reservoir has seen, and a later transition is stored exactly when its lot lies below it
too. A bound falls when room is needed, and never rises (bottom-k sampling; Cohen & Kaplan,
"Summarizing data using bottom-k sketches", 2007).

*Leaves and actions* (``LeafReservoirs``): each pair of a leaf and an action is a reservoir. They
share the room as vessels share water: each holds what it has, up to one level, so the fullest give
way and the rare keep all. The halves of a split leaf begin anew with what they inherit.

*Episodes* (``RecentEpisodes``): a planner needs whole episodes, in order. The most recent ones,
half of the room, stay; all older ones are one reservoir.

Forgetting takes time in proportion to what is stored, so an eighth of the room is freed at once.
"""

import warnings
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Int32s, Integers

WHOLE = 2**32
_FREED = 8

Lots = NDArray[np.uint32]
Labels = NDArray[np.integer[Any]]


class Forgetting(Protocol):
    """A rule for what is stored, and for what stays when there is too much.

    Attributes:
        max_transitions: Most transitions stored between two episodes.
        bounds: Bound of each reservoir.
    """

    max_transitions: int
    bounds: NDArray[np.uint64]  # [L, A] or [1]

    def draw(self, n_steps: int, generator: np.random.Generator) -> Lots:
        """Return the lots of an episode's transitions, shape [T]."""
        ...

    def admits(self, leaves: Labels, actions: Labels, lots: Lots) -> Booleans:
        """Return which of new transitions are stored, shape [T]."""
        ...

    def keeps(self, leaves: Int32s, actions: Int32s, episodes: Int32s, lots: Lots) -> Booleans:
        """Return which of all stored transitions stay, shape [N]; lower bounds for it."""
        ...

    def spread(self, leaves: Labels, actions: Labels, lots: Lots) -> Lots:
        """Return lots over the whole range, for reservoirs that begin anew, shape [n]."""
        ...

    def begin_anew(self, n_leaves: int, leaves: list[int] | None = None) -> None:
        """Let the reservoirs of ``leaves`` (None: of all) take in everything again."""
        ...


class LeafReservoirs:
    """A reservoir for each leaf and action.

    Args:
        max_transitions: Most transitions stored.
        n_leaves: Number of leaves L.
        n_actions: Number of actions A.

    Attributes:
        bounds: Bound of each reservoir, shape [L, A].
    """

    def __init__(self, max_transitions: int, n_leaves: int, n_actions: int) -> None:
        self.max_transitions = max_transitions
        self.bounds = np.full((n_leaves, n_actions), WHOLE, dtype=np.uint64)

    def draw(self, n_steps: int, generator: np.random.Generator) -> Lots:
        """Return a lot for each transition, shape [T]."""
        return generator.integers(WHOLE, size=n_steps, dtype=np.uint32)

    def admits(self, leaves: Labels, actions: Labels, lots: Lots) -> Booleans:
        """Return which lots lie below the bounds of their reservoirs, shape [T]."""
        below: Booleans = lots < self.bounds[leaves, actions]
        return below

    def keeps(self, leaves: Int32s, actions: Int32s, episodes: Int32s, lots: Lots) -> Booleans:
        """Keep the lowest lots of each reservoir, as many as its share allows; shape [N]."""
        n_actions = self.bounds.shape[1]
        cells = leaves.astype(np.int64) * n_actions + actions
        sizes = np.bincount(cells, minlength=self.bounds.size)
        shares = fair_shares(sizes, _room(self.max_transitions))
        begins = np.cumsum(sizes) - sizes
        ascending = lots[np.lexsort((lots, cells))]
        for cell in np.flatnonzero(shares < sizes).tolist():
            self.bounds[divmod(cell, n_actions)] = ascending[begins[cell] + shares[cell]]
        return self.admits(leaves, actions, lots)

    def spread(self, leaves: Labels, actions: Labels, lots: Lots) -> Lots:
        """Return the lots, which lie below the bounds, stretched over the whole range."""
        stretched = lots.astype(np.uint64) * np.uint64(WHOLE) // self.bounds[leaves, actions]
        return stretched.astype(np.uint32)

    def begin_anew(self, n_leaves: int, leaves: list[int] | None = None) -> None:
        """Let the reservoirs of ``leaves`` (None: of all) take in everything again."""
        bounds = np.full((n_leaves, self.bounds.shape[1]), WHOLE, dtype=np.uint64)
        if leaves is not None:
            shared = min(n_leaves, len(self.bounds))
            bounds[:shared] = self.bounds[:shared]
            bounds[leaves] = WHOLE
        self.bounds = bounds


class RecentEpisodes:
    """The most recent episodes, and one reservoir of older ones.

    Args:
        max_transitions: Most transitions stored.

    Attributes:
        bounds: Bound of the reservoir of older episodes, shape [1].
    """

    def __init__(self, max_transitions: int) -> None:
        self.max_transitions = max_transitions
        self.bounds = np.full(1, WHOLE, dtype=np.uint64)
        self._warned = False

    def draw(self, n_steps: int, generator: np.random.Generator) -> Lots:
        """Return the lot of the episode for each of its transitions, shape [T]."""
        return np.full(n_steps, generator.integers(WHOLE, dtype=np.uint32))

    def admits(self, leaves: Labels, actions: Labels, lots: Lots) -> Booleans:
        """Return True for each, shape [T]: what is new is recent."""
        fits = lots.size <= self.max_transitions
        if not fits and not self._warned:
            self._warned = True
            warnings.warn(
                f"an episode of {lots.size:,} transitions is more than max_transitions = "
                f"{self.max_transitions:,}, so nothing can be learned from it (said once)",
                stacklevel=2,
            )
        return np.full(lots.size, fits)

    def keeps(self, leaves: Int32s, actions: Int32s, episodes: Int32s, lots: Lots) -> Booleans:
        """Keep the last episodes, and older ones by lot while there is room; shape [N]."""
        room = _room(self.max_transitions)
        first = np.append(0, np.flatnonzero(np.diff(episodes)) + 1)  # [E] first row of each
        lengths = np.diff(first, append=episodes.size)
        behind = np.cumsum(lengths[::-1])[::-1]  # [E] transitions from each episode to the end
        recent = behind <= max(room // 2, int(lengths[-1]))
        room -= int(lengths[recent].sum())
        older = np.flatnonzero(~recent)
        by_lot = older[np.argsort(lots[first[older]], kind="stable")]
        too_much = by_lot[np.cumsum(lengths[by_lot]) > room]
        if too_much.size:
            self.bounds[0] = min(int(self.bounds[0]), int(lots[first[too_much[0]]]))
        stay = recent | (lots[first] < self.bounds[0])
        return np.repeat(stay, lengths)

    def spread(self, leaves: Labels, actions: Labels, lots: Lots) -> Lots:
        """Return the lots: a leaf has no reservoir here."""
        return lots

    def begin_anew(self, n_leaves: int, leaves: list[int] | None = None) -> None:
        """Do nothing: a leaf has no reservoir here."""


def fair_shares(sizes: Integers, room: int) -> Integers:
    """Return how much of each vessel stays: all of it up to one level, ``room`` in all.

    What is left after the highest whole level goes to the first vessels above it, one each.

    Args:
        sizes: What each vessel holds, shape [n].
        room: What they may hold together.
    """
    if int(sizes.sum()) <= room:
        return sizes
    ascending = np.sort(sizes)
    below = np.cumsum(ascending) - ascending  # [n] all that the smaller vessels hold
    vessels = np.arange(sizes.size, 0, -1)  # [n] those that are as full, or fuller
    first_cut = int(np.argmax(below + ascending * vessels > room))
    level = (room - int(below[first_cut])) // int(vessels[first_cut])
    shares = np.minimum(sizes, level)
    shares[np.flatnonzero(sizes > level)[: room - int(shares.sum())]] += 1
    return shares


def _room(max_transitions: int) -> int:
    """Return how many transitions stay when some are forgotten."""
    return max_transitions - max_transitions // _FREED
