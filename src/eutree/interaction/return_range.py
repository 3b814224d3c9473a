"""The lowest and the highest return that an episode of an environment can have, where it is known.

An environment, or a wrapper of one's own, that knows it says so by an attribute ``return_range``,
as eutree's own do. For Gymnasium's own tasks it follows from their documented rewards and the time
limit. It is known only if every wrapper around is known to leave rewards alone, and episodes last
as long as those that the range is of: cut short, an episode can have another return.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import gymnasium
from gymnasium import wrappers

from eutree.validation import check_range


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


# The ways to step that hand on the reward of each step of the environment inside, and no other.
_LEAVE_REWARDS = frozenset(
    kind.step
    for kind in (
        gymnasium.Wrapper,
        gymnasium.ActionWrapper,
        gymnasium.ObservationWrapper,
        wrappers.FrameStackObservation,
        wrappers.HumanRendering,
        wrappers.OrderEnforcing,
        wrappers.PassiveEnvChecker,
        wrappers.RecordEpisodeStatistics,
        wrappers.RecordVideo,
        wrappers.RenderCollection,
        wrappers.TimeAwareObservation,
        wrappers.TimeLimit,
    )
)


def return_range(env: gymnasium.Env[Any, Any]) -> tuple[float, float] | None:
    """Return the lowest and the highest undiscounted return of an episode; None if unknown.

    Raises:
        InvalidArgumentError: Its own ``return_range`` is not two ordered finite numbers.
    """
    limits: list[int] = []  # of the wrappers passed, the outermost first
    inner = env
    while not _says_it(inner):
        if not isinstance(inner, gymnasium.Wrapper):
            return _documented(inner, limits)
        if type(inner).step not in _LEAVE_REWARDS or "step" in vars(inner):
            return None
        if isinstance(inner, wrappers.TimeLimit):
            limits.append(inner._max_episode_steps)
        inner = inner.env
    said = inner.return_range  # type: ignore[attr-defined]  # it says it
    own = check_range("env's return_range", said)
    return own if all(limit == _registered_limit(env) for limit in limits) else None


def _says_it(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether it has a range of its own; older wrappers hand on those of others."""
    own = vars(env).get("return_range", getattr(type(env), "return_range", None))
    return own is not None


def _registered_limit(env: gymnasium.Env[Any, Any]) -> int | None:
    """Return the steps after which episodes are cut short where nothing else is asked for."""
    registered = None if env.spec is None else gymnasium.registry.get(env.spec.id)
    return None if registered is None else registered.max_episode_steps


def _documented(
    inner: gymnasium.Env[Any, Any], limits: Iterable[int]
) -> tuple[float, float] | None:
    """Return the range of one of Gymnasium's own tasks, in episodes cut short by the limits."""
    spec = inner.spec
    rewards = _REWARDS.get(type(inner).__name__)
    if rewards is None or spec is None or not type(inner).__module__.startswith("gymnasium.envs."):
        return None
    if _CHANGE_REWARDS & set(spec.kwargs) or "step" in vars(inner):
        return None
    steps = min(limits, default=None)
    if steps is None:
        if rewards.low or rewards.high:
            return None
        steps = 1
    return (
        min(rewards.low, steps * rewards.low) + rewards.last_low,
        max(rewards.high, steps * rewards.high) + rewards.last_high,
    )
