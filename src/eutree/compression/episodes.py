"""The episodes that speak for a smaller tree, and the report of a compression's changes.

The episodes are real ones, the same for every tree.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import msgspec
import numpy as np

from eutree.arrays import Floats
from eutree.compression.playing import Ground, Outcome
from eutree.contests import bounds_of_change
from eutree.contests.betting import TUNED
from eutree.contests.smallest import ATTEMPTS
from eutree.evaluation import Estimate, Interval, evaluate
from eutree.interaction import episode_seed
from eutree.interaction.deriving import acting_for
from eutree.interaction.episode import Stream
from eutree.interaction.first_look import return_range as known_range
from eutree.interaction.making import Environment, Recipe, made
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.validation import check_integer, check_measures, check_number, check_range

ROUNDED_EPISODES = 200  # that measure the effect of rounding, at most
SUCCESS = 0.005  # that a tree may succeed less often


@dataclass(frozen=True)
class RoundingPlayed:
    """The effect of rounded thresholds, in the same episodes with the exact ones."""

    episodes: int  # how many were played
    different: int  # those with another return
    exact: float  # mean return with the exact thresholds
    rounded: float  # mean return with the rounded ones
    # Whether the result is rounded; not where that loses more than the margin allows
    kept: bool = True


_EARNED: dict[str, Any] = {
    "mean_return": float,
    "return_interval": Interval,
    "success_rate": float | None,
    "success_interval": Interval | None,
}


@dataclass(frozen=True)
class FrontEntry:
    """A tree of a front, and its result in episodes that chose nothing.

    Attributes:
        policy: The tree of this size.
        mean_return: Mean of the undiscounted returns of these episodes.
        return_interval: 95 % interval of that.
        success_rate: Share of successes; None where none are reported.
        success_interval: 95 % interval of that.
    """

    policy: TreePolicy
    mean_return: float
    return_interval: Interval
    success_rate: float | None
    success_interval: Interval | None

    @classmethod
    def of(cls, policy: TreePolicy, outcome: Outcome) -> "FrontEntry":
        """Return the entry of a tree that earned this."""
        return cls(policy, **{name: getattr(outcome, name) for name in _EARNED})

    def facts(self, path: str | None = None) -> dict[str, Any]:
        """Return the entry in JSON's types; ``path`` is where its tree was written, if it was."""
        earned = {name: getattr(self, name) for name in _EARNED}
        return {"n_leaves": self.policy.n_leaves, **msgspec.to_builtins(earned), "path": path}

    @classmethod
    def from_facts(cls, policy: TreePolicy, facts: dict[str, Any]) -> "FrontEntry":
        """Take back ``facts()`` of a tree."""
        earned = {name: msgspec.convert(facts[name], kind) for name, kind in _EARNED.items()}
        return cls(policy, **earned)


@dataclass(frozen=True)
class CompressionReport:
    """The changes by a compression.

    Attributes:
        n_leaves_before: Leaves of the input.
        n_leaves_after: Leaves of the result.
        agreement: Share of the recorded observations on which both decide the same.
        disagreement_volume: Exact share of the observations that can be on which they decide
            differently: in a box, the environment's, or the recorded data's where that is
            unbounded, in which whole values and categories are counted.
        method: Which tree was kept: ``"merge"``, ``"drop"`` (tests that all recorded
            observations answer alike), ``"lossless"``, ``"paper"``, ``"budget"``, ``"return"``,
            ``"monotone"`` or ``"imagined"``.
        weighted_disagreement: Cost of the changed decisions, as a share of the worst; with
            ``weights="visits"`` the share of recorded observations decided differently.
        environment_steps: Steps of all episodes run, in choosing and in confirming.
        mean_return_before: Mean return of the input on fresh episodes; None without environment.
        mean_return_after: Mean return of the result on the same episodes.
        return_change: Mean of after minus before, with bounds that hold for any returns within
            ``return_range``; each is wrong with probability 1 - confidence at most.
        return_range: Lowest and highest return of an episode.
        range_known: Whether that range is known, or else only the range of all returns seen.
        episodes_needed: How many episodes could have confirmed the margin at best, where those
            allowed were too few for any tree; else None.
        imagined: Scores of the input and of the result in a world model, pessimistic mean returns;
            None where there is none.
        rounding: The effect of rounding in play; None where nothing was rounded, where there is no
            environment, or where the rounded tree won a race against the input itself.
        by: The grounds of the choice: ``"episodes"`` of the environment, a world ``"model"``, or
            ``"labels"``, the decisions at recorded observations.
        front: The input and the best tree of each size, the largest first, all in the same
            episodes; empty unless episodes chose.
    """

    n_leaves_before: int
    n_leaves_after: int
    agreement: float
    disagreement_volume: float
    method: str
    weighted_disagreement: float = 0.0
    environment_steps: int = 0
    mean_return_before: float | None = None
    mean_return_after: float | None = None
    return_change: Estimate | None = None
    return_range: tuple[float, float] | None = None
    range_known: bool = False
    episodes_needed: int | None = None
    imagined: tuple[float, float] | None = None
    rounding: RoundingPlayed | None = None
    by: str = "labels"
    front: tuple[FrontEntry, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Demand:
    """Which tree of a front is handed back, and how sure one wants to be of it.

    Attributes:
        episodes: Most episodes of a tree in the choice, and in a confirmation.
        margin: How much lower than the input's the mean return may be: the smallest that is shown
            to keep that is handed back. None for the smallest within one standard error of the
            best.
        error: Chance that it is lower than that nevertheless.
        known_range: Lowest and highest return of an episode there can be; None takes the range of
            all returns seen, or ``blind_width`` if that is more, and then the promise holds for
            losses within it.
        max_leaves: Most leaves: the best of at most so many instead; None for no limit.
        floor: A tree than which the pick may not succeed less often, as long as any tree of the
            front, of so many leaves, does not; None for the input.
        success_margin: By how much it may, all the same: that much is no difference.
    """

    episodes: int
    margin: float | None = None
    error: float = 0.05
    known_range: tuple[float, float] | None = None
    max_leaves: int | None = None
    floor: TreePolicy | None = None
    success_margin: float = SUCCESS

    @property
    def blind_width(self) -> float:
        """Half of the widest range of returns in which the margin could be confirmed at all.

        Losses that were not seen may be as large as this: the rule of three, read backwards.
        """
        confirmed = self.episodes / (2 * -math.log(ATTEMPTS[0] * self.error * TUNED))
        return (self.margin or 0.0) * confirmed


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
        episodes: Most episodes of each evaluation, and of each tree before.
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
        check_measures(self, "margin", low=0.0)
        if self.return_range is not None:
            object.__setattr__(self, "return_range", check_range("return_range", self.return_range))

    def demand(self, env: gymnasium.Env[Any, Any], max_leaves: int | None) -> Demand:
        """Return which tree is wanted of those that play in the environment, once it is made."""
        return Demand(
            episodes=self.episodes,
            margin=self.margin,
            error=1.0 - self.confidence,
            known_range=self.return_range or known_range(env),
            max_leaves=max_leaves,
        )


SEEN, OBSERVED = 2**42, 100  # the first start, and how many, where nothing was recorded
_ROUNDING_BLOCK = 1_000_000  # of starts, which no race comes to


def ground_of(env: Environment, policy: TreePolicy, seed: int, n_jobs: int | None) -> Ground:
    """Return the ground on which a policy's trees play: an environment, or how to make it."""
    itself, spec = made(env, n_jobs)
    recipe = None if spec is None else Recipe.of(spec)
    return Ground(acting_for(itself, policy, "policy"), seed, recipe, n_jobs)


def met_by(policy: TreePolicy, ground: Ground) -> Floats:
    """Return the features that a policy meets in some episodes, which are not counted, [N, d]."""
    starts = SEEN + np.arange(OBSERVED)
    return replace(ground).play([policy], np.zeros(OBSERVED, np.intp), starts)[1].features


def returns_of(policy: TreePolicy, ground: Ground, block: int, episodes: int) -> Floats:
    """Return the returns of a policy in a block of starts; the same for each policy."""
    seed = episode_seed(ground.seed, block, Stream.COMPRESSION)
    recipe = ground.recipe
    where, n_jobs = (ground.env, None) if recipe is None else (recipe.spec, ground.n_jobs)
    result = evaluate(policy, where, episodes=episodes, seed=seed, n_jobs=n_jobs)
    ground.steps += result.steps
    return result.returns


@dataclass(frozen=True)
class Comparison:
    """Two policies on the same fresh episodes."""

    mean_return_before: float  # of the input
    mean_return_after: float  # of the other policy
    return_change: Estimate  # after minus before; its bounds hold for all returns in the range
    return_range: tuple[float, float]  # lowest and highest return, as known or as seen
    range_known: bool  # what was seen may refute what was known

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
        is_known = demand.known_range is not None and found.known
        return cls(float(before.mean()), float(after.mean()), change, found.range, is_known)


def meet(policy: TreePolicy, other: TreePolicy, ground: Ground, demand: Demand) -> Comparison:
    """Return how two policies do on the same fresh episodes; the margin plays no part."""
    before, after = (returns_of(tree, ground, 0, demand.episodes) for tree in (policy, other))
    return Comparison.of(before, after, replace(demand, margin=None))


def play_rounded(
    exact: TreePolicy, rounded: TreePolicy, ground: Ground, episodes: int, margin: float | None
) -> RoundingPlayed:
    """Return the effect of rounding in at most so many episodes, the same for both trees.

    It is not to be kept where it loses more than the margin, if there is one.
    """
    episodes = min(episodes, ROUNDED_EPISODES)
    one, other = (returns_of(tree, ground, _ROUNDING_BLOCK, episodes) for tree in (exact, rounded))
    different = int(np.count_nonzero(one != other))
    before, after = float(one.mean()), float(other.mean())
    kept = margin is None or before - after <= margin
    return RoundingPlayed(episodes, different, before, after, kept)
