"""How another process makes an environment that only this one may have registered and named."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import gymnasium

from eutree.errors import InvalidArgumentError, shown
from eutree.interaction.making import make
from eutree.interaction.names import Names, given_names, named
from eutree.parallel import Workers
from eutree.schema import EnvironmentSpec

Environment = gymnasium.Env[Any, Any] | EnvironmentSpec | str  # one, how to make it, its id


@dataclass(frozen=True)
class Recipe:
    """All that it takes to make an environment in another process.

    Attributes:
        spec: How it is made.
        registered: What Gymnasium's registry holds of its id; None if its id names a module.
        names: What its features and actions are called there, if a file says so.
    """

    spec: EnvironmentSpec
    registered: Any
    names: Names | None

    @classmethod
    def of(cls, spec: EnvironmentSpec | str) -> "Recipe":
        """Return how to make what ``make`` makes here and now.

        Raises:
            InvalidArgumentError: It is neither an id nor an ``EnvironmentSpec``.
        """
        if not isinstance(spec, EnvironmentSpec | str):
            raise InvalidArgumentError(
                "environment must be an id or an EnvironmentSpec, of which each process makes its "
                f"own, got {shown(spec)}"
            )
        spec = EnvironmentSpec(spec) if isinstance(spec, str) else spec
        return cls(spec, gymnasium.registry.get(spec.id), given_names())

    def make(self) -> gymnasium.Env[Any, Any]:
        """Return the environment, in whichever process this is."""
        if self.registered is not None:
            gymnasium.registry.setdefault(self.spec.id, self.registered)
        if self.names is None:
            return make(self.spec)
        with named(self.names):
            return make(self.spec)


def made(
    env: Environment, n_jobs: int | None
) -> tuple[gymnasium.Env[Any, Any], EnvironmentSpec | None]:
    """Return the environment itself, and how other processes make it if they are to.

    Raises:
        InvalidArgumentError: It is no environment, or other processes are to make one that is made
            already.
    """
    if not isinstance(env, gymnasium.Env | EnvironmentSpec | str):
        raise InvalidArgumentError(
            f"env must be a gymnasium.Env, an id or an EnvironmentSpec, got {shown(env)}"
        )
    if isinstance(env, gymnasium.Env):
        if n_jobs not in (None, 1):
            raise InvalidArgumentError(
                "env must be an id or an EnvironmentSpec, of which each of n_jobs processes makes "
                "its own, got one that is made already"
            )
        return env, None
    spec = EnvironmentSpec(env) if isinstance(env, str) else env
    return make(spec), spec if Workers(n_jobs).count > 1 else None


@contextmanager
def opened(env: Environment) -> Iterator[gymnasium.Env[Any, Any]]:
    """Yield an environment as it is, or one that is made here and closed in the end."""
    opened = made(env, None)[0]
    try:
        yield opened
    finally:
        if opened is not env:
            opened.close()
