"""How a history of bounded size forgets: a random part, so that a fair sample stays.

Bottom-k sampling (Cohen & Kaplan, "Summarizing data using bottom-k sketches", 2007). Each
transition draws a random *rank*, a whole number below ``RANKS``, when it comes. A reservoir keeps
the transitions whose ranks lie below its *bound*. For any bound they are a uniform sample of
all that the reservoir has seen, and a later transition is stored exactly when its rank lies below
it too. A bound falls when room is needed, and never rises.

*Leaves and actions* (``LeafReservoirs``): each pair of a leaf and an action is a reservoir. They
share the room max-min fairly: each keeps all, up to one size, so the largest give way and the rare
lose nothing. The halves of a split leaf start with the transitions that they inherit.

*Episodes* (``RecentEpisodes``): a planner needs whole episodes, in order. The most recent ones,
half of the room, stay; all older ones are one reservoir.

Forgetting takes time in proportion to the size, so an eighth of the room is freed at once.
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Int32s, Integers, grown
from eutree.errors import warn

RANKS = 2**32
_FREED = 8

Ranks = NDArray[np.uint32]
Labels = NDArray[np.integer[Any]]


class LeafReservoirs:
    """A reservoir for each leaf and action, of ``max_transitions`` together."""

    def __init__(self, max_transitions: int, n_leaves: int, n_actions: int) -> None:
        self.max_transitions = max_transitions
        self.bounds = np.full((n_leaves, n_actions), RANKS, dtype=np.uint64)  # [L, A]

    def draw(self, n_steps: int, generator: np.random.Generator) -> Ranks:
        """Return a rank for each transition of an episode, shape [T]."""
        return generator.integers(RANKS, size=n_steps, dtype=np.uint32)

    def admits(self, leaves: Labels, actions: Labels, ranks: Ranks) -> Booleans:
        """Return which new transitions are stored: those below the bounds of theirs, shape [T]."""
        below: Booleans = ranks < self.bounds[leaves, actions]
        return below

    def keeps(self, leaves: Int32s, actions: Int32s, episodes: Int32s, ranks: Ranks) -> Booleans:
        """Keep the lowest ranks of each reservoir, as many as its share allows; shape [N]."""
        n_actions = self.bounds.shape[1]
        cells = leaves.astype(np.int64) * n_actions + actions
        sizes = np.bincount(cells, minlength=self.bounds.size)
        shares = fair_shares(sizes, _room(self.max_transitions))
        begins = np.cumsum(sizes) - sizes
        ascending = ranks[np.lexsort((ranks, cells))]
        for cell in np.flatnonzero(shares < sizes).tolist():
            self.bounds[divmod(cell, n_actions)] = ascending[begins[cell] + shares[cell]]
        return self.admits(leaves, actions, ranks)

    def rescaled(self, leaves: Labels, actions: Labels, ranks: Ranks) -> Ranks:
        """Return ranks of reservoirs that are reset, scaled to the whole range, shape [n]."""
        scaled = ranks.astype(np.uint64) * np.uint64(RANKS) // self.bounds[leaves, actions]
        return scaled.astype(np.uint32)

    def reset(self, leaf: int, new_leaf: int) -> None:
        """Let the reservoirs of both halves of a split leaf take in everything again."""
        self.bounds = grown(self.bounds, new_leaf + 1, RANKS)
        self.bounds[leaf] = RANKS


class RecentEpisodes:
    """The most recent episodes and one reservoir of older ones, of ``max_transitions`` together."""

    def __init__(self, max_transitions: int) -> None:
        self.max_transitions = max_transitions
        self.bounds = np.full(1, RANKS, dtype=np.uint64)  # of the reservoir of older episodes
        self._warned = False

    def draw(self, n_steps: int, generator: np.random.Generator) -> Ranks:
        """Return the rank of the episode for each of its transitions, shape [T]."""
        return np.full(n_steps, generator.integers(RANKS, dtype=np.uint32))

    def admits(self, leaves: Labels, actions: Labels, ranks: Ranks) -> Booleans:
        """Return True for each, shape [T]: a new episode is recent."""
        fits = ranks.size <= self.max_transitions
        if not fits and not self._warned:
            self._warned = True
            warn(
                f"an episode of {ranks.size:,} transitions is more than max_transitions = "
                f"{self.max_transitions:,}, so nothing can be learned from it (said once)",
            )
        return np.full(ranks.size, fits)

    def keeps(self, leaves: Int32s, actions: Int32s, episodes: Int32s, ranks: Ranks) -> Booleans:
        """Keep the last episodes, and a random part of older ones while there is room; [N]."""
        room = _room(self.max_transitions)
        first = np.append(0, np.flatnonzero(np.diff(episodes)) + 1)  # [E] first row of each
        lengths = np.diff(first, append=episodes.size)
        behind = np.cumsum(lengths[::-1])[::-1]  # [E] transitions from each episode to the end
        recent = behind <= max(room // 2, int(lengths[-1]))
        room -= int(lengths[recent].sum())
        older = np.flatnonzero(~recent)
        by_rank = older[np.argsort(ranks[first[older]], kind="stable")]
        too_much = by_rank[np.cumsum(lengths[by_rank]) > room]
        if too_much.size:
            self.bounds[0] = min(int(self.bounds[0]), int(ranks[first[too_much[0]]]))
        stay = recent | (ranks[first] < self.bounds[0])
        return np.repeat(stay, lengths)


Forgetting: TypeAlias = LeafReservoirs | RecentEpisodes


def fair_shares(sizes: Integers, room: int) -> Integers:
    """Return how much of each reservoir [n] stays: all of it up to one size, ``room`` in all.

    The rest after the largest such size goes to the first reservoirs above it, one each.
    """
    if int(sizes.sum()) <= room:
        return sizes
    ascending = np.sort(sizes)
    below = np.cumsum(ascending) - ascending  # [n] all that the smaller ones hold
    n_larger = np.arange(sizes.size, 0, -1)  # [n] those that are as large, or larger
    first_cut = int(np.argmax(below + ascending * n_larger > room))
    limit = (room - int(below[first_cut])) // int(n_larger[first_cut])
    shares = np.minimum(sizes, limit)
    shares[np.flatnonzero(sizes > limit)[: room - int(shares.sum())]] += 1
    return shares


def _room(max_transitions: int) -> int:
    """Return how many transitions stay when some are forgotten."""
    return max_transitions - max_transitions // _FREED
