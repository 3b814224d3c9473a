"""Observations that are one code for several things, and the numbers behind it.

An environment such as Taxi observes one number, ``Discrete(500)``, that stands for row, column,
passenger and destination. A tree takes it for an ordered number, on which codes 99 and 100 are
neighbours although they have nothing in common. Where the environment itself can split a code
into its parts, by a method ``decode``, its observations become those parts, and a tree's tests
make sense; ``gymnasium.make`` knows no such argument, so ``make`` adds one: ``decode=True``.
With ``one_hot=True`` each value of a ``Discrete`` becomes a feature of its own, 1 or 0, of a group.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import FlattenObservation

from eutree.arrays import Integers
from eutree.errors import InvalidArgumentError, described, shown, warn
from eutree.interaction.action_grid import name_of, wrappers_of

DECODE = "decode"  # the argument of ``make``, as it stands in files
ONE_HOT = "one_hot"  # another one: each value of a Discrete becomes a feature of its own
MANY_CODES = 10  # of fewer values a tree separates each by a few tests
MAX_CODES = 100_000


class DecodedObservation(
    gymnasium.ObservationWrapper[Any, Any, Any], gymnasium.utils.RecordConstructorArgs
):
    """An environment whose observations are the parts of its codes, by its own ``decode``.

    Args:
        env: An environment that observes ``Discrete(n)`` and whose ``decode`` gives the whole
            numbers that a code stands for, as many for each code.

    Raises:
        InvalidArgumentError: It has no such observations or no such method.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        space = env.observation_space
        if not isinstance(space, spaces.Discrete) or not can_decode(env):
            raise InvalidArgumentError(
                f"an environment must observe one code (Discrete) and have a method decode to be "
                f"decoded, got {space} {'with' if can_decode(env) else 'without'} decode"
            )
        if space.n > MAX_CODES:
            raise InvalidArgumentError(f"at most {MAX_CODES:,} codes can be decoded, got {space.n}")
        self._first = int(space.start)
        self._meanings = _meanings(env, self._first, int(space.n))
        low, high = self._meanings.min(axis=0), self._meanings.max(axis=0)
        self.observation_space = spaces.MultiDiscrete(high - low + 1, start=low)

    def observation(self, observation: Any) -> Integers:
        """Return the numbers that a code stands for, shape [k]."""
        meaning: Integers = self._meanings[int(observation) - self._first]
        return meaning.copy()


def can_decode(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether the environment can split a code into its parts."""
    return callable(getattr(env.unwrapped, "decode", None))


def decodes(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether the environment's observations have been decoded."""
    return any(isinstance(wrapper, DecodedObservation) for wrapper in wrappers_of(env))


def one_hot_around(env: gymnasium.Env[Any, Any]) -> FlattenObservation[Any, Any, Any] | None:
    """Return Gymnasium's wrapper that flattens the observations; None if there is none."""
    seen = env.observation_space
    flattened = (one for one in wrappers_of(env) if isinstance(one, FlattenObservation))
    return next((one for one in flattened if one.observation_space == seen), None)


def warn_of_codes(env: gymnasium.Env[Any, Any]) -> None:
    """Warn where a tree is about to take a code for an ordered number, and name a remedy."""
    space = env.observation_space
    if not isinstance(space, spaces.Discrete) or space.n <= MANY_CODES:
        return
    helps = (
        "It can tell what its codes stand for: --decode, or "
        "eutree.interaction.DecodedObservation(env)."
        if can_decode(env)
        else "Let it observe what they stand for: gymnasium.wrappers.TransformObservation."
    )
    warn(
        f"{name_of(env)} observes one code of {space.n} values, which a tree takes for an ordered "
        f"number: neighbouring codes need not have anything in common. {helps}",
    )


def _meanings(env: gymnasium.Env[Any, Any], first: int, n: int) -> Integers:
    """Return the numbers that each code stands for, shape [n, k]."""
    decode: Any = env.unwrapped.decode  # type: ignore[attr-defined]  # checked by can_decode
    try:
        rows = [list(decode(first + code)) for code in range(n)]
        found = np.array(rows)
    except Exception as error:  # any error of the environment's author
        raise InvalidArgumentError(f"decode raised {described(error)}") from error
    if found.ndim != 2 or found.dtype.kind not in "iub" or len(np.unique(found, axis=0)) < n:
        raise InvalidArgumentError(
            f"decode must give as many whole numbers for each code, and others for each other "
            f"code, got {shown(rows[0])} for {first}"
        )
    return found.astype(np.int64)
