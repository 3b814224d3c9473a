"""Wrappers that make any expert worse, as people are: careless or late."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.validation import check_integer, check_number, check_seed

Expert = Callable[[Any], Any]  # makes a policy (SB3's ``predict``) for an environment


class CarelessPolicy:
    """Takes a random action now and then.

    Args:
        policy: The careful policy.
        n_actions: Number of actions to choose from at random.
        probability: Share of decisions that are random.
        generator: Source of chance.
    """

    def __init__(
        self, policy: Any, n_actions: int, probability: float, generator: np.random.Generator
    ) -> None:
        self.reads_features = bool(getattr(policy, "reads_features", False))
        self._policy = policy
        self._n_actions = n_actions
        self._probability = probability
        self._generator = generator

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the policy's action, or a random one, for one observation or each of a batch."""
        actions, state = self._policy.predict(
            observation, state=state, episode_start=episode_start, deterministic=deterministic
        )
        shape = np.shape(actions)
        is_random = self._generator.random(shape) < self._probability
        return np.where(
            is_random, self._generator.integers(self._n_actions, size=shape), actions
        ), state


class LatePolicy:
    """Acts on what was to be seen some steps ago; what was decided first holds until then.

    The decisions under way are the policy's state: pass back what ``predict`` returned, as for
    a recurrent policy of Stable-Baselines3.

    Args:
        policy: The prompt policy.
        steps: Delay in steps.
    """

    def __init__(self, policy: Any, steps: int) -> None:
        self.reads_features = bool(getattr(policy, "reads_features", False))
        self._policy = policy
        self._steps = steps

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action decided ``steps`` steps ago, for one observation or each of a batch."""
        inner, pending = (None, None) if state is None else state
        chosen, inner = self._policy.predict(
            observation, state=inner, episode_start=episode_start, deterministic=deterministic
        )
        chosen = np.asarray(chosen)
        if pending is None:
            pending = np.broadcast_to(chosen, (self._steps, *chosen.shape))  # [steps, ...]
        elif episode_start is not None:
            pending = np.where(np.asarray(episode_start, dtype=np.bool_), chosen, pending)
        pending = np.concatenate([pending, chosen[None]])
        return pending[0], (inner, pending[1:])


def careless(expert: Expert, probability: float, *, seed: int = 0) -> Expert:
    """Return ``expert`` with a share of its decisions replaced by random actions.

    Args:
        expert: Makes a policy for an environment, as ``wait_at_crossing`` does.
        probability: Share of decisions that are random, in [0, 1].
        seed: Seed of the random actions.
    """
    share = check_number("probability", probability, low=0.0, high=1.0)
    check_seed(seed)

    def make(env: Any) -> CarelessPolicy:
        space = getattr(env, "single_action_space", env.action_space)
        return CarelessPolicy(expert(env), int(space.n), share, np.random.default_rng(seed))

    make.__name__ = f"careless({_name(expert)}, {share:g})"
    return make


def late(expert: Expert, steps: int) -> Expert:
    """Return ``expert`` with every decision delayed by ``steps`` steps."""
    delay = check_integer("steps", steps, low=0)

    def make(env: Any) -> LatePolicy:
        return LatePolicy(expert(env), delay)

    make.__name__ = f"late({_name(expert)}, {delay})"
    return make


def _name(expert: Expert) -> str:
    return str(getattr(expert, "__name__", type(expert).__name__))
