"""Make an environment from its id, with errors that a user can act on.

A file of demonstrations or of a policy names the environment it is of, and says how it was made. It
may come from a stranger, and the registry holds environments that import, load or open what their
arguments name. So what a file chooses is limited: parameters that the environment's own constructor
names, never ``render_mode``, and no text that could be the name of a file, a module or an address.
"""

import inspect
import re
from collections.abc import Iterator
from typing import Any

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
from eutree.interaction.decoding import (
    DECODE,
    ONE_HOT,
    DecodedObservation,
    decodes,
    one_hot_around,
)
from eutree.interaction.names import given_names
from eutree.interaction.own_folder import made_here
from eutree.schema import EnvironmentSpec

_IMPORT = "One of your own is known once its module is imported: --import MODULE."
MANNER = frozenset(
    {DECODE, ONE_HOT, ACTION_GRID}
)  # how it is observed and acted in, not what it is
# Those of gymnasium.make, and ours.
MAKE_ARGUMENTS = MANNER | {"max_episode_steps", "disable_env_checker"}
_NAMES_A_PLACE = re.compile(r"[.:/\\]")


def make(spec: EnvironmentSpec | str, *, render_mode: str | None = None) -> gymnasium.Env[Any, Any]:
    """Return ``gymnasium.make`` of an id or a spec, with the names that are given now.

    The argument ``decode=True``, unless the environment has one of that name itself, makes its
    observations what its codes stand for; see ``DecodedObservation``. With ``one_hot=True`` each
    value of a ``Discrete`` is a feature of its own. With ``action_grid=...`` its actions are
    combinations of the levels named there; see ``GriddedAction``. An environment that decodes, is
    flat, or has that grid, itself is left as it is.

    Raises:
        UnknownNameError: No environment of that id is registered; names the nearest.
        InvalidArgumentError: The environment cannot be made: it does not take these arguments, a
            file chose what only a user may, it raises, or the module that its id names before a
            colon cannot be imported.
        MissingExtraError: The environment needs a package that is not installed.
    """
    spec = EnvironmentSpec(spec) if isinstance(spec, str) else spec
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
        if taken.get(ONE_HOT) and one_hot_around(env) is None:
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
    except BaseException as error:  # whatever an environment's author lets happen
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
    """Return the first line of what was raised; its type too where that says more."""
    try:
        first = str(error).strip().partition("\n")[0]
    except Exception:  # of its own ``__str__``
        first = ""
    known = isinstance(error, TypeError | ValueError | AssertionError | GymnasiumError)
    kind = type(error).__name__
    return (first if known else f"{kind}: {first}") if first else kind


def _check_known(name: str) -> None:
    """Raise unless ``name`` is registered, or may be once the module before its colon is imported.

    Raises:
        UnknownNameError: It is not registered; names the nearest.
        InvalidArgumentError: Before the colon stands no module's name.
    """
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
    if not any(known.split("-v")[0] == name.split("-v")[0] for known in gymnasium.registry):
        raise UnknownNameError("environment", name, gymnasium.registry, hint=_IMPORT)
    versions = [k for k in gymnasium.registry if k.split("-v")[0] == name.split("-v")[0]]
    if "-v" in name:
        raise UnknownNameError("environment", name, versions)
