"""A policy acting in one environment, step by step.

Trees and scripted experts read the environment's features (``GuardedEnv.schema``). Any other
policy, for example a model of Stable-Baselines3, was made for the environment's own observation
and gets that: the integer of a Discrete space, the dict of a Dict space, a Box in its own dtype.
"""

from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.interaction.guard import GuardedEnv
from eutree.policies import Policy


class Actor:
    """Decides at each step of an episode, and carries the policy's state from one to the next.

    Args:
        policy: What decides; its ``predict`` is called by keyword, as Stable-Baselines3 does.
        env: Where it acts.
        deterministic: Passed to ``predict``.
    """

    def __init__(self, policy: Policy, env: GuardedEnv, *, deterministic: bool = True) -> None:
        self._policy = policy
        self._deterministic = deterministic
        self._own = not getattr(policy, "reads_features", False)
        self._env = env
        self.start()

    def start(self) -> None:
        """Begin an episode: the next observation is its first."""
        self._state: Any = None
        self._first = True

    @property
    def remembers(self) -> bool:
        """Whether the policy carries something from one step to the next."""
        return self._state is not None

    def act(self, observation: Floats) -> int:
        """Return the action at an observation as ``GuardedEnv`` gives it, shape [d].

        Raises:
            InvalidArgumentError: The policy did not answer with one whole number.
        """
        seen = self._env.own_observation(observation) if self._own else observation
        chosen, self._state = self._policy.predict(
            seen,
            state=self._state,
            episode_start=np.array(self._first),
            deterministic=self._deterministic,
        )
        self._first = False
        return _action(chosen)


def _action(chosen: Any) -> int:
    """Return the one action that ``predict`` answered with; SB3 wraps it in an array."""
    answer = np.asarray(chosen)
    number = answer.reshape(-1)[0] if answer.size == 1 and answer.dtype.kind in "iubf" else None
    if number is None or number != np.floor(number):
        raise InvalidArgumentError(
            "policy.predict must return one action, a whole number, for one observation, "
            f"got {chosen!r}"
        )
    return int(number)
