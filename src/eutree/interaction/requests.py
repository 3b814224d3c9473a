"""Asking somebody to act for a stretch, in the middle of an episode.

Whoever learns pauses and describes the situation in a ``Request``; a ``Controller`` then acts by
``Stretch.step`` until the stretch is over or it hands back. It may also decline, by not acting.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.interaction.acting import Actor
from eutree.interaction.guard import GuardedEnv
from eutree.policies import Policy

HANDED_BACK, DECLINED = "handed back", "declined"

StepAnswer = tuple[Floats, float, bool, bool, dict[str, Any]]


@dataclass(frozen=True, eq=False)
class Request:
    """What is asked of a controller.

    Attributes:
        number: Number of the request, from 1.
        of: How many requests there may be.
        episode: Number of the episode, from 0.
        step: Number of its present step, from 0.
        reason: Why the learner asks, for people.
        observations: What was sensed in this episode so far; the last one is the present.
        max_steps: Most steps of the stretch.
        intended: Name of the action that the learner would take; "" if it is not known.
    """

    number: int
    of: int
    episode: int
    step: int
    reason: str
    observations: Floats  # [step + 1, d]
    max_steps: int
    intended: str = ""

    @property
    def text(self) -> str:
        """Why the learner asks, and what it would do."""
        return f"{self.reason} It would take {self.intended}." if self.intended else self.reason


class Stretch:
    """A stretch in which somebody else acts.

    Args:
        env: The environment as it stands, to be looked at; only ``step`` may change it.
        step: Takes one step with an action, and says whether the stretch is over by it.

    Attributes:
        env: The environment.
        n_steps: Steps taken in this stretch.
        is_over: Whether no further step may be taken.
    """

    def __init__(
        self, env: GuardedEnv, step: Callable[[int, int], tuple[StepAnswer, bool]]
    ) -> None:
        self.env = env
        self.n_steps = 0
        self.is_over = False
        self._step = step

    def step(self, action: int) -> StepAnswer:
        """Take one step; return observation, reward, terminated, truncated and info."""
        self.n_steps += 1
        answer, self.is_over = self._step(action, self.n_steps)
        return answer


@runtime_checkable
class Controller(Protocol):
    """Whoever can be asked."""

    def show(self, request: Request, stretch: Stretch) -> str:
        """Act until the stretch is over or this controller wants no more.

        Returns:
            ``HANDED_BACK`` or ``DECLINED``; it counts only if the stretch is not over.
        """
        ...

    def close(self) -> None:
        """Let go of whatever is open; there will be no further request."""
        ...


class ScriptedController:
    """Answers every request by a policy, which has watched the episode so far.

    A run with a policy whose actions follow from what it has sensed in the episode can be resumed
    to the same bytes; one with random numbers of its own cannot.

    Args:
        policy: What decides.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy

    def show(self, request: Request, stretch: Stretch) -> str:
        """Act until the stretch is over."""
        actor, action = Actor(self._policy, stretch.env), 0
        for observation in request.observations:
            action = actor.act(observation)
        while True:
            observation = stretch.step(action)[0]
            if stretch.is_over:
                return HANDED_BACK
            action = actor.act(observation)

    def close(self) -> None:
        """Do nothing."""


def controller_of(asked: Policy | Controller) -> Controller:
    """Return a controller, or the one that answers by a policy."""
    if isinstance(asked, Controller):
        return asked
    if hasattr(asked, "predict"):
        return ScriptedController(asked)
    raise InvalidArgumentError(f"ask must be a policy or a controller, got {asked!r}")
