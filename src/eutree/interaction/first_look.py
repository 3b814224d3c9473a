"""What a user ought to know of an environment before the first episode, said once in a sentence."""

import random
import time
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.wrappers import TimeLimit

from eutree.errors import EutreeError
from eutree.interaction.action_grid import ActionMasks, GriddedAction, numbered
from eutree.interaction.decoding import warn_of_codes
from eutree.interaction.guard import MAX_EPISODE_STEPS
from eutree.interaction.making import made_here, make
from eutree.interaction.spaces import encoder, spec_of

CHECKED_STEPS = 200
CHECKED_SECONDS = 1.0  # of the first time; the second takes as many steps
_OWN_LIMITS = ("max_episode_steps", "_max_episode_steps", "max_steps")

Answer = tuple[bytes, float, bool, bool]


def look_at(env: gymnasium.Env[Any, Any], seed: int | None) -> None:
    """Warn where observations are codes, where episodes may never end, and where none repeats.

    Args:
        env: The environment; nothing is done in it.
        seed: Seed of the first episode; None where it was played before, and all this was said.
    """
    if seed is None:
        return
    warn_of_codes(env, stacklevel=3)
    if not is_limited(env):
        warnings.warn(
            f"{_name(env)} has no time limit: an episode that does not end by itself is given up "
            f"after {MAX_EPISODE_STEPS:,} steps; --env-arg max_episode_steps=N sets one, or "
            "gymnasium.make(..., max_episode_steps=N)",
            stacklevel=3,
        )
    step = first_difference(env, seed)
    if step is not None:
        moment = "reset" if step == 0 else f"step {step}"
        warnings.warn(
            f"{_name(env)} is not repeatable: played twice from seed {seed} with the same actions, "
            f"it differs from {moment} on, so nothing recorded or learned in it can be had again",
            stacklevel=3,
        )


def first_difference(env: gymnasium.Env[Any, Any], seed: int) -> int | None:
    """Return the step at which an episode goes otherwise the second time; None if none is seen.

    At most ``CHECKED_STEPS`` random actions are played in an environment made for it alone, so that
    ``env`` and the chance of this process are as before. None too where no such one can be made.
    """
    with _undisturbed():
        try:
            twin = _twin(env)
        except Exception:  # the run itself will say what is wrong
            return None
        try:
            first, actions = _played(twin, seed)
            again, _ = _played(twin, seed, actions)
        except (Exception, SystemExit, GeneratorExit):
            return None
        finally:
            _close(twin)
    differs = [one != other for one, other in zip(first, again, strict=False)]
    return differs.index(True) if True in differs else None


def _played(
    env: gymnasium.Env[Any, Any], seed: int, actions: Iterable[Any] | None = None
) -> tuple[list[Answer], list[Any]]:
    """Play an episode, or its beginning; return the answers and the actions taken."""
    encode, masks = encoder(env.observation_space), ActionMasks(env)
    observation, info = env.reset(seed=seed)
    answers = [(encode(observation).tobytes(), 0.0, False, False)]
    taken: list[Any] = []
    generator = np.random.default_rng(seed)
    for action in _random_actions(env, seed) if actions is None else actions:
        allowed = masks.now(info) if actions is None else None
        if allowed is not None:
            number = int(generator.choice(np.flatnonzero(allowed)))
            action = _own_action(env, number)
        observation, reward, terminated, truncated, info = env.step(action)
        taken.append(action)
        answers.append(
            (encode(observation).tobytes(), float(reward), bool(terminated), bool(truncated))
        )
        if terminated or truncated:
            break
    return answers, taken


def _own_action(env: gymnasium.Env[Any, Any], number: int) -> Any:
    """Return the action of a number as the environment takes it."""
    inner = numbered(env)
    return number if inner is env else cast(GriddedAction, inner).action(number)


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
        except EutreeError:  # of another module, or with what only a user may choose
            pass
    return deepcopy(env)


def _close(env: gymnasium.Env[Any, Any]) -> None:
    """Close an environment that was made here; a copy may share what it would close."""
    if spec_of(env) is not None:
        try:
            env.close()
        except Exception:
            return


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Keep to itself what an environment draws from the process's chance, warns of, or goes to."""
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
    inner = env
    while isinstance(inner, gymnasium.Wrapper):
        if isinstance(inner, TimeLimit):
            return True
        inner = inner.env
    own = (getattr(inner, name, None) for name in _OWN_LIMITS)
    return any(isinstance(limit, int | np.integer) and limit > 0 for limit in own)


def _name(env: gymnasium.Env[Any, Any]) -> str:
    return env.spec.id if env.spec is not None else type(env.unwrapped).__name__
