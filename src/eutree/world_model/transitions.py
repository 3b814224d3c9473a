"""Stored transitions as a world model and a planner see them."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.data import Episode
from eutree.features import Derivation
from eutree.schema import Schema

NOTHING_DERIVED = Derivation(0)
MOST_CELLS = 1024  # that are counted
_PARTS = 12  # of each feature's range, of places that are told apart
_ALIKE = 1e-9  # returns, in parts of the largest
_MANY_RETURNS = 30  # whose range is told


def countable(schema: Schema) -> bool:
    """Return whether observations are whole numbers of a few combinations, none derived."""
    if any(one.formula or not one.is_integer for one in schema.features):
        return False
    return math.prod([one.high - one.low + 1.0 for one in schema.features]) <= MOST_CELLS


@dataclass(frozen=True, eq=False)
class Transitions:
    """Whole episodes, row after row."""

    observations: Floats  # [N, d]; o of each transition
    actions: Integers  # [N]; a
    rewards: Floats  # [N]; r
    next_observations: Floats  # [N, d]; o'
    terminated: Booleans  # [N]; whether the task ended with the transition
    episodes: Integers  # [N]; number of the transition's episode, ascending
    n_actions: int  # A
    memory: bool = True  # whether the displacement before each transition is to be known
    derivation: Derivation = NOTHING_DERIVED  # how derived features of observations are computed
    allowed: Booleans | None = None  # [N, A]; which actions were; None where that is not known
    counted: bool = False  # whether observations are one of a few codes, to be counted

    @classmethod
    def of(cls, episodes: Sequence[Episode], n_actions: int) -> "Transitions":
        """Return the transitions of episodes, at least one step in all."""
        none, rows = np.empty(0), np.empty((0, episodes[0].observations.shape[1]))
        numbers = np.empty(0, dtype=np.int64)
        empty = cls(rows, numbers, none, rows, np.empty(0, np.bool_), numbers, n_actions)
        return empty.followed_by(episodes)

    @cached_property
    def first(self) -> Booleans:
        """Whether each transition is the first of its episode, shape [N]."""
        return np.append(True, self.episodes[1:] != self.episodes[:-1])[: self.episodes.size]

    @cached_property
    def last(self) -> Booleans:
        """Whether each transition is the last of its episode, shape [N]."""
        return np.append(self.first[1:], True)[: self.episodes.size]

    @cached_property
    def displacements(self) -> Floats:
        """Displacement o' - o, shape [N, d]."""
        return self.next_observations - self.observations

    @cached_property
    def previous_displacements(self) -> Floats:
        """Displacement that led to o, 0 at the start of an episode, shape [N, d]."""
        previous = np.zeros_like(self.displacements)
        if not self.memory:
            return previous
        previous[1:] = self.displacements[:-1]
        previous[self.first] = 0.0
        return previous

    @cached_property
    def returns_to_go(self) -> Floats:
        """Sum of rewards from each transition to the end of its episode, shape [N]."""
        ahead = np.cumsum(self.rewards[::-1])[::-1]  # [N] to the end of all
        last = np.flatnonzero(self.last)
        beyond = np.append(ahead, 0.0)[last + 1]  # [E]
        returns: Floats = ahead - beyond[np.searchsorted(last, np.arange(self.rewards.size))]
        return returns

    @cached_property
    def outcome(self) -> Floats:
        """1 where an episode ended badly, -1 where it ended well, 0 elsewhere, shape [N].

        A last reward is bad below the mean return to go of transitions that go on.
        """
        goes_on = ~self.terminated
        level = float(self.returns_to_go[goes_on].mean()) if goes_on.any() else 0.0
        return np.where(goes_on, 0.0, np.where(self.rewards < level, 1.0, -1.0))

    @cached_property
    def episode_returns(self) -> Floats:
        """Return of each episode, shape [E]."""
        return self.returns_to_go[self.first]

    @property
    def typical_return(self) -> float:
        """The mean size of a return, above 0: the unit of prices.

        At most four times the range of many returns: a constant of rewards is nothing to win.
        """
        returns = self.episode_returns
        size, spread = float(np.abs(returns).mean()), 4.0 * float(np.ptp(returns))
        told = returns.size >= _MANY_RETURNS and spread > 1e-9 * size
        return max(min(size, spread) if told else size, 1e-9)

    @property
    def episode_lengths(self) -> Integers:
        """Steps of each episode, shape [E]."""
        return np.flatnonzero(self.last) - np.flatnonzero(self.first) + 1

    @property
    def mean_length(self) -> float:
        """Mean number of steps of an episode."""
        return float(self.episode_lengths.mean())

    def horizon(self) -> int:
        """Return the longest episode's length where a limit cut it, or else twice that."""
        longest = self.longest()
        cut = ~self.terminated[self.last] & ~self.stopped
        return longest if cut.any() else 2 * longest

    @property
    def stopped(self) -> Booleans:
        """Whether somebody stopped each episode: it was cut, and shorter than another, [E]."""
        cut: Booleans = ~self.terminated[self.last]
        return cut & (self.episode_lengths < self.longest())

    def longest(self) -> int:
        """Return the longest episode's length."""
        return int(self.episode_lengths.max())

    def recent(self, limit: int) -> "Transitions":
        """Return the last episodes that hold at most ``limit`` transitions, at least one."""
        if self.rewards.size <= limit:
            return self
        begins = np.flatnonzero(self.first)
        fits = int(np.searchsorted(begins, self.rewards.size - limit))
        return self._of(slice(int(begins[min(fits, begins.size - 1)]), None))

    def spread(self, limit: int) -> "Transitions":
        """Return at most ``limit`` transitions: half of the last episodes, half of all before.

        Of those before every k-th episode is taken, with the smallest k that fits.
        """
        if self.rewards.size <= limit:
            return self
        recent, lengths = self.recent(limit // 2), self.episode_lengths
        before = lengths[: lengths.size - recent.episode_lengths.size]
        room, apart = limit - recent.rewards.size, 1
        while apart <= before.size and before[::apart].sum() > room:
            apart += 1
        taken = np.arange(lengths.size) >= before.size
        if apart <= before.size:
            taken[: before.size : apart] = True
        return self._of(np.repeat(taken, lengths))

    def since(self, episode: int) -> "Transitions":
        """Return the transitions of ``episode`` and all later ones."""
        return self._of(self.episodes >= episode)

    def until(self, n: int) -> "Transitions":
        """Return the first n transitions."""
        return self._of(slice(n))

    def followed_by(self, episodes: Sequence[Episode]) -> "Transitions":
        """Return these transitions and those of further episodes, without what was allowed."""
        kept = [episode for episode in episodes if len(episode)]
        number = int(self.episodes[-1]) + 1 if self.episodes.size else 0
        ends = [np.arange(len(e)) == (len(e) - 1 if e.terminated else -1) for e in kept]
        numbers = [np.full(len(e), number + k, dtype=np.int64) for k, e in enumerate(kept)]
        return replace(
            self,
            observations=np.concatenate([self.observations, *(e.observations[:-1] for e in kept)]),
            actions=np.concatenate([self.actions, *(e.actions for e in kept)]),
            rewards=np.concatenate([self.rewards, *(e.rewards for e in kept)]),
            next_observations=np.concatenate(
                [self.next_observations, *(e.observations[1:] for e in kept)]
            ),
            terminated=np.concatenate([self.terminated, *ends]),
            allowed=None,
            episodes=np.concatenate([self.episodes, *numbers]),
        )

    def _of(self, rows: slice | Booleans) -> "Transitions":
        names = ("observations", "actions", "rewards", "next_observations", "terminated",
                 "episodes")  # fmt: skip
        allowed = None if self.allowed is None else self.allowed[rows]
        return replace(self, allowed=allowed, **{name: getattr(self, name)[rows] for name in names})


def seen_as(derivation: Derivation, data: Transitions) -> Transitions:
    """Return transitions with those derived features of observations that are not there yet.

    Behind them may stand the past.
    """
    seen = derivation.behind(data.observations)
    complete = seen.shape[1] >= derivation.n_measured + len(derivation.formulas)
    return replace(
        data,
        observations=seen,
        next_observations=derivation.behind(data.next_observations),
        derivation=derivation if complete else NOTHING_DERIVED,
    )


# Where returns tell nothing, the places that were visited may. ------------------------------------


def earned_nothing(data: Transitions) -> bool:
    """Return whether all episodes earned the same, and no gain: none tells what is better."""
    returns = data.episode_returns
    alike = returns.size and np.ptp(returns) <= _ALIKE * np.abs(returns).max()
    return bool(alike and returns[0] <= 0.0)


def reached_nothing(data: Transitions) -> bool:
    """Return whether each episode was cut, and none earned a gain."""
    return not data.terminated.any() and bool((data.episode_returns <= 0.0).all())


def paid_for_places(data: Transitions) -> Transitions:
    """Return the transitions, each paid for how seldom the place that it led to was visited.

    For each pair of features, each cell of a grid pays one in all, shared by its visits.
    """
    places = data.next_observations
    low, span = places.min(axis=0), np.ptp(places, axis=0)
    parts = (places - low) / np.where(span > 0.0, span, 1.0) * _PARTS
    columns = np.minimum(parts, _PARTS - 1).astype(np.int64).T
    pairs = [*itertools.combinations(columns, 2)] or [(columns[0], 0)]
    cells = [_PARTS * one + other for one, other in pairs]
    return replace(data, rewards=sum(1.0 / np.bincount(cell)[cell] for cell in cells))
