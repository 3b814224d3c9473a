"""Make an environment from its id, with errors that a user can act on."""

from typing import Any

import gymnasium
from gymnasium.error import Error as GymnasiumError

from eutree.errors import (
    EutreeError,
    InvalidArgumentError,
    MissingExtraError,
    UnknownNameError,
    shown,
)
from eutree.interaction.names import given_names
from eutree.schema import EnvironmentSpec

_IMPORT = "One of your own is known once its module is imported: --import MODULE."


def make(spec: EnvironmentSpec | str, *, render_mode: str | None = None) -> gymnasium.Env[Any, Any]:
    """Return ``gymnasium.make`` of an id or a spec, with the names that are given now.

    Raises:
        UnknownNameError: No environment of that id is registered; names the nearest.
        InvalidArgumentError: The environment cannot be made: it does not take these arguments, it
            raises, or the module that its id names before a colon cannot be imported.
        MissingExtraError: The environment needs a package that is not installed.
    """
    spec = EnvironmentSpec(spec) if isinstance(spec, str) else spec
    _check_known(spec.id)
    arguments = dict(spec.arguments)
    if render_mode is not None:
        arguments["render_mode"] = render_mode
    try:
        env = gymnasium.make(spec.id, **arguments)
    except EutreeError:
        raise
    except ModuleNotFoundError as error:
        raise InvalidArgumentError(f"cannot make {spec}: {error.__cause__ or error}") from error
    except gymnasium.error.DependencyNotInstalled:
        raise MissingExtraError(f"a package that {spec.id} needs", "envs") from None
    except (Exception, SystemExit) as error:  # whatever an environment's author lets happen
        raise InvalidArgumentError(f"cannot make {spec}: {_reason(error)}") from error
    names = given_names()
    if names is not None:
        names.give(env)
    return env


def _reason(error: BaseException) -> str:
    """Return the first line of what was raised; its type too where that says more."""
    lines = str(error).strip().splitlines()
    known = isinstance(error, TypeError | ValueError | AssertionError | GymnasiumError)
    kind = type(error).__name__
    return (lines[0] if known else f"{kind}: {lines[0]}") if lines else kind


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
