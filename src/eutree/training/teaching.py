"""A teacher of one's own, whom trees copy: a model of Stable-Baselines3, a large tree, a script."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.features import GreedyPolicy
from eutree.interaction import GuardedEnv
from eutree.interaction.acting import Actor, Controller, as_policy, trained_steps, values_of
from eutree.policies import TreePolicy
from eutree.validation import check_amounts


@dataclass(frozen=True, eq=False)
class Teacher:
    """Who teaches a learner that copies a teacher, in place of the network that it would train.

    Attributes:
        policy: As ``eutree.record`` takes it, if it decides by one observation alone: anything with
            SB3's ``predict``, or a function.
        steps: Environment steps in which it was trained, by your word; by its own where it counts
            them itself (``num_timesteps``, as models of SB3 do) and None is given. They are
            reported apart from those of the run, and are no part of its budget.
        action_values: Its value of each action, from observations [N, d] to [N, A]. By default its
            method of that name; without any all wrong actions count alike, and VIPER's weights say
            nothing. With values the action of the largest one counts, not that of ``predict``.
    """

    policy: Controller
    steps: int | None = None
    action_values: Callable[[Floats], ArrayLike] | None = None

    def __post_init__(self) -> None:
        if self.steps is None and trained_steps(self.policy) is None:
            raise InvalidArgumentError(
                "steps must say in how many environment steps the teacher was trained, which it "
                "does not know itself (num_timesteps), got None"
            )
        check_amounts(self, steps=0)

    @property
    def cost(self) -> int:
        """Environment steps in which it was trained, by your word or its own."""
        own = trained_steps(self.policy) if self.steps is None else self.steps
        return 0 if own is None else own

    def name(self) -> str:
        """Return the name that tells it from another in a run's configuration; "" cannot be."""
        kind = getattr(self.policy, "__name__", type(self.policy).__name__)
        if isinstance(self.policy, TreePolicy):
            kind = hashlib.sha256(self.policy.to_bytes()).hexdigest()
        return f"{kind}, {self.cost} steps"


class AskedTeacher(GreedyPolicy):
    """A teacher of one's own as a learner sees it, who senses the environment's features."""

    def __init__(self, teacher: Teacher, env: GuardedEnv) -> None:
        policy = as_policy(teacher.policy, env.env)
        self._n_actions = env.schema.n_actions
        self._actor = Actor(policy, env)
        self._values = values_of(policy, self._n_actions, teacher.action_values)

    def action_values(self, observations: Floats) -> Floats:
        """Return its values at observations [N, d], shape [N, A]; or 1 for its action.

        Raises:
            InvalidArgumentError: Its answer is not as it must be.
        """
        if self._values is not None:
            return self._values(observations)
        return np.eye(self._n_actions)[[self._decision(row) for row in observations]]

    def _decision(self, observation: Floats) -> int:
        """Return its action at one observation [d]."""
        self._actor.start()
        action = self._actor.act(observation)
        if self._actor.remembers:
            raise InvalidArgumentError(
                "teacher must decide by one observation alone, got one whose predict returns a "
                "state: what it would do depends on how it came there"
            )
        if not 0 <= action < self._n_actions:
            raise InvalidArgumentError(
                f"teacher must return an action from 0 to {self._n_actions - 1}, got {action}"
            )
        return action


def as_teacher(given: "Teacher | None", env: GuardedEnv | None) -> AskedTeacher | None:
    """Return a teacher as a learner sees it.

    Raises:
        InvalidArgumentError: It is no ``Teacher``, or there is nowhere to ask it.
    """
    if given is None:
        return None
    if not isinstance(given, Teacher):
        raise InvalidArgumentError(
            "teacher must be eutree.Teacher(policy, steps=...), which says what its training "
            f"cost, got {given!r}"
        )
    if env is None:
        raise InvalidArgumentError("teacher must be None without an environment to act in")
    return AskedTeacher(given, env)
