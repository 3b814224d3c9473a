"""The lowest and the highest return that an episode of an environment can have, where it is known.

An environment that knows it says so by an attribute ``return_range``, as eutree's own do. For
Gymnasium's own tasks it follows from their documented rewards and the time limit. It is not known
for others, and where a wrapper changes rewards.
"""

from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.wrappers import TransformReward

from eutree.errors import InvalidArgumentError


class _Rewards(NamedTuple):
    """Bounds of the reward of every step, and of what the last one adds."""

    low: float
    high: float
    last_low: float = 0.0
    last_high: float = 0.0


# By the name of the environment's class. Arguments that change rewards make the range unknown.
_REWARDS = {
    "CartPoleEnv": _Rewards(0.0, 1.0),
    "MountainCarEnv": _Rewards(-1.0, 0.0),
    "AcrobotEnv": _Rewards(-1.0, 0.0),
    "FrozenLakeEnv": _Rewards(0.0, 0.0, 0.0, 1.0),
    "CliffWalkingEnv": _Rewards(-100.0, -1.0),
    "TaxiEnv": _Rewards(-10.0, -1.0, 0.0, 21.0),
    "BlackjackEnv": _Rewards(0.0, 0.0, -1.0, 1.5),
}
_CHANGE_REWARDS = {"sutton_barto_reward", "reward_schedule"}


def return_range(env: gymnasium.Env[Any, Any]) -> tuple[float, float] | None:
    """Return the lowest and the highest undiscounted return of an episode; None if unknown.

    Raises:
        InvalidArgumentError: Its own ``return_range`` is not two ordered finite numbers.
    """
    inner = env
    while isinstance(inner, gymnasium.Wrapper):
        if isinstance(inner, gymnasium.RewardWrapper | TransformReward):
            return None
        inner = inner.env
    own = getattr(inner, "return_range", None)
    if own is not None:
        return _checked(own)
    return _documented(env, inner)


def _documented(
    env: gymnasium.Env[Any, Any], inner: gymnasium.Env[Any, Any]
) -> tuple[float, float] | None:
    """Return the range of one of Gymnasium's own tasks."""
    spec = env.spec
    rewards = _REWARDS.get(type(inner).__name__)
    if rewards is None or spec is None or not type(inner).__module__.startswith("gymnasium.envs."):
        return None
    if _CHANGE_REWARDS & set(spec.kwargs):
        return None
    steps = spec.max_episode_steps
    if steps is None:
        if rewards.low or rewards.high:
            return None
        steps = 1
    return (
        min(rewards.low, steps * rewards.low) + rewards.last_low,
        max(rewards.high, steps * rewards.high) + rewards.last_high,
    )


def _checked(own: object) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in own)  # type: ignore[attr-defined]  # refused below
    except (TypeError, ValueError):
        low = high = np.nan
    if not (np.isfinite((low, high)).all() and low <= high):
        raise InvalidArgumentError(
            "env's return_range must be the lowest and the highest return of an episode, "
            f"got {own!r}"
        )
    return low, high
