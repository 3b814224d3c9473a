"""Evaluate what a compression changed, in an environment."""

from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.compression.episodes import Demand
from eutree.compression.playing import Ground
from eutree.compression.report import ROUNDED_EPISODES, RoundingPlayed
from eutree.contests import bounds_of_change
from eutree.evaluation import Estimate, Interval, evaluate
from eutree.interaction import episode_seed
from eutree.interaction.recipe import Environment, Recipe, made
from eutree.interaction.seeding import Stream
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec

SEEN, OBSERVED = 2**42, 100  # the first start, and how many, where nothing was recorded
_ROUNDING_BLOCK = 1_000_000  # of starts, which no race comes to


@dataclass(eq=False)
class Arena:
    """An environment, and how much was asked of it.

    Attributes:
        env: The environment.
        seed: Seed of all its episodes.
        spec: How other processes make it; None keeps all episodes in this one.
        n_jobs: Processes, as ``evaluate`` takes them.
        steps: Environment steps of all episodes so far.
    """

    env: gymnasium.Env[Any, Any]
    seed: int
    spec: EnvironmentSpec | None = None
    n_jobs: int | None = None
    steps: int = 0

    @classmethod
    def of(cls, env: Environment, seed: int, n_jobs: int | None) -> "Arena":
        """Return an environment, or what it is made from, with nothing asked of it yet."""
        itself, spec = made(env, n_jobs)
        return cls(itself, seed, spec, n_jobs)

    def ground(self) -> Ground:
        """Return where trees are searched for."""
        recipe = None if self.spec is None else Recipe.of(self.spec)
        return Ground(self.env, self.seed, recipe, self.n_jobs)

    def observations(self, policy: TreePolicy) -> Floats:
        """Return the features that a policy meets in some episodes, shape [N, d]."""
        starts = SEEN + np.arange(OBSERVED)
        return self.ground().play([policy], np.zeros(OBSERVED, np.intp), starts)[1].features

    def run(self, policy: TreePolicy, block: int, episodes: int) -> Floats:
        """Return the returns of a policy in a block of starts; the same for each policy."""
        seed = episode_seed(self.seed, block, Stream.COMPRESSION)
        if self.spec is None:
            result = evaluate(policy, self.env, episodes=episodes, seed=seed)
        else:
            result = evaluate(policy, self.spec, episodes=episodes, seed=seed, n_jobs=self.n_jobs)
        self.steps += result.steps
        return result.returns


@dataclass(frozen=True)
class Verdict:
    """Two policies on the same fresh episodes.

    Attributes:
        before: Mean return of the input.
        after: Mean return of the other policy.
        change: Mean of after minus before, with bounds that hold for all returns within the range.
        return_range: Lowest and highest return of an episode, as known or as seen.
    """

    before: float
    after: float
    change: Estimate
    return_range: tuple[float, float]

    @classmethod
    def of(cls, before: Floats, after: Floats, demand: Demand) -> "Verdict":
        """Return the verdict of the returns of two policies from common starts, [E] each."""
        table = np.stack([before, after])
        known = demand.known_range
        if known is None and demand.margin:  # losses that were not seen may be as large as this
            most = float(table.max())
            known = (min(float(table.min()), most - demand.blind_width), most)
        found = bounds_of_change(table, error=2 * demand.error, known=known)
        change = Estimate(found.mean, Interval(found.low, found.high), before.size)
        return cls(float(before.mean()), float(after.mean()), change, found.range)


def meet(policy: TreePolicy, other: TreePolicy, arena: Arena, demand: Demand) -> Verdict:
    """Return how two policies do on the same fresh episodes; the margin plays no part."""
    before, after = (arena.run(tree, 0, demand.episodes) for tree in (policy, other))
    return Verdict.of(before, after, replace(demand, margin=0.0))


def play_rounded(
    exact: TreePolicy, rounded: TreePolicy, arena: Arena, episodes: int, margin: float | None
) -> RoundingPlayed:
    """Return what rounding changes in at most so many episodes, the same for both trees.

    It is not to be kept where it loses more than the margin, if there is one.
    """
    episodes = min(episodes, ROUNDED_EPISODES)
    one, other = (arena.run(tree, _ROUNDING_BLOCK, episodes) for tree in (exact, rounded))
    different = int(np.count_nonzero(one != other))
    before, after = float(one.mean()), float(other.mean())
    kept = margin is None or before - after <= margin
    return RoundingPlayed(episodes, different, before, after, kept)
