"""Make an environment from its id, with errors that a user can act on."""

from typing import Any

import gymnasium
from gymnasium.error import Error as GymnasiumError

from eutree.errors import EutreeError, InvalidArgumentError, MissingExtraError, UnknownNameError
from eutree.schema import EnvironmentSpec


def make(spec: EnvironmentSpec | str, *, render_mode: str | None = None) -> gymnasium.Env[Any, Any]:
    """Return ``gymnasium.make`` of an id or a spec.

    Raises:
        UnknownNameError: No environment of that id is registered; names the nearest.
        InvalidArgumentError: The environment does not take these arguments, or the module that
            its id names before a colon cannot be found.
        MissingExtraError: The environment needs a package that is not installed.
    """
    spec = EnvironmentSpec(spec) if isinstance(spec, str) else spec
    _check_known(spec.id)
    arguments = dict(spec.arguments)
    if render_mode is not None:
        arguments["render_mode"] = render_mode
    try:
        return gymnasium.make(spec.id, **arguments)
    except EutreeError:
        raise
    except ModuleNotFoundError as error:
        if ":" not in spec.id:
            raise
        raise InvalidArgumentError(f"cannot make {spec}: {error.__cause__ or error}") from error
    except gymnasium.error.DependencyNotInstalled:
        raise MissingExtraError(f"a package that {spec.id} needs", "envs") from None
    except (TypeError, ValueError, AssertionError, GymnasiumError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InvalidArgumentError(f"cannot make {spec}: {reason}") from error


def _check_known(name: str) -> None:
    """Raise UnknownNameError unless ``name`` is registered (a module prefix is imported)."""
    if ":" in name:
        return
    if name in gymnasium.registry:
        return
    if not any(known.split("-v")[0] == name.split("-v")[0] for known in gymnasium.registry):
        raise UnknownNameError("environment", name, gymnasium.registry)
    versions = [k for k in gymnasium.registry if k.split("-v")[0] == name.split("-v")[0]]
    if "-v" in name:
        raise UnknownNameError("environment", name, versions)
