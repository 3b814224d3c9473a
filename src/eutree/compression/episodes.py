"""Which episodes speak for a smaller tree: real ones, the same for every tree."""

import math
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.compression.playing import Ground
from eutree.compression.report import ROUNDED_EPISODES, RoundingPlayed
from eutree.contests import bounds_of_change
from eutree.contests.betting import TUNED
from eutree.contests.smallest import ATTEMPTS
from eutree.evaluation import Estimate, Interval, evaluate
from eutree.interaction import episode_seed
from eutree.interaction.deriving import acting_as
from eutree.interaction.first_look import return_range as known_range
from eutree.interaction.making import Environment, Recipe, made
from eutree.interaction.seeding import Stream
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.validation import check_integer, check_number, check_range


@dataclass(frozen=True, kw_only=True)
class Demand:
    """How sure one wants to be of what.

    Attributes:
        margin: How much lower than the input's the mean return may be.
        error: Chance that it is lower than that nevertheless.
        episodes: Most episodes of a tree in the choice, and in a confirmation.
        known_range: Lowest and highest return of an episode there can be; None takes the range of
            all returns seen, or ``blind_width`` if that is more, and then what is promised holds
            for losses within it.
    """

    margin: float
    error: float
    episodes: int
    known_range: tuple[float, float] | None = None

    @property
    def blind_width(self) -> float:
        """Half of the widest range of returns in which the margin could be confirmed at all.

        Losses that were not seen may be as large as this: the rule of three, read backwards.
        """
        return self.margin * self.episodes / (2 * -math.log(ATTEMPTS[0] * self.error * TUNED))


@dataclass(frozen=True)
class RealEpisodes:
    """Episodes in an environment, the same for every tree.

    Attributes:
        env: Where they run: an environment, its id, or how to make it.
        margin: Give the smallest tree whose mean return is not lower than the input's by more than
            this. That holds however rare its losses are, if the range of returns is known; else
            for losses within the range of all returns seen. None only evaluates the result beside
            the input.
        confidence: Of the decision about the margin, and of each end of the interval reported.
        episodes: Most episodes of each evaluation, and of each candidate before.
        return_range: Lowest and highest return of an episode, where the environment does not say
            so itself (``eutree.interaction.first_look``).
        n_jobs: Processes for the episodes, as ``evaluate`` takes them; the result is the same.
        evaluates: Whether the result is evaluated beside the input; else only rounding is played.
        searches: Whether the best tree of each size is looked for by playing; with a margin it is.

    Raises:
        InvalidArgumentError: One of them is not as described.
    """

    env: gymnasium.Env[Any, Any] | EnvironmentSpec | str
    margin: float | None = None
    confidence: float = 0.95
    episodes: int = 1000
    return_range: tuple[float, float] | None = None
    n_jobs: int | None = None
    evaluates: bool = True
    searches: bool = False

    def __post_init__(self) -> None:
        check_integer("episodes", self.episodes, low=2)
        check_number("confidence", self.confidence, low=0.5, high=1, low_open=True, high_open=True)
        if self.margin is not None:
            check_number("margin", self.margin, low=0.0)
        if self.return_range is not None:
            known = check_range("return_range", self.return_range)
            object.__setattr__(self, "return_range", known)

    def demand(self, env: gymnasium.Env[Any, Any]) -> Demand:
        """Return what a tree has to keep in the environment, which has been made."""
        return Demand(
            margin=self.margin or 0.0,
            error=1.0 - self.confidence,
            episodes=self.episodes,
            known_range=self.return_range or known_range(env),
        )


def as_real(env: "RealEpisodes | Environment | None") -> RealEpisodes | None:
    """Return the episodes that are meant: in an environment alone, smaller trees are searched."""
    if env is None or isinstance(env, RealEpisodes):
        return env
    return RealEpisodes(env, searches=True)


SEEN, OBSERVED = 2**42, 100  # the first start, and how many, where nothing was recorded
_ROUNDING_BLOCK = 1_000_000  # of starts, which no race comes to


def ground_of(env: Environment, policy: TreePolicy, seed: int, n_jobs: int | None) -> Ground:
    """Return where a policy's trees play: an environment, or what it is made from."""
    itself, spec = made(env, n_jobs)
    recipe = None if spec is None else Recipe.of(spec)
    return Ground(acting_as(itself, policy), seed, recipe, n_jobs)


def met_by(policy: TreePolicy, ground: Ground) -> Floats:
    """Return the features that a policy meets in some episodes, which are not counted, [N, d]."""
    starts = SEEN + np.arange(OBSERVED)
    return replace(ground).play([policy], np.zeros(OBSERVED, np.intp), starts)[1].features


def returns_of(policy: TreePolicy, ground: Ground, block: int, episodes: int) -> Floats:
    """Return the returns of a policy in a block of starts; the same for each policy."""
    seed = episode_seed(ground.seed, block, Stream.COMPRESSION)
    if ground.recipe is None:
        result = evaluate(policy, ground.env, episodes=episodes, seed=seed)
    else:
        spec, n_jobs = ground.recipe.spec, ground.n_jobs
        result = evaluate(policy, spec, episodes=episodes, seed=seed, n_jobs=n_jobs)
    ground.steps += result.steps
    return result.returns


@dataclass(frozen=True)
class Comparison:
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
    def of(cls, before: Floats, after: Floats, demand: Demand) -> "Comparison":
        """Return the verdict of the returns of two policies from common starts, [E] each."""
        table = np.stack([before, after])
        known = demand.known_range
        if known is None and demand.margin:  # losses that were not seen may be as large as this
            most = float(table.max())
            known = (min(float(table.min()), most - demand.blind_width), most)
        found = bounds_of_change(table, error=2 * demand.error, known=known)
        change = Estimate(found.mean, Interval(found.low, found.high), before.size)
        return cls(float(before.mean()), float(after.mean()), change, found.range)


def meet(policy: TreePolicy, other: TreePolicy, ground: Ground, demand: Demand) -> Comparison:
    """Return how two policies do on the same fresh episodes; the margin plays no part."""
    before, after = (returns_of(tree, ground, 0, demand.episodes) for tree in (policy, other))
    return Comparison.of(before, after, replace(demand, margin=0.0))


def play_rounded(
    exact: TreePolicy, rounded: TreePolicy, ground: Ground, episodes: int, margin: float | None
) -> RoundingPlayed:
    """Return what rounding changes in at most so many episodes, the same for both trees.

    It is not to be kept where it loses more than the margin, if there is one.
    """
    episodes = min(episodes, ROUNDED_EPISODES)
    one, other = (returns_of(tree, ground, _ROUNDING_BLOCK, episodes) for tree in (exact, rounded))
    different = int(np.count_nonzero(one != other))
    before, after = float(one.mean()), float(other.mean())
    kept = margin is None or before - after <= margin
    return RoundingPlayed(episodes, different, before, after, kept)
