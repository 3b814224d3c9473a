"""Make an environment from its id, with errors that a user can act on.

A file of demonstrations or of a policy names the environment it is of, and says how it was made. It
may come from a stranger, and the registry holds environments that import, load or open whatever
their arguments name. So a file may choose only parameters that the environment's own constructor
names, never ``render_mode``, and no text that could be the name of a file, a module or an address.
"""

import inspect
import os
import re
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import gymnasium
from gymnasium.envs.registration import load_env_creator
from gymnasium.error import Error as GymnasiumError
from gymnasium.wrappers import FlattenObservation

from eutree.errors import (
    EutreeError,
    InvalidArgumentError,
    MissingExtraError,
    UnknownNameError,
    shown,
)
from eutree.interaction.action_grid import ACTION_GRID, with_grid
from eutree.interaction.decoding import DECODE, ONE_HOT, DecodedObservation, decodes, one_hot_around
from eutree.interaction.names import Names, given_names, named
from eutree.interaction.spaces import is_matrix
from eutree.parallel import Workers
from eutree.schema import EnvironmentSpec
from eutree.validation import check_kind
from eutree.zoo import PREFIX, module_of

_FOLDERS: "WeakKeyDictionary[gymnasium.Env[Any, Any], str]" = WeakKeyDictionary()


@contextmanager
def made_here() -> Iterator[list[gymnasium.Env[Any, Any]]]:
    """Come back to the working folder; the environments put into the list stay where they went."""
    made: list[gymnasium.Env[Any, Any]] = []
    ours = folder()
    try:
        yield made
    finally:
        there = folder()
        if there != ours:
            os.chdir(ours)
            _FOLDERS.update({env.unwrapped: there for env in made})


class OwnFolder:
    """The working folder of one environment, which is that of the process until it is changed."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        self._theirs = _FOLDERS.get(env.unwrapped, "")
        self._ours = ""

    def __enter__(self) -> None:
        self._ours = folder()
        if self._theirs:
            os.chdir(self._theirs)

    def __exit__(self, *exception: object) -> None:
        there = folder()
        self._theirs = "" if there == self._ours else there
        if self._theirs and self._ours:
            os.chdir(self._ours)


def folder() -> str:
    """Return the working folder; "" where it was deleted."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return ""


_IMPORT = "One of your own is known once its module is imported: --import MODULE."
# How an environment is observed and acted in, not which one it is.
MANNER = frozenset({DECODE, ONE_HOT, ACTION_GRID})
# Those of gymnasium.make, and ours.
MAKE_ARGUMENTS = MANNER | {"max_episode_steps", "disable_env_checker"}
_NAMES_A_PLACE = re.compile(r"[.:/\\]")


def make(spec: EnvironmentSpec | str, *, render_mode: str | None = None) -> gymnasium.Env[Any, Any]:
    """Return ``gymnasium.make`` of an id or a spec, with the names that are given now.

    The argument ``decode=True``, unless the environment has one of that name itself, makes its
    observations the parts of its codes; see ``DecodedObservation``. With ``one_hot=True`` each
    value of a ``Discrete`` is a feature of its own, as it is asked for of a matrix of numbers, to
    lay it out in a row. With ``action_grid=...`` its actions are combinations of the levels named
    there; see ``GriddedAction``. An environment that decodes, is flat, or has that grid, itself is
    left as it is.

    Raises:
        UnknownNameError: No environment of that id is registered; names the nearest.
        InvalidArgumentError: The environment cannot be made: it does not take these arguments, a
            file chose an argument that only a user may, it raises, or the module that its id names
            before a colon cannot be imported.
        MissingExtraError: The environment needs a package that is not installed.
    """
    spec = check_kind(
        "spec", EnvironmentSpec(spec) if isinstance(spec, str) else spec, EnvironmentSpec
    )
    _check_known(spec.id)
    arguments = dict(spec.arguments)
    if render_mode is not None:
        arguments["render_mode"] = render_mode
    try:
        _check_chosen_by_file(spec)
        ours = MANNER - _own_arguments(spec.id).keys()
        taken = {name: arguments.pop(name) for name in ours & arguments.keys()}
        with made_here() as made:
            env = gymnasium.make(spec.id, **arguments)
            made.append(env)
        if taken.get(DECODE) and not decodes(env):
            env = DecodedObservation(env)
        if taken.get(ONE_HOT, is_matrix(env.observation_space)) and one_hot_around(env) is None:
            env = FlattenObservation(env)
        if taken.get(ACTION_GRID) is not None:
            env = with_grid(env, taken[ACTION_GRID])
    except EutreeError:
        raise
    except ModuleNotFoundError as error:
        raise InvalidArgumentError(f"cannot make {spec}: {error.__cause__ or error}") from error
    except gymnasium.error.DependencyNotInstalled:
        raise MissingExtraError(f"a package that {spec.id} needs", "envs") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # any error of the environment's author
        raise InvalidArgumentError(f"cannot make {spec}: {_reason(error)}") from error
    names = given_names()
    return env if names is None else names.give(env)


def _check_chosen_by_file(spec: EnvironmentSpec) -> None:
    """Raise InvalidArgumentError for an argument that no file may choose; see the module."""
    if not spec.from_file:
        return
    own = _own_arguments(spec.id)
    allowed = (own.keys() | MAKE_ARGUMENTS) - {"render_mode"}
    for name in sorted(spec.from_file):
        value = spec.arguments[name]
        if name not in allowed:
            what = f"is none of its own: {', '.join(sorted(allowed))}"
        elif name == ACTION_GRID and name not in own:
            continue  # no environment sees the texts in it
        elif any(map(_NAMES_A_PLACE.search, _texts(value))) and value != own.get(name):
            what = f"could name a file or a module: {shown(value)}"
        else:
            continue
        raise InvalidArgumentError(
            f"no file may choose the argument {name!r} of {spec.id}, which {what}; "
            f"choose it yourself if you trust it: --env-arg {name}=..."
        )


def _own_arguments(name: str) -> dict[str, Any]:
    """Return the arguments that an environment's constructor names, with their usual values."""
    registered = gymnasium.registry.get(name)
    if registered is None:  # of a module that is still to be imported
        return {}
    creator: Any = registered.entry_point
    creator = load_env_creator(creator) if isinstance(creator, str) else creator
    named = inspect.signature(creator).parameters.values()
    own = {p.name: p.default for p in named if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}
    return own | registered.kwargs


def _texts(value: Any) -> Iterator[str]:
    """Yield every text inside nested lists and dicts."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield key
            yield from _texts(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)


def _reason(error: BaseException) -> str:
    """Return the first line of an error; its type too where that is informative."""
    try:
        first = str(error).strip().partition("\n")[0]
    except Exception:  # of its own ``__str__``
        first = ""
    known = isinstance(error, TypeError | ValueError | AssertionError | GymnasiumError)
    kind = type(error).__name__
    return (first if known else f"{kind}: {first}") if first else kind


def _check_known(name: str) -> None:
    """Raise unless ``name`` is registered, or may be once the module before its colon is."""
    if name.startswith(PREFIX):
        raise InvalidArgumentError(f"{name} is a tree of the zoo; its task is {name.split(':')[1]}")
    module, colon, _ = name.partition(":")
    if colon:
        if not all(part.isidentifier() for part in module.split(".")):
            raise InvalidArgumentError(
                f"an environment must be named ID or MODULE:ID, as registered with Gymnasium, "
                f"got {shown(name)}"
            )
        return
    if name in gymnasium.registry:
        return
    versions = [k for k in gymnasium.registry if k.split("-v")[0] == name.split("-v")[0]]
    if home := module_of(name):
        raise InvalidArgumentError(
            f"{name} is an example of the repository: in a clone of it, --import {home} registers "
            f"it (in Python import {home})"
        )
    if not versions:
        raise UnknownNameError("environment", name, gymnasium.registry, hint=_IMPORT)
    if "-v" in name:
        raise UnknownNameError("environment", name, versions)


Environment = gymnasium.Env[Any, Any] | EnvironmentSpec | str  # one, how to make it, its id


@dataclass(frozen=True)
class Recipe:
    """All that it takes to make an environment in another process."""

    spec: EnvironmentSpec  # how it is made
    registered: Any  # the entry of Gymnasium's registry for its id; None if its id names a module
    names: Names | None  # the names of its features and actions, if a file has them

    @classmethod
    def of(cls, spec: EnvironmentSpec | str) -> "Recipe":
        """Return the recipe of the environment that ``make`` makes here and now.

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


def opened(env: Environment) -> AbstractContextManager[gymnasium.Env[Any, Any]]:
    """Return an environment as it is, or one that is made here and closed in the end."""
    given = made(env, None)[0]
    return nullcontext(given) if given is env else closing(given)
