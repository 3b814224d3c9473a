"""Run the races of :mod:`eutree.policy_search.racing` in an environment, block by block."""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.compression.playing import Ground
from eutree.compression.report import ROUNDED_EPISODES, RoundingPlayed
from eutree.evaluation import Estimate, Interval, evaluate
from eutree.interaction import episode_seed
from eutree.interaction.recipe import Environment, Recipe, made
from eutree.interaction.seeding import Stream
from eutree.policies import TreePolicy
from eutree.policy_search.racing import (
    Demand,
    Heat,
    Meeting,
    Returns,
    drive,
    meeting,
)
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

    def run(self, policy: TreePolicy, heat: Heat) -> Floats:
        """Return the returns of a policy in a heat; the same episodes for each policy."""
        seed = episode_seed(self.seed, heat.block, Stream.COMPRESSION)
        n = heat.episodes.stop
        if self.spec is None:
            result = evaluate(policy, self.env, episodes=n, seed=seed)
        else:
            result = evaluate(policy, self.spec, episodes=n, seed=seed, n_jobs=self.n_jobs)
        self.steps += result.steps
        return result.returns[heat.episodes.start :]


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
    def of(cls, met: Meeting) -> "Verdict":
        """Return the verdict of a meeting."""
        change = Estimate(
            float((met.after - met.before).mean()), Interval(met.low, met.high), met.after.size
        )
        return cls(float(met.before.mean()), float(met.after.mean()), change, met.range)


def meet(policy: TreePolicy, other: TreePolicy, arena: Arena, demand: Demand) -> Verdict:
    """Return how two policies do on the same fresh episodes; the margin plays no part."""
    both = (policy, other)
    returns = Returns(demand.known_range)
    alone = meeting(demand.error, demand.episodes, block=0, returns=returns)
    return Verdict.of(drive(alone, lambda heat: arena.run(both[heat.runner], heat)))


def play_rounded(
    exact: TreePolicy, rounded: TreePolicy, arena: Arena, episodes: int, margin: float | None
) -> RoundingPlayed:
    """Return what rounding changes in at most so many episodes, the same for both trees.

    It is not to be kept where it loses more than the margin, if there is one.
    """
    starts = range(min(episodes, ROUNDED_EPISODES))
    one, other = (
        arena.run(tree, Heat(number, _ROUNDING_BLOCK, starts))
        for number, tree in enumerate((exact, rounded))
    )
    different = int(np.count_nonzero(one != other))
    before, after = float(one.mean()), float(other.mean())
    kept = margin is None or before - after <= margin
    return RoundingPlayed(len(starts), different, before, after, kept)
