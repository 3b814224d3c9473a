"""Which episodes speak for a smaller tree: real ones, the same for every tree."""

import math
from dataclasses import dataclass
from typing import Any

import gymnasium

from eutree.contests.betting import TUNED
from eutree.contests.smallest import ATTEMPTS
from eutree.interaction.recipe import Environment
from eutree.interaction.return_range import return_range as known_range
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
            so itself (``eutree.interaction.return_range``).
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
