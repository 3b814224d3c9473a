"""The facts of an environment to be known before the first episode.

A user is told once, in a sentence, where observations are codes, where episodes may never end, and
where none repeats. Some promises rest on the returns that an episode can have.
"""

import random
import time
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from copy import deepcopy
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import wrappers

from eutree.errors import EutreeError, warn
from eutree.interaction.action_grid import (
    ActionMasks,
    GriddedAction,
    name_of,
    numbered,
    wrappers_of,
)
from eutree.interaction.decoding import warn_of_codes
from eutree.interaction.guard import MAX_EPISODE_STEPS
from eutree.interaction.making import made_here, make
from eutree.interaction.spaces import LEAVE_REWARDS, encoder, spec_of
from eutree.validation import check_range

CHECKED_STEPS = 200
CHECKED_SECONDS = 1.0  # of the first time; the second takes as many steps
_OWN_LIMITS = ("max_episode_steps", "_max_episode_steps", "max_steps")

Answer = tuple[bytes, str, bool, bool]  # the reward as text: a NaN is like another


def look_at(env: gymnasium.Env[Any, Any], seed: int | None) -> None:
    """Warn where observations are codes, where no time limit is named, and where none repeats.

    Nothing is done in the environment. Without a seed it was played before, and all this was said.
    """
    if seed is None:
        return
    warn_of_codes(env)
    if not is_limited(env):
        warn(
            f"{name_of(env)} names no time limit: an episode that it does not end itself is given "
            f"up after {MAX_EPISODE_STEPS:,} steps; --env-arg max_episode_steps=N sets one, or "
            "gymnasium.make(..., max_episode_steps=N)",
        )
    step = first_difference(env, seed)
    if step is not None:
        moment = "reset" if step == 0 else f"step {step}"
        warn(
            f"{name_of(env)} is not repeatable: played twice from seed {seed} with the same "
            f"actions, it differs from {moment} on, so nothing recorded or learned in it can be "
            "had again",
        )


def first_difference(env: gymnasium.Env[Any, Any], seed: int) -> int | None:
    """Return the step at which an episode goes otherwise the second time; None if none is seen.

    At most ``CHECKED_STEPS`` random actions are played in an environment made for it alone, so that
    ``env`` and the chance of this process are as before. None too where no such one can be made.
    """
    with _undisturbed():
        try:
            twin = _twin(env)
        except Exception:  # the run itself will report the error
            return None
        try:
            first, actions = _played(twin, seed)
            again, _ = _played(twin, seed, actions)
        except (Exception, SystemExit, GeneratorExit):
            return None
        finally:
            if spec_of(twin) is not None:  # a copy may share resources that it would close
                with suppress(Exception):
                    twin.close()
    differs = [one != other for one, other in zip(first, again, strict=False)]
    return differs.index(True) if True in differs else None


def _played(
    env: gymnasium.Env[Any, Any], seed: int, actions: Iterable[Any] | None = None
) -> tuple[list[Answer], list[Any]]:
    """Play an episode, or its beginning; return the answers and the actions taken."""
    encode, masks = encoder(env.observation_space), ActionMasks(env)
    observation, info = env.reset(seed=seed)
    answers = [(encode(observation).tobytes(), "", False, False)]
    taken: list[Any] = []
    generator = np.random.default_rng(seed)
    for action in _random_actions(env, seed) if actions is None else actions:
        allowed = masks.now(info) if actions is None else None
        if allowed is not None:
            number = int(generator.choice(np.flatnonzero(allowed)))
            inner = numbered(env)
            action = number if inner is env else cast(GriddedAction, inner).action(number)
        observation, reward, terminated, truncated, info = env.step(action)
        taken.append(action)
        earned = str(float(reward) + 0.0)
        answers.append((encode(observation).tobytes(), earned, bool(terminated), bool(truncated)))
        if terminated or truncated:
            break
    return answers, taken


def _random_actions(env: gymnasium.Env[Any, Any], seed: int) -> Iterator[Any]:
    """Yield random actions, as many as there is time for."""
    space = deepcopy(env.action_space)
    space.seed(seed)
    end = time.monotonic() + CHECKED_SECONDS
    for _ in range(CHECKED_STEPS):
        yield space.sample()
        if time.monotonic() > end:
            return


def _twin(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """Return another environment like this one: made alike, or copied where nothing says how."""
    spec = spec_of(env)
    if spec is not None:
        try:
            return make(spec)
        except EutreeError:  # of another module, or with arguments that only a user may choose
            pass
    return deepcopy(env)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Undo an environment's random draws, warnings and changes of folder in this process."""
    drawn, numpys = random.getstate(), np.random.get_state()  # noqa: NPY002 - to give it back
    try:
        with warnings.catch_warnings(), made_here():
            warnings.simplefilter("ignore")
            yield
    finally:
        random.setstate(drawn)
        np.random.set_state(numpys)  # noqa: NPY002 - as above


def is_limited(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether a wrapper, or by its own word the environment, ends each episode."""
    own = (getattr(env.unwrapped, name, None) for name in _OWN_LIMITS)
    return any(isinstance(wrapper, wrappers.TimeLimit) for wrapper in wrappers_of(env)) or any(
        isinstance(limit, int | np.integer) and limit > 0 for limit in own
    )


# The lowest and the highest return of an episode. An environment, or a wrapper of one's own, that
# knows them says so by an attribute ``return_range``, as eutree's own do. For Gymnasium's own tasks
# they follow from their documented rewards and the time limit. They are known only if every wrapper
# around is known to leave rewards alone, and episodes last as long as those that the range is of:
# cut short, an episode can have another return.


# Bounds of the reward of every step, and of the addition at the last one, by the name of the
# environment's class. Arguments that change rewards make the range unknown.
_REWARDS = {
    "CartPoleEnv": (0.0, 1.0, 0.0, 0.0),
    "MountainCarEnv": (-1.0, 0.0, 0.0, 0.0),
    "AcrobotEnv": (-1.0, 0.0, 0.0, 0.0),
    "FrozenLakeEnv": (0.0, 0.0, 0.0, 1.0),
    "CliffWalkingEnv": (-100.0, -1.0, 0.0, 0.0),
    "TaxiEnv": (-10.0, -1.0, 0.0, 21.0),
    "BlackjackEnv": (0.0, 0.0, -1.0, 1.5),
}
_CHANGE_REWARDS = {"sutton_barto_reward", "reward_schedule"}


def return_range(env: gymnasium.Env[Any, Any]) -> tuple[float, float] | None:
    """Return the lowest and the highest undiscounted return of an episode; None if unknown.

    Raises:
        InvalidArgumentError: Its own ``return_range`` is not two ordered finite numbers.
    """
    limits: list[int] = []  # of the wrappers passed, the outermost first
    inner = env
    # Has it a range of its own? Older wrappers hand on those of others.
    while vars(inner).get("return_range", getattr(type(inner), "return_range", None)) is None:
        if not isinstance(inner, gymnasium.Wrapper):
            return _documented(inner, limits)
        leaves = type(inner).step in LEAVE_REWARDS or "_derivation" in vars(inner)
        if not leaves or "step" in vars(inner):
            return None
        if isinstance(inner, wrappers.TimeLimit):
            limits.append(inner._max_episode_steps)
        inner = inner.env
    said = inner.return_range  # type: ignore[attr-defined]  # it says it
    own = check_range("env's return_range", said)
    registered = None if env.spec is None else gymnasium.registry.get(env.spec.id)
    usual = None if registered is None else registered.max_episode_steps
    return own if all(limit == usual for limit in limits) else None


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
    low, high, last_low, last_high = rewards
    steps = min(limits, default=None)
    if steps is None:
        if low or high:
            return None
        steps = 1
    return min(low, steps * low) + last_low, max(high, steps * high) + last_high
