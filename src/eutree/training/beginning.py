"""What a run begins with, where it acts, who follows it, and where its chance comes from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from eutree.compression.playing import Ground
from eutree.evaluation import Evaluation
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.seeding import Stream
from eutree.learners import Learner, Method, Problem, Start, Step
from eutree.learners.learner import ChoosesStarts
from eutree.policies import TreePolicy

if TYPE_CHECKING:
    from eutree.training.run import Run

Evaluator = Callable[[TreePolicy, int], Evaluation]  # (policy, seed) -> evaluation
Player = Callable[[TreePolicy, Sequence[int], int], Evaluation]  # (policy, starts, seed)


@dataclass(frozen=True, eq=False)
class Beginning:
    """What a run begins with: how is learned, what, and from where.

    Attributes:
        method: How is learned.
        problem: What is learned.
        start: Where learning begins.
        reason: Why this method, where nobody named one; else "".
    """

    method: Method
    problem: Problem
    start: Start
    reason: str = ""

    def learner(self) -> Learner:
        """Return the learner at its start."""
        return self.method.start(self.problem, self.start)


class Listener:
    """Follows a run, and may end it; a subclass has those of the methods that concern it."""

    def attached(self, run: "Run", env: gymnasium.Env[Any, Any] | None) -> None:
        """Take note of a run at its start, and of where it acts; None for recorded episodes."""

    def begins(self, run: "Run") -> None:
        """Take note that the run begins, or goes on from its checkpoint."""

    def wants_stop(self) -> bool:
        """Return whether the run is to end at its last finished episode; asked before each step."""
        return False

    def gathering_begins(self) -> None:
        """Take note that the first episode of a gathering phase, or the race, begins."""

    def step_taken(self, step: Step) -> bool:
        """Take note of a step; return False to end the run."""
        return True

    def gathering_ends(self) -> None:
        """Take note that an update follows, or that the race is over."""

    def advanced(self, run: "Run") -> None:
        """Take note of an episode, an update or an evaluation."""

    def ends(self) -> None:
        """Take note that the run is over."""

    def closes(self) -> None:
        """Let go of everything: the run is over, or has failed."""


@dataclass(frozen=True)
class Arena:
    """Where a run acts.

    Attributes:
        env: Where episodes are gathered and raced.
        evaluator: How to evaluate a frozen policy.
        play: How to play a frozen policy from some starts of an evaluation with a seed.
        ground: How to let many frozen policies play beside each other, from starts with a seed.
        return_range: Lowest and highest return of an episode; None where they are not known.
    """

    env: GuardedEnv
    evaluator: Evaluator
    play: Player
    ground: Callable[[int], Ground]
    return_range: tuple[float, float] | None = None


def generator_of(seed: int, stream: int, number: int) -> np.random.Generator:
    """Return the generator of one episode or update of a run."""
    return np.random.default_rng(np.random.SeedSequence((seed, stream, number)))


def seed_of_next(learner: Learner, seed: int, episode: int) -> int:
    """Return the seed of the next episode, or of the start at which a learner compares trees."""
    number = learner.next_start() if isinstance(learner, ChoosesStarts) else None
    if number is None:
        return episode_seed(seed, episode, Stream.TRAINING)
    return episode_seed(seed, number, Stream.COMPARING)
